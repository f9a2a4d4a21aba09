"""`pour` as a program, serving a page."""

import re
import subprocess
import sys
from contextlib import contextmanager


def command(project, *arguments):
    """Return the command line of `pour`."""
    return [sys.executable, "-m", "pipeline.pour", *arguments, "--project", str(project.folder)]


@contextmanager
def serving(project, *arguments):
    """Run a subcommand that serves a page; yield its address and the process."""
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    with subprocess.Popen(command(project, *arguments, "--no-browser", "--json"), **pipes) as process:
        try:
            said = process.stderr.readline()
            # Only a page that can close says that it is closed there.
            assert ("closed there" in said) == (arguments[0] == "annotate")
            yield re.match(r"http://127\.0\.0\.1:\d+/", said)[0], process
        finally:
            process.kill()
