"""Does what falls in splash over? `python benchmarks/splash.py` empties a tall cup that holds 10 ml into a nearly full mug.

At several spacings of particles, with the same volumes. Needs fused meshes. What the numbers mean is in docs/performance.md.
"""

import argparse
import json
import sys
from pathlib import Path

import numpy as np

from pipeline import artefacts
from pipeline.geometry import cavity, frames
from pipeline.simulate.filling import fill
from pipeline.simulate.rest import particles_for
from pipeline.simulate.walls import Vessel, vessel

SPACINGS_M = (0.010, 0.007, 0.005)
ARRIVING_M3, ROOMS_M3 = 10e-6, (5e-6, 10e-6, 20e-6)
LIP_M = np.array([-0.035, 0.0, 0.020])  # from the middle of the mug's opening; the cup pours along x
TILT_RAD = np.radians(150.0)


def spilled_m3(held: Vessel, second: Vessel, room_m3: float, seed: int) -> float:
    """Return the volume that is beside the second vessel at the end, of `ARRIVING_M3` into so much free room."""
    cup, bowl = held.cavity, second.cavity
    far_m = bowl.opening_m - cup.opening_m - [1.0, 0.0, 0.0]
    lip_m = cavity.lip_towards(cup, frames.transform(np.eye(3), far_m), bowl.opening_m)
    T_world_held = frames.transform(np.eye(3), bowl.opening_m + LIP_M - lip_m)
    n_held = particles_for(held, ARRIVING_M3)
    n_second = particles_for(second, bowl.capacity_m3 - room_m3)
    axis = cavity.pour_axis(cup.opening_m, lip_m)
    end = fill(held, second, T_world_held, np.eye(4), lip_m, axis, TILT_RAD, n_held, n_second, seed)
    return end.n_spilled * second.spacing_m**3


def measure(meshes: Path, seeds: int) -> list[dict[str, float]]:
    """Return a row for each spacing and free room: the mean volume spilled, and the least and the most of the seeds."""
    names, rows = ("tall_cup", "mug"), []
    rooms = [cavity.cavity(*artefacts.read_mesh(meshes / name / "mesh.ply"), name=name) for name in names]
    for spacing_m in SPACINGS_M:
        held, second = (vessel(room, spacing_m) for room in rooms)
        for room_m3 in ROOMS_M3:
            spilled_ml = [1e6 * spilled_m3(held, second, room_m3, seed) for seed in range(seeds)]
            row = {"spacing_mm": 1e3 * spacing_m, "room_ml": 1e6 * room_m3, "spilled_ml": np.mean(spilled_ml)}
            rows.append({**row, "least_ml": min(spilled_ml), "most_ml": max(spilled_ml)})
            sys.stderr.write(f"{json.dumps(rows[-1])}\n")
    return rows


def main() -> None:
    """Measure, and write what was found to standard output."""
    parser = argparse.ArgumentParser(description=__doc__, allow_abbrev=False)
    parser.add_argument("--meshes", type=Path, default=Path("data/processed/fuse"), help="fused meshes")
    parser.add_argument("--seeds", type=int, default=8, help="of each row")
    options = parser.parse_args()
    sys.stdout.write(json.dumps(measure(options.meshes, options.seeds), indent=2) + "\n")


if __name__ == "__main__":
    main()
