"""Compile what many jobs of a stage run, once before the first of them: two at the same time would each do it.

Numba caches the machine code beside the package. A job that does not find it there compiles it by itself.
"""

import argparse
from collections.abc import Callable
from pathlib import Path
from typing import Any

from pipeline.artefacts import write_json
from pipeline.command import parser, progress, run, steps

COARSE_M = 0.03  # a spacing at which a vessel holds a few particles


def main() -> None:
    """Compile a stage's functions; write their names."""
    options = _options()
    write_json(options.compiled, {"functions": sorted(STAGES[options.stage]())})


def _options() -> argparse.Namespace:
    options = parser(__doc__)
    options.add_argument("stage", choices=STAGES, help="whose functions")
    options.add_argument("--compiled", type=Path, required=True, help="where their names are written (JSON)")
    return options.parse_args()


def fuse() -> list[str]:
    """Compile what fusion computes voxel by voxel and vertex by vertex; return the functions' names."""
    from numba.core.sigutils import normalize_signature

    types = fuse_types()
    for function, arguments in progress(types.items(), len(types), "compiling fuse"):
        # Types, not their text: Numba's cache takes them for different keys.
        function.compile(normalize_signature(arguments)[0])
    return names(*types)


def simulate() -> list[str]:
    """Compile the liquid by a pour of one particle and one of it into a second vessel; return the functions' names."""
    import numpy as np

    from pipeline.geometry.cavity import lip_alone, pour_axis
    from pipeline.simulate import filling, pouring, rest
    from pipeline.simulate.fields import precompute
    from pipeline.simulate.references import references

    cylinder = references()[0].cavity()
    vessel = precompute(cylinder, COARSE_M, 0.5)
    lip, T_world_held, T_world_second = lip_alone(cylinder), np.eye(4), np.eye(4)
    T_world_held[2, 3] = 1.0
    axis = pour_axis(cylinder.opening_m, lip)
    with steps("compiling simulate", 2) as tell:
        tell("a pour")
        pouring.pour(vessel, 1, lip, axis, 0.1, 0)
        tell("a filling")
        filling.fill(vessel, vessel, T_world_held, T_world_second, lip, axis, 0.1, 1, 1, 0)
    return names(rest.rest, pouring._pour, filling._fill)


STAGES: dict[str, Callable[[], list[str]]] = {"fuse": fuse, "simulate": simulate}


def fuse_types() -> dict[Any, str]:
    """Return the functions that fusion calls and the types that it calls them with, as numba writes them."""
    from pipeline.fuse import bends, measuring, planes, smoothing
    from pipeline.geometry import sampling

    points, rows, views = "f8[:,::1]", "i8[:,::1]", "f4[:,::1], i8[:,::1], f8[:,:,::1]"
    return {
        planes.inverse_depths: "(f4[:,::1],)",
        planes._fit_all: f"({points}, {points}, {points}, {points}, f4[:,::1])",
        measuring.signed_distances: f"(i8[::1], f8, {rows}, b1[::1], b1[:,:,::1], {views}, f8)",
        measuring.offsets: f"({points}, {points}, {views}, f8)",
        measuring.outlines: f"({points}, {points}, b1[::1], {views}, {points})",
        smoothing._around: f"({rows}, {points}, i8)",
        smoothing._of_corners: f"({rows}, {points})",
        smoothing._alike: f"(i4[::1], i4[::1], {points}, f8)",
        smoothing.smoothed: f"({points}, i4[::1], i4[::1], {points}, i8, UniTuple(f8, 2))",
        bends._faced: f"({points}, {rows}, {points}, {points}, {points}, {points}, f8[::1], i4[::1], i4[::1])",
        sampling._crossed: f"({points}, {rows})",
        sampling._weights: f"({points}, {points}, {rows}, f8)",
        sampling._eliminate: "(i8[::1], i8[::1], f8[::1], i8)",
    }


def names(*functions: Any) -> list[str]:
    """Return the names of compiled functions, with their modules."""
    return [f"{function.py_func.__module__}.{function.py_func.__name__}" for function in functions]


if __name__ == "__main__":
    run(main)
