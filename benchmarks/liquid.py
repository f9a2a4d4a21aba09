"""How fast and how true the liquid is: `python benchmarks/liquid.py --json`; what the numbers mean is in docs/performance.md.

The pour: a cup of inner radius 37 mm, inner depth 97 mm and wall 3 mm is tilted by 100° about its lip in 1.0 s and held for
0.3 s. Ratios are of medians of rounds that take turns in one process; times alone say more of the machine than of the engine.
"""

import argparse
import json
import multiprocessing
import sys
import time
from collections.abc import Callable

import card
import numpy as np
import pybullet
import splishsplash
import trimesh

from pipeline import command
from pipeline.geometry.cavity import Cavity, cavity, lip_alone, pour_axis
from pipeline.geometry.frames import rotation_about, tilted
from pipeline.simulate import batches, liquid
from pipeline.simulate.fields import precompute
from pipeline.simulate.pouring import HOLD_S
from pipeline.simulate.rest import STEP_PER_SPACING

RADIUS_M, DEPTH_M, WALL_M = 0.037, 0.097, 0.003
TILT_RAD, TILT_S, SETTLE_S, WAIT_S = np.radians(100.0), 1.0, 0.3, 0.3
SPACING_M = {155: 0.010, 310: 0.008}
# Share kept at so many degrees, the pour above: SPlisHSPlasH, DFSPH, 1240 particles of 5 mm.
REFERENCE = {60: 0.994, 65: 0.936, 70: 0.826, 75: 0.683, 80: 0.527, 90: 0.236, 100: 0.038}
BULLET_HZ = 240
TABLE = ((0.010, 155), (0.008, 310), (0.0063, 620), (0.005, 1240), (0.004, 2450), (0.0032, 5000))
SEEDS = 3
# Pours for each of Bullet's, so that a turn is as long: one alone would be timed with the caches that Bullet leaves behind.
AT_A_TURN = 100
CARD_TRIALS = 16384  # of each kind


def cup_mesh() -> tuple[np.ndarray, np.ndarray]:
    """Return the cup's vertices (V, 3), object frame, metres, and triangles (F, 3)."""
    outer, top = RADIUS_M + WALL_M, DEPTH_M + WALL_M
    profile = [(0.0, 0.0), (outer, 0.0), (outer, top), (RADIUS_M, top), (RADIUS_M, WALL_M), (0.0, WALL_M)]
    mesh = trimesh.creation.revolve(np.array(profile), sections=96)
    return np.asarray(mesh.vertices), np.asarray(mesh.faces)


def cup() -> Cavity:
    """Return the cup's cavity."""
    return cavity(*cup_mesh(), name="benchmark cup")


def pour(vessel: liquid.Vessel, n: int, tilt_rad: float, seed: int) -> liquid.Pour:
    """Pour n particles, the whole wait, whatever still flows."""
    lip = lip_alone(vessel.cavity)
    axis = pour_axis(vessel.cavity.opening_m, lip)
    return liquid.pour(vessel, n, lip, axis, tilt_rad, seed, wait_s=WAIT_S, patient=True)


def filling(vessel: liquid.Vessel, seed: int) -> batches.Call:
    """Ask for ten particles poured into a second such cup, half full, the lip 20 mm before its centre and 40 mm above it."""
    lip = lip_alone(vessel.cavity)
    T_world_held, T_world_second = np.eye(4), np.eye(4)
    T_world_held[:3, 3] = vessel.cavity.opening_m + [-0.02, 0.0, 0.04] - lip
    axis = pour_axis(vessel.cavity.opening_m, lip)
    return vessel, vessel, T_world_held, T_world_second, lip, axis, np.radians(120.0), 10, 200, seed


