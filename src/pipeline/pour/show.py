"""Show what the pipeline knows of an object: parameters, parts, how well it was scanned."""

import argparse
import math
from typing import Any

from pipeline.artefacts import read_json, read_table
from pipeline.pour.project import Project
from pipeline.predictions import MAPPINGS, PARAMETERS

PARTS = ("container", "rim", "handle")
SCAN = (
    *("layout", "n_views", "poses", "share_seen", "seen", "residual_m", "watertight"),
    *("views_left_out", "views_without_object", "complaints"),
)


def options(parser: argparse.ArgumentParser) -> None:
    """Add this subcommand's options."""
    parser.add_argument("object", help="name of an object of data/raw")


def call(options: argparse.Namespace) -> dict:
    """Return what there is; what the workflow has not made yet is null."""
    project = Project(options.project)
    name, source = project.check(options.object), project.source()
    report = read_json(project.made(f"fuse/{name}/fusion.json"))
    return {
        "object": name,
        "source": name == source,
        "scan": {key: report[key] for key in SCAN if key in report},
        "parts": _parts(project, source, name),
        "parameters": _parameters(project, source, name),
    }


def _parts(project: Project, source: str, name: str) -> dict[str, float] | None:
    """Return each part's share of the surface: as mapped from the source, or as estimated at first."""
    mapped = project.processed / "warp" / source / name / "label_mapping.parquet"
    labels = project.processed / "label" / name / "labels.parquet"
    for path, table in ((mapped, "mapping"), (labels, "labels")):
        if path.is_file():
            found = read_table(path, table)
            found = found[found["valid"]] if table == "mapping" else found
            area_m2 = found["area_m2"].sum()
            return {part: float(found.loc[found[part], "area_m2"].sum() / area_m2) for part in PARTS}
    return None


def _parameters(project: Project, source: str, name: str) -> dict[str, dict[str, float]] | None:
    path = project.processed / "parametrise" / source / "parameters.parquet"
    if not path.is_file():
        return None
    table = read_table(path, "parameters")
    rows = table[table["object"] == name].set_index("mapping")
    return {
        mapping: {key: float(rows.loc[mapping, key]) for key in PARAMETERS}
        for mapping in MAPPINGS
        if mapping in rows.index
    } or None


def text(result: dict) -> str:
    """Return the result in words."""
    name = f"{result['object']}{' (the annotated source)' if result['source'] else ''}"
    return "\n".join(
        [name, *_scan(result["scan"]), *_shares(result["parts"]), *_numbers(result["parameters"])]
    )


def _scan(scan: dict[str, Any]) -> list[str]:
    views = f", {scan['n_views']} views, poses {scan.get('poses', 'given')}" if scan["n_views"] else ""
    closed = "closed" if scan["watertight"] else "not closed"
    lines = [f"  scan        {scan['layout']}{views}, surface {closed}"]
    if scan.get("seen"):
        seen = ", ".join(f"{part.replace('_', ' ')} {share:.0%}" for part, share in scan["seen"].items())
        lines.append(f"  seen        {scan['share_seen']:.0%} of the surface ({seen})")
    if scan.get("residual_m"):
        residual = scan["residual_m"]
        lines.append(
            f"  fits to     {residual['median'] * 1e3:.1f} mm (median), {residual['quantile_95'] * 1e3:.1f} mm (95 %)"
        )
    return lines + [f"  told        {complaint}" for complaint in scan.get("complaints", [])]


def _shares(parts: dict[str, float] | None) -> list[str]:
    if parts is None:
        return ["  parts       not made yet; run: snakemake -c2 reports/roc.pdf"]
    return [
        "  parts       "
        + ", ".join(f"{part} {share:.0%}" for part, share in parts.items())
        + " of the surface"
    ]


def _numbers(parameters: dict[str, dict[str, float]] | None) -> list[str]:
    if parameters is None:
        return ["  parameters  not made yet; run: snakemake -c2 reports/roc.pdf"]
    rows = {
        "radius": ("radius_m", 1e3, "mm"),
        "height": ("height_m", 1e3, "mm"),
        "hull volume": ("volume_m3", 1e6, "ml"),
        "capacity": ("capacity_m3", 1e6, "ml"),
        "tilt reference": ("tilt_reference_rad", math.degrees(1.0), "°"),
    }
    head = "  parameters      " + "".join(f"{mapping.replace('_', ' '):>16}" for mapping in parameters)
    lines = [
        f"    {what:<14}"
        + "".join(f"{values[key] * scale:>12.1f} {unit:<3}" for values in parameters.values())
        for what, (key, scale, unit) in rows.items()
    ]
    return [head, *lines]
