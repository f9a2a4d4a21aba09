"""Pour with your own objects: add one, annotate one, look at what the pipeline made of it, ask what it learnt.

Works on the project in the folder where it is called (or --project) and on what `snakemake` has made there.
"""

import argparse
import json
import sys
from collections.abc import Sequence
from pathlib import Path
from types import ModuleType

from pipeline import command
from pipeline.pour import add, annotate, predict, show, view

# A subcommand is a module of its name with a docstring (its help), `options(parser)`, `call(options) -> dict` (numbers,
# texts, lists: what --json writes) and `text(result) -> str` (what is written otherwise). Add it here and nowhere else.
SUBCOMMANDS = (add, annotate, view, show, predict)
EXIT_CODES = "exit codes: 0 done; 1 something in your files or names is wrong (one sentence says what); 2 wrong options"


def main(arguments: Sequence[str] | None = None) -> None:
    """Run one subcommand; its result goes to stdout, messages and errors to stderr."""
    options = parser().parse_args(arguments)
    module = options.subcommand
    result = module.call(options)
    said = json.dumps(result, indent=2, allow_nan=False) if options.json else module.text(result)
    sys.stdout.write(f"{said}\n" if said else "")


def parser() -> argparse.ArgumentParser:
    """Return the parser of all subcommands."""
    top = argparse.ArgumentParser(
        "pour",
        description=__doc__,
        epilog=EXIT_CODES,
        allow_abbrev=False,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    subcommands = top.add_subparsers(metavar="COMMAND", required=True)
    for module in SUBCOMMANDS:
        _add(subcommands, module)
    return top


def _add(subcommands: "argparse._SubParsersAction[argparse.ArgumentParser]", module: ModuleType) -> None:
    name, doc = module.__name__.rpartition(".")[2], module.__doc__ or ""
    one = subcommands.add_parser(
        name,
        help=doc.partition("\n")[0].rstrip("."),
        description=doc,
        epilog=EXIT_CODES,
        allow_abbrev=False,
        formatter_class=_Help,
    )
    module.options(one)
    one.add_argument("--project", type=Path, default=Path("."), metavar="FOLDER", help="the project")
    one.add_argument("--json", action="store_true", help="write the result as one JSON object")
    one.set_defaults(subcommand=module)


class _Help(argparse.ArgumentDefaultsHelpFormatter, argparse.RawDescriptionHelpFormatter):
    """Docstrings as they are written, and defaults."""

    def _get_help_string(self, action: argparse.Action) -> str | None:
        return action.help if action.default in (None, False) else super()._get_help_string(action)


def script() -> None:
    """Run as the console script `pour`."""
    command.run(main)


if __name__ == "__main__":
    command.run(main)