def bullet_pour(n: int, tilt_rad: float) -> int:
    """Pour n rigid frictionless spheres out of the concave cup in Bullet; return how many are left in it at the end."""
    client = pybullet.connect(pybullet.DIRECT)
    try:
        body = _bullet_cup(client)
        spheres = _bullet_spheres(client, n)
        lip, axis = np.array([RADIUS_M, 0.0, DEPTH_M + WALL_M]), np.array([0.0, 1.0, 0.0])
        for k in range(int((SETTLE_S + TILT_S + WAIT_S) * BULLET_HZ)):
            u = np.clip((k / BULLET_HZ - SETTLE_S) / TILT_S, 0.0, 1.0)
            tilt = tilt_rad * u * u * (3.0 - 2.0 * u)
            T = tilted(np.eye(4), lip, axis, tilt)
            turn = [0.0, float(np.sin(tilt / 2)), 0.0, float(np.cos(tilt / 2))]
            pybullet.resetBasePositionAndOrientation(body, T[:3, 3].tolist(), turn, physicsClientId=client)
            pybullet.stepSimulation(physicsClientId=client)
        at = [pybullet.getBasePositionAndOrientation(s, physicsClientId=client)[0] for s in spheres]
        inside = (np.array(at) - T[:3, 3]) @ rotation_about(axis, tilt_rad)
        return int((inside[:, 2] < DEPTH_M + WALL_M).sum())
    finally:
        pybullet.disconnect(client)


def _bullet_cup(client: int) -> int:
    vertices, triangles = cup_mesh()
    shape = pybullet.createCollisionShape(
        pybullet.GEOM_MESH,
        vertices=vertices.tolist(),
        indices=triangles.ravel().tolist(),
        flags=pybullet.GEOM_FORCE_CONCAVE_TRIMESH,
        physicsClientId=client,
    )
    body = pybullet.createMultiBody(0.0, shape, physicsClientId=client)
    pybullet.changeDynamics(body, -1, lateralFriction=0.0, physicsClientId=client)
    pybullet.setGravity(0.0, 0.0, -9.81, physicsClientId=client)
    pybullet.setTimeStep(1.0 / BULLET_HZ, physicsClientId=client)
    return body


def _bullet_spheres(client: int, n: int) -> list[int]:
    spacing = SPACING_M[155]
    shape = pybullet.createCollisionShape(pybullet.GEOM_SPHERE, radius=spacing / 2, physicsClientId=client)
    steps = np.arange(-3, 4) * spacing
    grid = np.stack(np.meshgrid(np.arange(30) * spacing, steps, steps, indexing="ij"), -1).reshape(-1, 3)
    grid = grid[np.hypot(grid[:, 1], grid[:, 2]) < RADIUS_M - spacing / 2][:n]
    spheres = []
    for z, x, y in grid.tolist():
        at = [x, y, z + WALL_M + spacing / 2]
        spheres.append(pybullet.createMultiBody(1e-3, shape, basePosition=at, physicsClientId=client))
        pybullet.changeDynamics(spheres[-1], -1, lateralFriction=0.0, physicsClientId=client)
    return spheres


def milliseconds(*calls: Callable[[], object], rounds: int) -> list[float]:
    """Return the median time of each call; the calls take turns, the first round is not counted."""
    times = np.zeros((rounds, len(calls)))
    for k in range(-1, rounds):
        for c, call in enumerate(calls):
            start = time.perf_counter()
            call()
            if k >= 0:
                times[k, c] = time.perf_counter() - start
    return (1e3 * np.median(times, axis=0)).tolist()


def rmse(vessel: liquid.Vessel, n: int) -> float:
    """Return the root mean square difference of the share kept to the reference curve, seeds averaged."""
    kept = [
        np.mean([pour(vessel, n, np.radians(t), seed).n_retained / n for seed in range(1, SEEDS + 1)])
        for t in REFERENCE
    ]
    return float(np.sqrt(np.mean((np.array(kept) - list(REFERENCE.values())) ** 2)))


def throughput(processes: int, seconds: float) -> float:
    """Return the trials per second of some processes, each with its own vessel, `seconds` long after a common start."""
    context = multiprocessing.get_context("spawn")
    barrier, results = context.Barrier(processes), context.Queue()
    work = (barrier, results, seconds)
    workers = [context.Process(target=_pour_for_a_while, args=work) for _ in range(processes)]
    for worker in workers:
        worker.start()
    rates = [results.get() for _ in workers]
    for worker in workers:
        worker.join()
    return float(sum(rates))


def _pour_for_a_while(barrier, results, seconds: float) -> None:
    vessel = liquid.vessel(cup(), SPACING_M[155])
    pour(vessel, 155, TILT_RAD, 0)
    barrier.wait()
    start, count = time.perf_counter(), 0
    while time.perf_counter() - start < seconds:
        pour(vessel, 155, TILT_RAD, count)
        count += 1
    results.put(count / (time.perf_counter() - start))


