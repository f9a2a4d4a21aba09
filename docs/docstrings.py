"""Docstrings of the package are plain words with `code`: make them what Sphinx reads as such."""

import re

# Outside of code these would be links, emphasis and the like.
_SPECIAL = re.compile(r"([\\*|]|(?<=\w)_(?=\W|$))")


def process(app, what: str, name: str, obj, options, lines: list[str]) -> None:
    """Change the lines of a docstring in place."""
    lines[:] = [_line(line) for line in lines]


def _line(line: str) -> str:
    parts = line.split("`")
    if len(parts) % 2 == 0:  # a backtick alone
        return _SPECIAL.sub(r"\\\1", line)
    return "".join(f"``{part}``" if k % 2 else _SPECIAL.sub(r"\\\1", part) for k, part in enumerate(parts))
