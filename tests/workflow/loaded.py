"""A process that has Snakemake loaded and calls it in copies of itself, as `python -m snakemake` would: loading it takes longer.

Reads a line a call, [folder, words, file for stdout and stderr] in JSON; answers with a line, the exit code.
"""

import gc
import json
import os
import sys

import jsonschema  # noqa: F401  # what it would load later
import pandas  # noqa: F401
import requests  # noqa: F401
from snakemake import cli


def _call(folder: str, words: list[str], output: str) -> None:
    """Call Snakemake in this process, which ends with it."""
    os.chdir(folder)
    sys.path.insert(0, folder)
    sys.argv = ["snakemake", *words]
    with open(os.devnull) as nothing, open(output, "w") as said:
        for stream, file in ((0, nothing), (1, said), (2, said)):
            os.dup2(file.fileno(), stream)
    cli.main()


gc.disable()  # a dry run makes little that is not needed to its end, and looking for it takes a third of the time
for line in sys.stdin:
    if copy := os.fork():
        code = os.waitstatus_to_exitcode(os.waitpid(copy, 0)[1])
        sys.stdout.write(f"{code}\n")
        sys.stdout.flush()
    else:
        _call(*json.loads(line))
