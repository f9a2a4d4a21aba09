"""How true and how fast Bullet's spheres are: `python benchmarks/bullet.py`; what the numbers mean is in docs/physics.md.

The pour is that of benchmarks/liquid.py, half full, by the liquid, the gel balls and Bullet's fluid: the share kept at seven
tilts against the reference curve, and milliseconds of CPU a trial.
"""

import argparse
import json
import sys
import time

import numpy as np
from liquid import DEPTH_M, RADIUS_M, REFERENCE, SPACING_M, WAIT_S, cup, cup_mesh

from pipeline.geometry.cavity import Cavity, lip_alone, pour_axis
from pipeline.simulate import bullet, fluid, forces, gel, liquid, packing, spheres

N = 155
WALL_M = 0.003


def kept(engine, vessel, seeds: int) -> tuple[list[float], int, float]:
    """Return the mean share kept at the reference's tilts, the spheres that leaked, and milliseconds a pour."""
    lip = lip_alone(vessel.cavity)
    axis = pour_axis(vessel.cavity.opening_m, lip)
    engine.pour(vessel, N, lip, axis, 0.0, 1, wait_s=0.0)
    start = time.process_time()
    pours = [
        [
            engine.pour(vessel, N, lip, axis, np.radians(tilt), seed, wait_s=WAIT_S, patient=True)
            for seed in range(1, seeds + 1)
        ]
        for tilt in REFERENCE
    ]
    ms = 1e3 * (time.process_time() - start) / (seeds * len(REFERENCE))
    shares = [float(np.mean([pour.n_retained / N for pour in each])) for each in pours]
    return shares, sum(pour.n_leaked for each in pours for pour in each), ms


def at_rest(pot: spheres.Pot, seconds: float = 1.0) -> dict[str, float]:
    """Return density and level of the fluid at rest, undamped for a while."""
    with spheres.World(pot) as world:
        world.add(packing.settle(pot, N, (1, 0))[0])
        packing.stand(world, pot, seconds)
        x, v = world.state()
        density = forces.response(pot.walls, x, v).density
        top = np.sort(x[:, 2])[-round(0.6 * np.pi * RADIUS_M**2 / pot.spacing_m**2) :].mean()
        expected_m = N * pot.spacing_m**3 / (np.pi * RADIUS_M**2)
        return {
            "kept": len(world) / N,
            "density_mean": float(density.mean()),
            "density_max": float(density.max()),
            "density_error": world.density_error,
            "level_error_mm": 1e3 * float(top + 0.5 * pot.spacing_m - WALL_M - expected_m),
            "rms_speed_mm_s": 1e3 * float(np.sqrt((v**2).sum(axis=1).mean())),
        }


def measure(seeds: int) -> dict[str, object]:
    """Return every number."""
    inside: Cavity = cup()
    spacing_m = SPACING_M[N]
    vessels = {
        "liquid": (liquid, liquid.vessel(inside, spacing_m)),
        "bullet": (bullet, gel.prepare(inside, *cup_mesh(), spacing_m)),
        "bullet_fluid": (bullet, fluid.prepare(inside, *cup_mesh(), spacing_m)),
    }
    found: dict[str, object] = {"depth_mm": 1e3 * DEPTH_M, "reference": list(REFERENCE.values())}
    for name, (engine, vessel) in vessels.items():
        shares, leaked, ms = kept(engine, vessel, seeds)
        error = np.array(shares) - list(REFERENCE.values())
        found[name] = {
            "kept": np.round(shares, 3).tolist(),
            "rmse": float(np.sqrt((error**2).mean())),
            "bias": float(error.mean()),
            "leaked": leaked,
            "ms_per_pour": ms,
        }
    found["at_rest"] = at_rest(vessels["bullet_fluid"][1])
    return found


def main() -> None:
    """Measure, and write what was found to standard output."""
    parser = argparse.ArgumentParser(description=__doc__, allow_abbrev=False)
    parser.add_argument("--seeds", type=int, default=1, help="pours at each tilt")
    found = measure(parser.parse_args().seeds)
    sys.stdout.write(json.dumps(found, indent=2) + "\n")


if __name__ == "__main__":
    main()