def by_size(inside: Cavity, rounds: int, most: int) -> list[dict[str, float]]:
    """Return what a pour costs by its number of particles, up to `most`: the volume stays, the spacing falls."""
    rows = []
    for spacing_m, n in (row for row in TABLE if row[1] <= most):
        vessel = precompute(inside, spacing_m, 0.75)
        (ms,) = milliseconds(lambda v=vessel, n=n: pour(v, n, TILT_RAD, 1), rounds=rounds)
        steps = (HOLD_S + TILT_S + WAIT_S) / (STEP_PER_SPACING * spacing_m)
        rows.append(
            {
                "particles": n,
                "spacing_mm": 1e3 * spacing_m,
                "ms": ms,
                "us_per_step_particle": 1e3 * ms / steps / n,
            }
        )
    return rows


def measure(rounds: int, seconds: float, most: int) -> dict[str, object]:
    """Return every number: `rounds` of each comparison, throughput over `seconds`, up to `most` particles."""
    inside = cup()
    vessels = {n: liquid.vessel(inside, spacing_m) for n, spacing_m in SPACING_M.items()}
    ours, finer, pair = milliseconds(
        lambda: pour(vessels[155], 155, TILT_RAD, 1),
        lambda: pour(vessels[310], 310, TILT_RAD, 1),
        lambda: liquid.fill(*filling(vessels[155], 1)),
        rounds=5 * rounds,
    )
    many, bullet = milliseconds(
        lambda: [pour(vessels[155], 155, TILT_RAD, seed) for seed in range(AT_A_TURN)],
        lambda: bullet_pour(155, TILT_RAD),
        rounds=rounds,
    )
    one, two = throughput(1, seconds), throughput(2, seconds)
    return {
        "ms_per_trial_155": ours,
        "ms_per_trial_310": finer,
        "ms_per_trial_filling": pair,
        "ms_bullet_155": bullet,
        "ratio_bullet_155": bullet * AT_A_TURN / many,
        **splishsplash.compare(
            lambda: milliseconds(lambda: pour(vessels[155], 155, TILT_RAD, 1), rounds=1)[0],
            splishsplash.Pour(RADIUS_M, DEPTH_M, SPACING_M[155], 155, TILT_RAD, SETTLE_S, TILT_S, WAIT_S),
            REFERENCE,
            rounds,
        ),
        "rmse_155": rmse(vessels[155], 155),
        "rmse_310": rmse(vessels[310], 310),
        "trials_per_s_one_core": one,
        "trials_per_s_two_cores": two,
        "ratio_two_cores": two / one,
        "by_size": by_size(inside, rounds, most),
    }


def on_a_card() -> dict[str, float]:
    """Return what a card does beside one core: pours of 155 particles by tilts from 0 to 120°, and fillings."""
    vessel = liquid.vessel(cup(), SPACING_M[155])
    tilts = np.random.default_rng(1).uniform(0.0, np.radians(120.0), CARD_TRIALS)
    lip = lip_alone(vessel.cavity)
    axis = pour_axis(vessel.cavity.opening_m, lip)
    pours = [(vessel, 155, lip, axis, tilt_rad, seed) for seed, tilt_rad in enumerate(tilts)]
    return card.measure(pours, [filling(vessel, seed) for seed in range(CARD_TRIALS)])


def main() -> None:
    """Measure, and write what was found to standard output."""
    parser = argparse.ArgumentParser(description=__doc__, allow_abbrev=False)
    parser.add_argument("--json", action="store_true", help="write JSON instead of lines")
    parser.add_argument(
        "--device", choices=("cpu", "cuda"), default="cpu", help="cuda: a card beside one core"
    )
    parser.add_argument("--rounds", type=int, default=5, help="rounds of each comparison")
    parser.add_argument("--seconds", type=float, default=6.0, help="of each measurement of throughput")
    parser.add_argument("--most-particles", type=int, default=5000, help="of the table by size")
    options = parser.parse_args()
    extent = options.rounds, options.seconds, options.most_particles
    found = measure(*extent) if options.device == "cpu" else on_a_card()
    lines = json.dumps(found, indent=2) if options.json else "\n".join(f"{k}: {v}" for k, v in found.items())
    sys.stdout.write(lines + "\n")


if __name__ == "__main__":
    command.run(main)
