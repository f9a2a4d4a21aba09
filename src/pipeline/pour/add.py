"""Add an object: a mesh, a point cloud, or a folder with a scan.

It is copied into data/raw/<name>/ and read as the workflow reads it; what cannot be read is refused, and nothing is left there.
"""

import argparse
import os
import re
import shutil
from pathlib import Path

import yaml

from pipeline.errors import PipelineError
from pipeline.fuse.layouts import CLOUDS, MESHES
from pipeline.pour.project import Project
from pipeline.workflow.objects import NAME, RESERVED

SUFFIXES = MESHES + CLOUDS


def options(parser: argparse.ArgumentParser) -> None:
    """Add this subcommand's options."""
    parser.add_argument("path", type=Path, help=f"file ({' '.join(SUFFIXES)}) or folder with a scan")
    parser.add_argument("--name", required=True, help="small letters, digits, underscores")
    parser.add_argument(
        "--units", choices=("m", "cm", "mm"), help="of meshes, clouds, poses; metres when not given"
    )
    parser.add_argument(
        "--up",
        choices=("x", "y", "z", "-x", "-y", "-z"),
        help="axis of the file that points up; z when not given",
    )
    parser.add_argument("--depth-scale", type=float, help="of depth images: their units a metre")
    parser.add_argument("--wall-mm", type=float, help="for a mesh without thickness")
    parser.add_argument("--on-table", action="store_true", help="the mesh or cloud holds its table, too")
    parser.add_argument("--notes", help="anything to remember")


def call(options: argparse.Namespace) -> dict:
    """Return what was added."""
    project = Project(options.project)
    target = _target(project, options.name)
    _check_source(options.path)
    adding = project.raw / f".adding-{os.getpid()}"
    folder = adding / options.name
    try:
        _copy(options.path, folder)
        _describe(folder, options)
        found = _read(folder, options.path)
        folder.rename(target)
    finally:
        shutil.rmtree(adding, ignore_errors=True)
    return {"object": options.name, "folder": str(target), **found}


def _target(project: Project, name: str) -> Path:
    if not NAME.fullmatch(name) or name in RESERVED:
        raise PipelineError(
            f"--name {name}: expected small letters, digits and underscores, beginning with a letter or digit, and not "
            f"{' or '.join(RESERVED)}, found '{name}'; choose another, such as my_mug"
        )
    target = project.raw / name
    if target.exists() or name in project.config()["scan"]["objects"]:
        raise PipelineError(
            f"{target}: expected a new name, found an object of this name; choose another or remove that one first"
        )
    return target


def _check_source(path: Path) -> None:
    if path.is_dir() or (path.is_file() and path.suffix.lower() in SUFFIXES):
        return
    found = f"a file {path.suffix or 'without suffix'}" if path.is_file() else "nothing there"
    raise PipelineError(
        f"{path}: expected a file {' '.join(SUFFIXES)} or a folder with a scan, found {found}; correct the path"
    )


def _copy(path: Path, folder: Path) -> None:
    try:
        if path.is_dir():
            shutil.copytree(path, folder)
        else:
            folder.mkdir(parents=True)
            shutil.copy2(path, folder / path.name)
    except (OSError, shutil.Error) as error:
        raise PipelineError(
            f"{path}: expected to copy it to {folder.parent.parent}, found: {error}; correct that"
        ) from error


def _describe(folder: Path, options: argparse.Namespace) -> None:
    """Write scan.yaml, with what a folder's own says where no option says otherwise."""
    said = {key: getattr(options, key) for key in ("units", "up", "depth_scale", "wall_mm", "notes")}
    said |= {"on_table": True if options.on_table else None}
    said = {key: value for key, value in said.items() if value is not None}
    path = folder / "scan.yaml"
    if not said:
        return
    before = yaml.safe_load(path.read_text()) if path.is_file() else {}
    path.write_text(yaml.safe_dump({**(before or {}), **said}))


def _read(folder: Path, source: Path) -> dict:
    """Return what was found in the folder; errors name the user's own file and options instead of the copy."""
    import numpy as np

    from pipeline.fuse import dropped, layouts, recorded
    from pipeline.fuse.raw import DroppedMesh
    from pipeline.geometry.cavity import cavity

    try:
        found = layouts.read(folder)
        if not isinstance(found, DroppedMesh):
            read = {"layout": found.layout, "n_views": found.n_found}
            # Finding poses takes minutes; given ones are checked at once, and with them table and object.
            if not found.T_world_cameras:
                return {**read, "views_left_out": [], "views_without_object": [], "complaints": []}
            scan = recorded.located(found, str(folder), np.random.default_rng(0))
            facts = scan.facts()
            left_out = {key: facts[key] for key in ("views_left_out", "views_without_object")}
            return {**read, **left_out, "complaints": recorded.complaints(facts)}
        vertices_m, triangles, _, facts = dropped.read(found, np.random.default_rng(0))
        capacity_m3 = cavity(vertices_m, triangles, name=str(folder)).capacity_m3
    except PipelineError as error:
        raise PipelineError(_told(str(error), folder, source)) from error
    return {
        "layout": facts["layout"],
        "n_views": 0,
        "complaints": dropped.complaints(facts),
        "capacity_m3": float(capacity_m3),
        "height_m": float(np.ptp(vertices_m[:, 2])),
        "width_m": float(np.ptp(vertices_m[:, :2], axis=0).max()),
    }


def _told(message: str, folder: Path, source: Path) -> str:
    inner = source if source.is_dir() else source.parent
    message = re.sub(r"write `(\w+): (\S+)` into \S*scan\.yaml( beside it)?", r"give --\1 \2", message)
    message = re.sub(r"correct `(\w+)` in \S*scan\.yaml", r"correct --\1", message)
    message = re.sub(r"--(wall_mm|on_table|depth_scale)", lambda found: found[0].replace("_", "-"), message)
    message = message.replace("--on-table true", "--on-table")
    return message.replace(f"{folder}/", f"{inner}/").replace(str(folder), str(source))


def text(result: dict) -> str:
    """Return the result in words."""
    what = f"{result['n_views']} views" if result["n_views"] else f"a {result['layout']}"
    left_out = [*result.get("views_left_out", []), *result.get("views_without_object", [])]
    what += f", {len(left_out)} of them left out" if left_out else ""
    if "capacity_m3" in result:
        what += f", {result['height_m'] * 1e3:.0f} mm high, holds {result['capacity_m3'] * 1e6:.0f} ml"
    told = [f"{result['folder']}: {what}, layout {result['layout']}"]
    return "\n".join([*told, *result["complaints"], "next: snakemake -c2 reports/roc.pdf"])
