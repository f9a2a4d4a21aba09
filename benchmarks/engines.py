"""Why engines disagree: `python benchmarks/engines.py` runs the same pours by the liquid and by variants of Bullet's spheres.

Needs fused meshes. What the numbers mean is in docs/physics.md.
"""

import argparse
import json
import sys
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd

from pipeline import artefacts
from pipeline.geometry.cavity import lip_alone, pour_axis, retained_volume_m3
from pipeline.report.engines import NEAR, kappa
from pipeline.simulate import bullet, draws, engines, fluid, gel, liquid, prepared, trials

PROTOCOL = draws.Pouring(0.05, 1.0, float(np.radians(120.0)), 1)
FILLS = (0.3, 0.5, 0.7)  # of the capacity, for the tilt at which the first particle leaves
BEYOND_RAD = np.radians(50.0)


def _gel(friction: float, restitution: float = gel.RESTITUTION) -> Callable:
    return partial(gel.prepare, matter=replace(gel.GEL, friction=friction, restitution=restitution))


VARIANTS: dict[str, Callable] = {
    "gel, friction 0": _gel(0.0),
    "gel, friction 0.1": _gel(gel.FRICTION),
    "gel, friction 0.4": _gel(0.4),
    "gel, friction 0.1, no rebound": _gel(gel.FRICTION, 0.0),
    "fluid": fluid.prepare,
    "fluid, rim lowered by 0.45": partial(fluid.prepare, by=0.45),
}


def onset_deg(engine, vessel) -> float:
    """Return by how much the tilt at which the first particle leaves is beyond hydrostatics' own, mean over `FILLS`."""
    cup = vessel.cavity
    lip, axis = lip_alone(cup), pour_axis(cup.opening_m, lip_alone(cup))
    tilts = np.linspace(0.0, np.radians(120.0), 241)
    kept_m3, late = retained_volume_m3(cup, lip, axis, tilts), []
    for share in FILLS:
        n = engine.particles_for(vessel, share * cup.capacity_m3)
        theory = float(np.interp(-n * vessel.spacing_m**3, -kept_m3, tilts))
        pour = engine.pour(vessel, n, lip, axis, theory + BEYOND_RAD, 1)
        left = pour.retained < 1.0
        late.append(pour.tilts_rad[np.argmax(left)] - theory if left.any() else BEYOND_RAD)
    return float(np.degrees(np.mean(late)))


def pours(cup: prepared.Container, n: int, seed: int) -> pd.DataFrame:
    """Return the first n pouring trials of a container."""
    return pd.DataFrame([trials.pouring_trial(cup, PROTOCOL, number, seed) for number in range(n)])


def compared(truth: pd.DataFrame, rows: pd.DataFrame) -> dict[str, float]:
    """Return how a variant's labels and shares differ from the liquid's."""
    one, other, near = truth["poured"], rows["poured"], truth["hydrostatic_margin"].abs() <= NEAR
    differ = one != other
    kept = (rows["n_retained"] - truth["n_retained"]) / truth["n_particles"]
    return {
        "trials": len(rows),
        "kappa": kappa(one, other),
        "differ": int(differ.sum()),
        "liquid_alone": int((one & ~other).sum()),
        "near": int((differ & near).sum()),
        "kept_more_share": float(kept[truth["poured"]].mean()),
        "leaked": int(rows["n_leaked"].sum()),
    }


def measure(
    meshes: Path, names: list[str], n: int, spacing_m: float, seed: int
) -> dict[str, dict[str, float]]:
    """Return the numbers of each variant, over all named objects."""
    scans = {name: artefacts.read_mesh(meshes / name / "mesh.ply") for name in names}
    cups = {name: prepared.container(name, *scan, spacing_m) for name, scan in scans.items()}
    truth = pd.concat([pours(cup, n, seed) for cup in cups.values()], ignore_index=True)
    late = float(np.mean([onset_deg(liquid, cup.vessel) for cup in cups.values()]))
    found: dict[str, dict[str, float]] = {"liquid": {"onset_deg": late}}
    for variant, prepare in VARIANTS.items():
        own = replace(engines.ENGINES["bullet"], name=variant, prepare=prepare)
        pots = [prepared.container(name, *scans[name], spacing_m, own) for name in names]
        rows = pd.concat([pours(cup, n, seed) for cup in pots], ignore_index=True)
        late = float(np.mean([onset_deg(bullet, cup.vessel) for cup in pots]))
        found[variant] = {**compared(truth, rows), "onset_deg": late}
        sys.stderr.write(f"{variant}: {json.dumps(found[variant])}\n")
    return found


def main() -> None:
    """Measure, and write what was found to standard output."""
    parser = argparse.ArgumentParser(description=__doc__, allow_abbrev=False)
    parser.add_argument("--meshes", type=Path, default=Path("data/processed/fuse"), help="fused meshes")
    parser.add_argument("--objects", nargs="+", default=["small_cup", "short_cup", "tumbler"])
    parser.add_argument("--pours", type=int, default=30, help="of each object")
    parser.add_argument("--spacing-m", type=float, default=0.010)
    parser.add_argument("--seed", type=int, default=4)
    options = parser.parse_args()
    found = measure(options.meshes, options.objects, options.pours, options.spacing_m, options.seed)
    sys.stdout.write(json.dumps(found, indent=2) + "\n")


if __name__ == "__main__":
    main()
