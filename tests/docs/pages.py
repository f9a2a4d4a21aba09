"""What is typed in the documentation: code blocks, and commands between backticks."""

import re
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[2]
GENERATED = ROOT / "docs/reference"
FENCE = re.compile(r"^```(\w+)\n(.*?)^```", re.MULTILINE | re.DOTALL)
HEREDOC = re.compile(r".*<<'(\w+)'.*\n(?:.*\n)*?\1")
SPAN = re.compile(r"`((?:[A-Z_]+=\S+ )?(?:snakemake|pour|make|python|pip|mlflow|pytest) [^`]+)`")


@dataclass(frozen=True)
class Block:
    """A fenced block of a page, and of which language it is."""

    page: str
    language: str
    text: str


def pages() -> list[Path]:
    """Return the pages that a person wrote."""
    written = [path for path in sorted((ROOT / "docs").rglob("*.md")) if GENERATED not in path.parents]
    return [ROOT / "README.md", *written]


def blocks(language: str) -> list[Block]:
    """Return all blocks of a language."""
    found = []
    for path in pages():
        for name, text in FENCE.findall(path.read_text()):
            if name == language:
                found.append(Block(str(path.relative_to(ROOT)), name, text))
    return found


def commands() -> dict[str, list[str]]:
    """Return every command once, and the pages that print it."""
    found: dict[str, list[str]] = {}
    for block in blocks("bash"):
        for command in lines(block.text):
            found.setdefault(command, []).append(block.page)
    for path in pages():
        for command in SPAN.findall(FENCE.sub("", path.read_text())):
            found.setdefault(" ".join(command.split()), []).append(str(path.relative_to(ROOT)))
    return found


def lines(text: str) -> list[str]:
    """Return the commands of a block, without comments; what is fed to one by `<<'END'` belongs to it."""
    found, rest = [], text
    while rest.strip():
        fed = HEREDOC.match(rest)
        line = fed[0] if fed else rest.split("\n", 1)[0]
        rest = rest[len(line) :].lstrip("\n")
        command = line if fed else line.split("  #")[0].split(" # ")[0].strip()
        if command and not command.startswith("#"):
            found.append(command)
    return found
