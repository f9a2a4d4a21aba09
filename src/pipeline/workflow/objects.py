"""Which objects take part: those that the scan stage makes and the folders that a user dropped in data/raw."""

import os
import re
from collections.abc import Collection
from dataclasses import dataclass
from pathlib import Path

from pipeline.errors import PipelineError
from pipeline.workflow.configuration import nearest

NAME = re.compile(r"[a-z0-9][a-z0-9_]*")
# Files of the assembled tables beside parametrise/<source>/<object>.parquet.
RESERVED = ("parameters", "tilt_references", "uncertainties")
SCANNED = re.compile(r"frame-\d{6}\.(depth\.png|pose\.txt)|camera-intrinsics\.txt")


@dataclass(frozen=True)
class Objects:
    """Names in alphabetical order, so that no result depends on the order in a configuration file."""

    demonstration: tuple[str, ...]
    dropped: tuple[str, ...]

    @property
    def names(self) -> tuple[str, ...]:
        """Return every object that takes part."""
        return tuple(sorted(self.demonstration + self.dropped))


def find(raw: str | Path, config: dict) -> Objects:
    """Return the objects of `scan.objects` and of the folder `raw`, without those of `objects.exclude`.

    Hidden files are ignored. These are errors: a folder with another name than `[a-z0-9][a-z0-9_]*`, a stray file, a
    foreign file in a folder that the scan stage writes, braces in a file's name, a configured name that is nowhere.
    """
    exclude = set(config["objects"]["exclude"])
    scanned = set(config["scan"]["objects"])
    folders = _folders(Path(raw), exclude)
    _check_configured("objects.exclude", exclude, scanned | folders)
    found = Objects(tuple(sorted(scanned - exclude)), tuple(sorted(folders - scanned - exclude)))
    for name in found.demonstration:
        _check_demonstration(Path(raw) / name)
    for name in found.dropped:
        _check_dropped(Path(raw) / name)
    _check_roles(config, found, exclude)
    return found


def sources(config: dict) -> list[str]:
    """Return the names of the sources: `objects.source` is one, or a list of them."""
    named = config["objects"]["source"]
    return [named] if isinstance(named, str) else list(named)


def files(folder: str | Path) -> list[str]:
    """Return every file below `folder` in alphabetical order; hidden ones are left out, links are followed."""
    found: list[str] = []
    walked = set()
    for parent, folders, names in os.walk(folder, followlinks=True):
        walked.add(os.path.realpath(parent))
        folders[:] = [name for name in folders if not name.startswith(".")]
        # A link to a folder above would lead round and round.
        folders[:] = [name for name in folders if os.path.realpath(os.path.join(parent, name)) not in walked]
        found += [os.path.join(parent, name) for name in names if not name.startswith(".")]
    return sorted(found)


def demonstrated(folder: str | Path, names: Collection[str]) -> bool:
    """Return whether `folder` holds demonstrations, and of a pair of containers that are among `names`.

    Errors: there are demonstrations, but not under this name; pair.yaml cannot be read.
    """
    from pipeline.motion.demonstrations import read_pair

    folder = Path(folder)
    if not folder.is_dir():
        others = sorted(path.parent.name for path in folder.parent.glob("*/pair.yaml"))
        if others:
            raise PipelineError(
                f"primitives.demonstrations: expected one of {' '.join(others)}, found '{folder.name}'"
                f"{nearest(folder.name, others)}; correct it"
            )
        return False
    shown = read_pair(folder / "pair.yaml")
    return {shown["held_object"], shown["target_object"]} <= set(names)


def _folders(raw: Path, exclude: set[str]) -> set[str]:
    names = set()
    for path in sorted(raw.iterdir()) if raw.is_dir() else []:
        if path.name.startswith("."):
            continue
        if path.name in exclude:
            names.add(path.name)
            continue
        if not path.is_dir():
            raise PipelineError(
                f"{path}: expected a folder an object, found a file; put it in a folder named after the object, "
                f"such as {raw}/my_mug/{path.name}"
            )
        if not NAME.fullmatch(path.name) or path.name in RESERVED:
            raise PipelineError(
                f"{path}/: expected an object's name of small letters, digits and underscores (not "
                f"{' or '.join(RESERVED)}), found '{path.name}'; rename the folder, for instance to '{_proposal(path.name)}'"
            )
        names.add(path.name)
    return names


def _proposal(name: str) -> str:
    words = re.sub(r"[^a-z0-9]+", "_", name.lower()).strip("_") or "my_mug"
    return f"my_{words}" if words in RESERVED else words


def _check_demonstration(folder: Path) -> None:
    foreign = [path for path in files(folder) if not SCANNED.fullmatch(str(Path(path).relative_to(folder)))]
    if foreign:
        raise PipelineError(
            f"{foreign[0]}: expected only what the scan stage writes, as '{folder.name}' is in scan.objects, found a file of "
            f"another kind; rename the folder, or take '{folder.name}' out of scan.objects"
        )


def _check_dropped(folder: Path) -> None:
    for path in files(folder):
        if "{" in path or "}" in path:  # Snakemake would read a wildcard
            raise PipelineError(f"{path}: expected a file name without braces, found some; rename the file")
        if not path.isprintable():
            raise PipelineError(f"{path!a}: expected a file name of printable characters; rename the file")
        if not os.path.exists(path):
            raise PipelineError(f"{path}: expected a file, found a link to nothing; remove it or mend it")


def _check_configured(key: str, names: set[str], known: set[str]) -> None:
    for name in sorted(names - known):
        raise PipelineError(
            f"{key}: expected objects of scan.objects or data/raw ({' '.join(sorted(known))}), found '{name}'"
            f"{nearest(name, known)}; correct it or take it out"
        )


def _check_roles(config: dict, found: Objects, exclude: set[str]) -> None:
    roles = [("objects.source", name) for name in sources(config)]
    roles += [
        ("simulate.filling.held_objects", name) for name in config["simulate"]["filling"]["held_objects"]
    ]
    for stage in ("execute", "primitives"):
        for pair in config.get(stage, {}).get("pairs", []):
            roles += [(f"{stage}.pairs", name) for name in pair.split("/")]
    for key, name in roles:
        if name in exclude:
            raise PipelineError(
                f"{key}: expected an object that takes part, found '{name}', which objects.exclude leaves out; "
                "take it out of one of the two"
            )
        _check_configured(key, {name}, set(found.names))
    if len(found.names) < 2:
        raise PipelineError(
            f"objects: expected at least two, a source and a novel one, found {' '.join(found.names)}; "
            "drop another in data/raw or name it in scan.objects"
        )
