"""Read an object from the pipeline's files and describe it for the browser."""

from dataclasses import fields
from pathlib import Path
from typing import Any

import pandas as pd

from pipeline.artefacts import Mesh, points, read_arrays, read_mesh, read_table
from pipeline.errors import PipelineError
from pipeline.geometry.cavity import Cavity, cavity
from pipeline.scene.room import room
from pipeline.scene.shape import surface

PARTS = ["container", "rim", "handle"]


def described(name: str, processed: Path, source: str) -> dict[str, Any]:
    """Return an object as viewer.js takes it: surface with its final labels, rim, opening, lip and room for liquid.

    The labels are those of the label mapping, or as long as there are none the initial ones; an object that holds no
    liquid has no room.
    """
    mesh = read_mesh(processed / f"fuse/{name}/mesh.ply")
    labels = labelled(name, processed, source)
    described = {"name": name, "title": name.replace("_", " ")}
    described |= surface(mesh, points(labels), labels[PARTS].to_numpy(bool))
    try:
        return described | room(_cavity(name, processed, mesh))
    except PipelineError:
        return described


def labelled(name: str, processed: Path, source: str) -> pd.DataFrame:
    """Return points and their parts, as good as there are any."""
    final = processed / f"warp/{source}/{name}/label_mapping.parquet"
    initial = processed / f"label/{name}/labels.parquet"
    if final.is_file():
        return read_table(final, "mapping")
    if initial.is_file():
        return read_table(initial, "labels")
    cloud = read_table(processed / f"fuse/{name}/cloud.parquet", "cloud")
    return cloud.assign(**dict.fromkeys(PARTS, False))


def _cavity(name: str, processed: Path, mesh: Mesh) -> Cavity:
    """Return the cavity that the trials use, or find it when no trial was made yet."""
    path = processed / f"simulate/containers/{name}.npz"
    if not path.is_file():
        return cavity(*mesh, name=name)
    found = read_arrays(path)
    arrays = {part.name: found[f"cavity_{part.name}"] for part in fields(Cavity)}
    values: Any = {key: value if value.ndim else value.item() for key, value in arrays.items()}
    return Cavity(**values)
