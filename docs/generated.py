"""The pages of the reference that are read off the code: configuration, tables, `pour`, and every public function."""

import argparse
import ast
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import yaml

ROOT = Path(__file__).parents[1]
PACKAGE = ROOT / "src/pipeline"
# In the order of the data's way; the rooms that several use come last.
ROOMS = {
    "scan": "A virtual depth camera looks at objects of known shape.",
    "fuse": "From depth images, meshes or clouds to one closed surface.",
    "label": "Container, rim and handle.",
    "warp": "Points of the source on another object.",
    "parametrise": "Parameters read off warped points.",
    "simulate": "What is poured, and what happens to it.",
    "classify": "Learning from trials, and testing.",
    "primitives": "Motor primitives of a pair.",
    "execute": "The robot.",
    "report": "Figures and numbers.",
    "track": "What MLflow is told.",
    "pour": "The command line.",
    "geometry": "Frames, sampling, hulls, cavities: knows no stage.",
    "motion": "Demonstrations and probabilistic movement primitives.",
    "statistics": "Rates of weighted trials, the bootstrap over objects.",
    "scene": "Objects for the browser.",
    "workflow": "What the Snakefile asks.",
    "": "What every room may use.",
}
# Cannot be imported without the extra `gpu`.
OPTIONAL = {"pipeline.simulate.device"}


def write(folder: Path) -> None:
    """Write all pages into `folder`; those that are as they were are left alone, so that a second build is quick."""
    api = folder / "api"
    pages = {folder / f"{name}.md": text() for name, text in PAGES.items()}
    pages |= {api / f"{room or 'shared'}.rst": room_page(room) for room in ROOMS}
    pages[api / "index.md"] = api_index()
    for path, text in pages.items():
        path.parent.mkdir(exist_ok=True)
        if not path.is_file() or path.read_text() != text:
            path.write_text(text)


def configuration() -> str:
    """Return the page of all keys of the configuration, a section a table."""
    schema = yaml.safe_load((ROOT / "workflow/schemas/config.schema.yaml").read_text())
    config = yaml.safe_load((ROOT / "config/config.yaml").read_text())
    lines = ["# Configuration", ""]
    lines += [
        "`config/config.yaml` has every key, with its default below. A key that is not there is refused with the nearest name, "
        "a value outside its range with the range. One call alone is changed by `--config`, a run of another kind by an "
        "overlay such as `config/test.yaml`.",
        "",
    ]
    for name, section in schema["properties"].items():
        lines += [f"## {name}", "", _plain(section["description"]), "", *_keys(section, config[name], name)]
    return "\n".join(lines) + "\n"


def _keys(section: dict[str, Any], values: dict[str, Any], name: str) -> list[str]:
    keys = section["properties"]
    plain = {key: inner for key, inner in keys.items() if inner.get("type") != "object"}
    lines = ["| key | default | what it is | allowed |", "|---|---|---|---|"] if plain else []
    for key, inner in plain.items():
        lines.append(
            f"| `{key}` | {_value(values[key])} | {_cell(inner['description'])} | {_allowed(inner)} |"
        )
    lines.append("")
    for key, inner in keys.items():
        if key in plain:
            continue
        lines += [
            f"### {name}.{key}",
            "",
            _plain(inner["description"]),
            "",
            *_keys(inner, values[key], f"{name}.{key}"),
        ]
    return lines


def _value(value: Any) -> str:
    if isinstance(value, list):
        return ", ".join(f"`{item}`" for item in value) or "none"
    return f"`{str(value).lower() if isinstance(value, bool) else value}`"


def _allowed(key: dict[str, Any]) -> str:
    """Return in words what the schema allows."""
    if "anyOf" in key or "oneOf" in key:
        return " or ".join(_allowed(one) for one in key.get("anyOf", key.get("oneOf")))
    if key.get("type") == "array":
        return f"list of: {_allowed(key.get('items', {}))}"
    if "enum" in key:
        return ", ".join(f"`{one}`" for one in key["enum"])
    if isinstance(key.get("type"), list):
        return " or ".join(_allowed({**key, "type": one}) for one in key["type"])
    ends = [
        f"{sign} {key[end]}"
        for end, sign in (("minimum", "≥"), ("exclusiveMinimum", ">"), ("maximum", "≤"))
        if end in key
    ]
    return " and ".join([str(key.get("type", "any")), *ends]).replace(" and ", ", ", 1)


def _cell(text: str) -> str:
    return _plain(text).replace("|", r"\|").replace("\n", " ")


