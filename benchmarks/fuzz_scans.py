"""Fuse spoilt scan folders: `python benchmarks/fuzz_scans.py --cases 500`.

Each must end in success or in one sentence that names the folder: no traceback, no crash, no hang, no partial output.
"""

import argparse
import collections
import json
import multiprocessing
import shutil
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).parents[1]
LIMIT_S = 120.0


def work(connection) -> None:
    """Fuse the folders that come through the connection, and send back how it ended."""
    import traceback

    from fuse import mutations

    while True:
        folder, out = connection.recv()
        try:
            connection.send(("ends well", mutations.outcome(folder, out)))
        except BaseException:
            connection.send(("BREAKS", traceback.format_exc()))


class Worker:
    """A process that is started again when it crashes or hangs."""

    def __init__(self) -> None:
        """Start nothing yet."""
        self.process = None

    def outcome(self, folder: Path, out: Path) -> tuple[str, str]:
        """Return how it ended."""
        if self.process is None:
            context = multiprocessing.get_context("spawn")
            self.connection, end = context.Pipe()
            self.process = context.Process(target=work, args=(end,), daemon=True)
            self.process.start()
        self.connection.send((folder, out))
        try:
            if self.connection.poll(LIMIT_S):
                return self.connection.recv()
            ended = ("HANGS", f"more than {LIMIT_S:.0f} s")
        except EOFError:
            ended = ("CRASHES", "the process died")
        self.process.kill()
        self.process = None
        return ended


def main() -> None:
    """Spoil, fuse, count; exit with 1 when anything went wrong."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cases", type=int, default=500)
    parser.add_argument("--first", type=int, default=0, help="seed of the first case")
    o = parser.parse_args()
    sys.path.insert(0, str(ROOT / "tests"))
    from fuse import mutations

    counts: collections.Counter[str] = collections.Counter()
    worker = Worker()
    with tempfile.TemporaryDirectory() as scratch:
        sources = mutations.sources(Path(scratch) / "sources")
        for seed in range(o.first, o.first + o.cases):
            source, case = sources[seed % len(sources)], Path(scratch) / "case"
            done = mutations.spoiled(source, case / "raw" / source.name, seed)
            how, what = worker.outcome(case / "raw" / source.name, case / "out")
            counts["success" if what == "success" else "sentence" if how == "ends well" else how] += 1
            line = {
                "seed": seed,
                "source": source.name,
                "done": done,
                "how": how,
                "what": what.replace(scratch, "…"),
            }
            sys.stdout.write(json.dumps(line, ensure_ascii=False) + "\n")
            sys.stdout.flush()
            shutil.rmtree(case)
    sys.stdout.write(json.dumps(counts) + "\n")
    sys.exit(not set(counts) <= {"success", "sentence"})


if __name__ == "__main__":
    main()
