"""What scans from one side are like: `python benchmarks/arcs.py`; the table is in docs/fusion.md.

Each demonstration object in the views of 48 that are within an arc around its handle's side, and around the other side: the error
of its capacity as fused, and, in brackets, with what was not seen left solid.
"""

import argparse
import sys
from pathlib import Path

import numpy as np

from pipeline.errors import PipelineError
from pipeline.fuse import tsdf
from pipeline.fuse.completion import completed
from pipeline.fuse.placement import find
from pipeline.geometry.cavity import cavity
from pipeline.scan.shapes import NAMES, shape

ARCS_DEG, TOWARDS_DEG = (90, 120, 180), (0, 180)
VOXEL_M, TRUNCATION_M, SEED = 0.00125, 0.0025, 2


def error(name: str, towards_deg: float, arc_deg: float) -> str:
    """Return the error of the capacity, in brackets without completion, in words."""
    from fuse import scenes

    views = scenes.of_one_side(name, towards_deg, arc_deg)
    _, place = find(views, name, np.random.default_rng(SEED))
    found = []
    for way in (completed, lambda value, *_: value):
        tsdf.completed = way
        try:
            surface = tsdf.fuse(views, place, VOXEL_M, TRUNCATION_M, name)
            room = cavity(surface.vertices_m, surface.triangles, name=name)
            found.append(f"{100 * (room.capacity_m3 / shape(name).capacity_m3 - 1):+.1f}")
        except PipelineError:
            found.append("none")
    return f"{found[0]} ({found[1]})"


def main() -> None:
    """Measure and write the table."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--objects", nargs="*", default=list(NAMES))
    names = options.parse_args().objects
    sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
    cases = [(arc, towards) for arc in ARCS_DEG for towards in TOWARDS_DEG]
    heads = [f"{arc}°, {'other' if towards else 'handle'}'s side" for arc, towards in cases]
    sys.stdout.write(f"| capacity, % | {' | '.join(heads)} |\n{'|---' * (len(heads) + 1)}|\n")
    for name in names:
        cells = [error(name, towards, arc) for arc, towards in cases]
        sys.stdout.write(f"| {name.replace('_', ' ')} | {' | '.join(cells)} |\n")
        sys.stdout.flush()


if __name__ == "__main__":
    main()