def _plain(text: str) -> str:
    """Return words in which <name> is no HTML and -- no dash."""
    return re.sub(r"(\S*<\w+>\S*?|--[a-z-]+)(?=[\s;:,.)]|$)", r"`\1`", text)


def tables() -> str:
    """Return the page of all tables: what each is, its columns and their types."""
    from pipeline.schemas import TABLES

    said = _comments(PACKAGE / "schemas.py")
    lines = ["# Tables", ""]
    lines += [
        "Parquet (zstd), read and written by `pipeline.artefacts`, which refuses any other column. Units and frames are in the "
        "names; poses are 4 × 4 matrices, row by row.",
        "",
    ]
    for name, schema in TABLES.items():
        lines += [f"## {name}", "", _plain(said.get(name, "")), "", "| column | type |", "|---|---|"]
        lines += [f"| `{column.name}` | {column.type} |" for column in schema]
        lines.append("")
    return "\n".join(lines)


def _comments(path: Path) -> dict[str, str]:
    """Return the comment before each entry of TABLES."""
    found: dict[str, str] = {}
    words: list[str] = []
    for line in path.read_text().splitlines():
        if line.startswith("    # "):
            words.append(line.removeprefix("    # "))
        elif line.startswith('    "') and "pa.schema(" in line:
            found[line.split('"')[1]], words = " ".join(words), []
    return found


def pour() -> str:
    """Return the page of the console script: the help of every subcommand."""
    from pipeline.pour.__main__ import EXIT_CODES, SUBCOMMANDS, parser

    top = parser()
    lines = ["# pour", "", _plain(top.description or ""), "", _sentence(EXIT_CODES), ""]
    of = next(action for action in top._actions if isinstance(action, argparse._SubParsersAction))
    for module in SUBCOMMANDS:
        name = module.__name__.rpartition(".")[2]
        one = of.choices[name]
        lines += [f"## pour {name}", "", _plain(one.description or ""), ""]
        lines += ["```text", one.format_usage().removeprefix("usage: ").rstrip(), "```", ""]
        lines += ["| option | what it is | default |", "|---|---|---|"]
        lines += [_option(action) for action in one._actions if action.dest != "help"]
        lines.append("")
    return "\n".join(lines)


def _sentence(text: str) -> str:
    return f"{text[0].upper()}{text[1:]}."


def _option(action: argparse.Action) -> str:
    name = ", ".join(f"`{option}`" for option in action.option_strings) or f"`{action.dest}`"
    words = _cell((action.help or "").replace("%%", "%"))
    if action.choices:
        words += f": {', '.join(f'`{choice}`' for choice in action.choices)}"
    default = "" if action.default in (None, False) else f"`{action.default}`"
    return f"| {name} | {words} | {default} |"


def api_index() -> str:
    """Return the page that leads to the rooms."""
    lines = ["# Functions", ""]
    lines += [
        "Every public function and class, by the room it is in; what a room may know of another is in `CONTRIBUTING.md`. "
        "Arrays go in and come out; shapes are in brackets, units and frames in the names.",
        "",
        "```{toctree}",
        *(room or "shared" for room in ROOMS),
        "```",
    ]
    return "\n".join(lines) + "\n"


def room_page(room: str) -> str:
    """Return the page of a room, reStructuredText: an automodule for each module that has something public."""
    title = f"pipeline.{room}" if room else "pipeline"
    lines = [title, "=" * len(title), "", ROOMS[room], ""]
    for module in modules(room):
        short = module.removeprefix("pipeline.")
        lines += [short, "-" * len(short), "", f".. automodule:: {module}", "   :members:", ""]
    return "\n".join(lines)


def modules(room: str) -> Iterator[str]:
    """Yield the modules of a room that define a public function or class; commands (__main__) are told by their --help."""
    paths = sorted((PACKAGE / room).rglob("*.py") if room else PACKAGE.glob("*.py"))
    for path in paths:
        name = ".".join(path.relative_to(PACKAGE.parent).with_suffix("").parts).removesuffix(".__init__")
        if path.stem != "__main__" and name not in OPTIONAL and _has_public(path):
            yield name


def _has_public(path: Path) -> bool:
    defined = (ast.FunctionDef, ast.ClassDef)
    return any(
        isinstance(node, defined) and not node.name.startswith("_") and node.name != "main"
        for node in ast.parse(path.read_text()).body
    )


PAGES = {"configuration": configuration, "tables": tables, "pour": pour}
