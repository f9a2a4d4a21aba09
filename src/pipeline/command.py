"""What every stage's `python -m pipeline.<stage>` shares: options, errors as one sentence, progress lines."""

import argparse
import gc
import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TypeVar

from pipeline.errors import PipelineError

T = TypeVar("T")


def parser(doc: str | None) -> argparse.ArgumentParser:
    """Return an option parser that shows `doc` and every default, and takes options in full only."""
    return argparse.ArgumentParser(
        description=doc, formatter_class=argparse.ArgumentDefaultsHelpFormatter, allow_abbrev=False
    )


def run(main: Callable[[], None]) -> None:
    """Call `main`; a `PipelineError` ends the program with its one sentence on stderr and exit code 1.

    Ctrl-C ends it by its signal, without a word.
    """
    # What libraries make as they load is no garbage, and there is much of it: it is looked through seldom, and not at the end.
    gc.set_threshold(50_000)
    try:
        main()
    except PipelineError as error:
        say(f"error: {error}")
        sys.exit(1)
    except KeyboardInterrupt:
        # Ended by the signal, not by a number: a shell's loop about it ends, too.
        signal.signal(signal.SIGINT, signal.SIG_DFL)
        os.kill(os.getpid(), signal.SIGINT)
    finally:
        gc.freeze()


def say(message: str) -> None:
    """Write one line to stderr, where the workflow's logs come from."""
    sys.stderr.write(f"{message}\n")
    sys.stderr.flush()


def progress(items: Iterable[T], total: int, what: str, every_s: float = 5.0) -> Iterator[T]:
    """Yield `items` with a bar on a terminal, and in a log with a line every few seconds: how many, the rate, the time left."""
    if sys.stderr.isatty():
        from tqdm import tqdm

        yield from tqdm(items, what, total, file=sys.stderr, leave=False, dynamic_ncols=True)
        return
    start = said = time.monotonic()
    for done, item in enumerate(items):
        now = time.monotonic()
        if now - said >= every_s and done:
            said, rate = now, done / (now - start)
            say(f"{what}: {done}/{total} ({rate:.1f}/s, {(total - done) / rate:.0f} s left)")
        yield item


@contextmanager
def steps(what: str, total: int, every_s: float = 5.0) -> Iterator[Callable[[str], None]]:
    """Yield what is told each step of a long task when it begins; a line every few seconds says which one is at work."""
    begun: list[str] = []
    start, over = time.monotonic(), threading.Event()

    def remind() -> None:
        while not over.wait(every_s):
            for step in begun[-1:]:
                say(f"{what}: {step} (step {len(begun)} of {total}, {time.monotonic() - start:.0f} s so far)")

    reminder = threading.Thread(target=remind, daemon=True)
    reminder.start()
    try:
        yield begun.append
    finally:
        over.set()
        reminder.join()


def untold(step: str) -> None:
    """Tell nothing of a step: what functions that take `steps` do by default."""


def name_and_path(text: str) -> tuple[str, Path]:
    """Return both halves of an option such as --held NAME=FILE."""
    name, equals, path = text.partition("=")
    if not (name and equals and path):
        raise PipelineError(
            f"--held {text}: expected NAME=FILE, such as mug=data/processed/simulate/containers/mug.npz"
        )
    return name, Path(path)
