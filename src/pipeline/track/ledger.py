"""What was said of each call, kept in files, so that a store that was lost, or could not be reached, can be told again."""

import os
from collections.abc import Iterator
from datetime import datetime
from pathlib import Path

from pipeline.artefacts import read_json, write_json
from pipeline.errors import PipelineError
from pipeline.track.runs import Run, digest_of, from_tree, to_tree

CALLS = Path("logs/track/calls")


def keep(call: Run, folder: Path = CALLS) -> Path:
    """Write down a call; return its file, named by when it began and by what it says."""
    begun = datetime.fromtimestamp(call.begun_s).strftime("%Y%m%d-%H%M%S")
    path = folder / f"{begun}-{digest_of(call)[:8]}.json"
    write_json(path, to_tree(call))
    return path


def calls(folder: Path = CALLS) -> Iterator[Run]:
    """Yield all calls that were kept, in the order in which they began."""
    for path in sorted(folder.glob("*.json")):
        tree = read_json(path)
        try:
            yield from_tree(tree)
        except (TypeError, KeyError, ValueError) as error:
            raise PipelineError(
                f"{path}: expected the record of a call, found something else ({error}); remove it"
            ) from error


def kept(folder: Path = CALLS) -> int:
    """Return how many calls were kept."""
    return len(list(folder.glob("*.json"))) if os.path.isdir(folder) else 0
