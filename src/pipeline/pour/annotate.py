"""Paint container, rim and handle on a scanned object, in the browser."""

import argparse

from pipeline.pour.project import Project


def options(parser: argparse.ArgumentParser) -> None:
    """Add this subcommand's options."""
    parser.add_argument("object", help="name of an object of data/raw")


def call(options: argparse.Namespace) -> dict:
    """Return the object's name."""
    return {"object": Project(options.project).check(options.object)}


def text(result: dict) -> str:
    """Return the result in words."""
    return str(result["object"])
