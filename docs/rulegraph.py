"""Draw the rules of the workflow and what they hand on: `python docs/rulegraph.py` writes docs/rulegraph.svg.

Snakemake tells the graph; it is drawn with the first rules at the top, each rule below all that it waits for.
"""

import re
import subprocess
import sys
from pathlib import Path

import networkx as nx

ROOT = Path(__file__).parents[1]
TARGET = "reports/roc.pdf"
NODE, EDGE = re.compile(r'(\d+)\[label = "(\w+)'), re.compile(r"(\d+) -> (\d+)")
WIDTH, HEIGHT, ACROSS, DOWN = 196, 34, 216, 74
STYLE = (
    "text{font:15px sans-serif;fill:#1b1b1b}rect{fill:#f2f6fa;stroke:#0072b2;stroke-width:1.5}"
    "path{fill:none;stroke:#888;stroke-width:1.3}"
)


def main() -> None:
    """Ask Snakemake in the project's folder; write the picture beside this file."""
    (ROOT / "docs/rulegraph.svg").write_text(svg(rules()))


def rules(folder: Path = ROOT, target: str = TARGET) -> nx.DiGraph:
    """Return the rules that lead to a target, an edge from each to those that wait for it."""
    command = [sys.executable, "-m", "snakemake", "--rulegraph", "dot", "--forceall", target]
    said = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=True).stdout
    names = dict(NODE.findall(said))
    graph = nx.DiGraph()
    graph.add_nodes_from(sorted(names.values()))
    graph.add_edges_from((names[a], names[b]) for a, b in EDGE.findall(said))
    return nx.transitive_reduction(graph)


def svg(graph: nx.DiGraph) -> str:
    """Return the graph as a picture."""
    rows = _rows(graph)
    stepped = _stepped(graph, rows)
    at = _places(stepped, rows)
    left = min(x for x, _ in at.values()) - WIDTH / 2 - 8
    right = max(x for x, _ in at.values()) + WIDTH / 2 + 8
    bottom = max(y for _, y in at.values()) + HEIGHT + 8
    parts = [_line(at[a], at[b]) for a, b in stepped.edges]
    parts += [_box(name, *at[name]) if name in graph else _way(*at[name]) for name in stepped]
    size = f'viewBox="{left:g} -8 {right - left:g} {bottom + 8:g}" width="{right - left:g}"'
    head = f'<svg xmlns="http://www.w3.org/2000/svg" {size}>'
    return "\n".join(
        [head, f"<title>Rules that lead to {TARGET}</title><style>{STYLE}</style>", *parts, "</svg>\n"]
    )


def _rows(graph: nx.DiGraph) -> dict[str, int]:
    """Return the row of each rule, as far down as what waits for it lets it be."""
    generations = list(nx.topological_generations(graph.reverse()))[::-1]
    return {name: row for row, names in enumerate(generations) for name in names}


def _stepped(graph: nx.DiGraph, rows: dict[str, int]) -> nx.DiGraph:
    """Return the graph with a place in each row that an edge passes, so that edges go around boxes; `rows` gets them, too."""
    stepped = nx.DiGraph()
    stepped.add_nodes_from(sorted(graph))
    for a, b in sorted(graph.edges):
        between = [f"{a}>{b}>{row}" for row in range(rows[a] + 1, rows[b])]
        rows |= {place: rows[a] + 1 + k for k, place in enumerate(between)}
        nx.add_path(stepped, [a, *between, b])
    return stepped


def _places(graph: nx.DiGraph, rows: dict[str, int]) -> dict[str, tuple[float, float]]:
    """Return where the middle of each box's upper edge is: in a row by where its inputs are."""
    at: dict[str, tuple[float, float]] = {}
    for row in range(max(rows.values()) + 1):
        names = [name for name in graph if rows[name] == row]
        wished = {
            name: sum(at[a][0] for a in graph.predecessors(name)) / max(graph.in_degree(name), 1)
            for name in names
        }
        order = sorted(names, key=lambda name: (wished[name], ">" in name, name))
        widths = [ACROSS if ">" not in name else ACROSS / 4 for name in order]
        x = sum(wished.values()) / len(wished) - sum(widths) / 2
        for name, width in zip(order, widths, strict=True):
            at[name] = (x + width / 2, row * DOWN)
            x += width
    return at


def _line(a: tuple[float, float], b: tuple[float, float]) -> str:
    y0, y1 = a[1] + HEIGHT, b[1]
    bend = (y1 - y0) / 2
    return f'<path d="M{a[0]:g} {y0:g}C{a[0]:g} {y0 + bend:g} {b[0]:g} {y1 - bend:g} {b[0]:g} {y1:g}"/>'


def _way(x: float, y: float) -> str:
    return f'<path d="M{x:g} {y:g}V{y + HEIGHT:g}"/>'


def _box(name: str, x: float, y: float) -> str:
    words = name.replace("_", " ")
    box = f'<rect x="{x - WIDTH / 2:g}" y="{y:g}" width="{WIDTH}" height="{HEIGHT}" rx="6"/>'
    return f'{box}<text x="{x:g}" y="{y + HEIGHT / 2 + 5:g}" text-anchor="middle">{words}</text>'


if __name__ == "__main__":
    main()
