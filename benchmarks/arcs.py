"""What scans from one side are like: `python benchmarks/arcs.py`; the tables are in docs/fusion.md.

Each demonstration object in the views of 48 that are within an arc around its handle's side, and around the other side: the errors
of its capacity and of its solid's volume as fused, and, in brackets, with what was not seen left solid.
"""

import argparse
import sys
from pathlib import Path

import numpy as np
import trimesh

from pipeline.errors import PipelineError
from pipeline.fuse import tsdf
from pipeline.fuse.completion import completed
from pipeline.fuse.placement import find
from pipeline.geometry.cavity import cavity
from pipeline.scan.shapes import NAMES, shape

ARCS_DEG, TOWARDS_DEG = (90, 120, 180), (180, 0)
VOXEL_M, TRUNCATION_M, SEED = 0.00125, 0.0025, 2


def errors(name: str, towards_deg: float, arc_deg: float) -> tuple[str, str]:
    """Return the errors of the capacity and of the solid's volume, in brackets without completion, in words."""
    from fuse import scenes

    views = scenes.of_one_side(name, towards_deg, arc_deg)
    _, place = find(views, name, np.random.default_rng(SEED))
    truth = shape(name)
    true_m3 = trimesh.Trimesh(truth.vertices_m, truth.triangles, process=False).volume
    capacity, solid = [], []
    for way in (completed, lambda *_: None):
        tsdf.completed = way
        surface = tsdf.fuse(views, place, VOXEL_M, TRUNCATION_M, name)
        solid_m3 = trimesh.Trimesh(surface.vertices_m, surface.triangles, process=False).volume
        solid.append(f"{100 * (solid_m3 / true_m3 - 1):+.0f}")
        try:
            room = cavity(surface.vertices_m, surface.triangles, name=name)
            capacity.append(f"{100 * (room.capacity_m3 / truth.capacity_m3 - 1):+.1f}")
        except PipelineError:
            capacity.append("none")
    return f"{capacity[0]} ({capacity[1]})", f"{solid[0]} ({solid[1]})"


def main() -> None:
    """Measure and write the tables."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--objects", nargs="*", default=list(NAMES))
    names = options.parse_args().objects
    sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
    cases = [(arc, towards) for arc in ARCS_DEG for towards in TOWARDS_DEG]
    found = {name: [errors(name, towards, arc) for arc, towards in cases] for name in names}
    heads = [f"{arc}°, {'handle' if towards else 'other'}'s side" for arc, towards in cases]
    for which, what in enumerate(("capacity", "solid")):
        sys.stdout.write(f"\n| {what}, % | {' | '.join(heads)} |\n{'|---' * (len(heads) + 1)}|\n")
        for name, cells in found.items():
            words = " | ".join(cell[which] for cell in cells)
            sys.stdout.write(f"| {name.replace('_', ' ')} | {words} |\n")


if __name__ == "__main__":
    main()
