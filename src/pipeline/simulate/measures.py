"""The liquid measured in one vessel: each function is one check, its rows are what was measured and what hydrostatics says.

A row has the check's name, the vessel's, the spacing, the number of particles, `x` (said at each check) and both values.
"""

from typing import Any

import numpy as np

from pipeline.geometry.cavity import Cavity, lip_alone, pour_axis, retained_volume_m3, room_m3
from pipeline.geometry.frames import rotation_about
from pipeline.simulate import liquid
from pipeline.simulate.fields import precompute
from pipeline.simulate.kernels import density_error
from pipeline.simulate.liquid import Vessel
from pipeline.simulate.particles import Particles, particles
from pipeline.simulate.references import Reference
from pipeline.simulate.rest import ITERATIONS, rest, time_step_s
from pipeline.simulate.walls import LOWERED

Row = dict[str, Any]

ONE_PARTICLE_M3 = 1e-6  # what counts as poured at any spacing: one particle of 10 mm
STILL_S = 0.5  # of rest, undamped, before something is measured
PUSH_M_S = 0.3
CALM_S = 5.0
_CALM_STEP_S = 0.1
SPILL_S = 15.0  # slow enough that only gravity matters: 8°/s at most
SPILL_BEYOND_RAD = np.radians(25.0)
RETAINED_S = 30.0
RETAINED_MAX_RAD = np.radians(120.0)
_SHARE_OF_TOP_LAYER = 0.6  # the rest of the surface's particles touch the wall


def row(
    check: str, name: str, vessel: Vessel, n: int, x: float, measured: float, expected: float = np.nan
) -> Row:
    """Return a row of the table "physics"."""
    return {
        **{"check": check, "vessel": name, "spacing_m": vessel.spacing_m, "n_particles": n},
        **{"x": float(x), "measured": float(measured), "expected": float(expected)},
    }


def at_rest(reference: Reference, vessel: Vessel, n: int, seed: int) -> list[Row]:
    """Return the mean |density − 1| and the free surface's height above the floor (m) of n particles at rest; x: n."""
    p = _filled(vessel, n, seed)
    _advance(p, vessel, STILL_S)
    kept = int(p.count[0])
    total, count = density_error(p, vessel.walls)
    level = float(reference.level_m(kept * vessel.spacing_m**3))
    layer = int(_SHARE_OF_TOP_LAYER * np.pi * float(reference.radius_m(level)) ** 2 / vessel.spacing_m**2)
    top_m = np.sort(p.x[:kept, 2])[-max(layer, 1) :].mean() + 0.5 * vessel.spacing_m - reference.wall_m
    rows = [row("level", reference.name, vessel, kept, n, top_m, level)]
    if count:
        rows.append(row("density", reference.name, vessel, kept, n, total / count, 0.0))
    return rows


def calming(name: str, vessel: Vessel, n: int, seed: int) -> list[Row]:
    """Return the root mean square speed (m/s) after a push sideways, undamped but for viscosity; x: time in s."""
    p = _filled(vessel, n, seed)
    _advance(p, vessel, STILL_S)
    p.v[: p.count[0], 0] += PUSH_M_S
    rows = []
    for time_s in np.arange(0.0, CALM_S + 1e-9, _CALM_STEP_S):
        speed = np.sqrt((p.v[: p.count[0]].astype(float) ** 2).sum(axis=1).mean())
        rows.append(row("speed", name, vessel, int(p.count[0]), time_s, speed))
        _advance(p, vessel, _CALM_STEP_S)
    return rows


def _filled(vessel: Vessel, n: int, seed: int) -> Particles:
    start = liquid.settle(vessel, n, seed)
    p = particles(n, vessel.walls)
    p.x[: len(start), :3], p.count[0] = start, len(start)
    return p


def _advance(p: Particles, vessel: Vessel, seconds: float) -> None:
    dt = time_step_s(vessel)
    rest(p, vessel.walls, dt, ITERATIONS, round(seconds / dt), 0.0)


def overflow(name: str, vessel: Vessel) -> list[Row]:
    """Return what a brimful vessel holds, and the cavity's capacity (m³); x: the rim, lowered by so many spacings.

    "capacity": with the rim where the calibration puts it; "capacity_uncalibrated": lowered by the nominal `LOWERED`.
    """
    uncalibrated = precompute(vessel.cavity, vessel.spacing_m, LOWERED)
    return [
        _held(check, name, each)
        for check, each in (("capacity", vessel), ("capacity_uncalibrated", uncalibrated))
    ]


def _held(check: str, name: str, vessel: Vessel) -> Row:
    held = liquid.keeps(vessel)
    capacity_m3 = vessel.cavity.capacity_m3
    return row(check, name, vessel, round(held), vessel.lowered, held * vessel.spacing_m**3, capacity_m3)


def spill_angle(name: str, vessel: Vessel, share: float, seed: int) -> list[Row]:
    """Return the tilt (rad) at which a slowly tilted vessel has lost one particle of 10 mm; x: fill, share of the capacity.

    The row "spill_allowed" has, as measured, by how much the tilt may be larger when one spacing of liquid is held back.
    """
    cup = vessel.cavity
    lip, axis = lip_alone(cup), pour_axis(cup.opening_m, lip_alone(cup))
    n = liquid.particles_for(vessel, share * cup.capacity_m3)
    fill_m3 = n * vessel.spacing_m**3
    tilts = np.linspace(0.0, np.pi / 2, 361)
    kept_m3 = retained_volume_m3(cup, lip, axis, tilts)
    theory = _first_below(tilts, kept_m3, fill_m3)
    held_back_m3 = vessel.spacing_m * surface_m2(cup, axis, theory, fill_m3)
    allowed = _first_below(tilts, kept_m3, fill_m3 - held_back_m3) - theory
    pour = liquid.pour(
        vessel, n, lip, axis, theory + SPILL_BEYOND_RAD, seed, tilt_s=SPILL_S, wait_s=0.0, patient=True
    )
    lost_m3 = (1.0 - pour.retained) * fill_m3
    poured = lost_m3 > ONE_PARTICLE_M3 - vessel.spacing_m**3 / 2
    onset = pour.tilts_rad[np.argmax(poured)] if poured.any() else np.nan
    return [
        row("spill", name, vessel, n, share, onset, theory),
        row("spill_allowed", name, vessel, n, share, allowed),
    ]


def _first_below(tilts: np.ndarray, kept_m3: np.ndarray, volume_m3: float) -> float:
    """Return the tilt at which what is kept, falling, passes a volume."""
    return float(np.interp(-volume_m3, -kept_m3, tilts))


def surface_m2(cup: Cavity, axis: np.ndarray, tilt_rad: float, volume_m3: float) -> float:
    """Return the area of the free surface of a volume in a tilted vessel."""
    room = room_m3(cup)
    index = np.argwhere(room > 0)
    up = rotation_about(axis, -tilt_rad)[:, 2]
    height = (cup.origin_m + cup.cell_m * index) @ up
    order = np.argsort(height, kind="stable")
    below = np.cumsum(room[tuple(index[order].T)])
    level = height[order][min(np.searchsorted(below, volume_m3), len(order) - 1)]
    layer = 2.0 * cup.cell_m
    return float(room[tuple(index[np.abs(height - level) < layer].T)].sum() / (2.0 * layer))


def retained(name: str, vessel: Vessel, seed: int) -> list[Row]:
    """Return what a brimful vessel keeps while it is slowly tilted, and what hydrostatics leaves (m³); x: tilt in rad."""
    cup = vessel.cavity
    lip, axis = lip_alone(cup), pour_axis(cup.opening_m, lip_alone(cup))
    n = liquid.holds(vessel)
    pour = liquid.pour(
        vessel, n, lip, axis, RETAINED_MAX_RAD, seed, tilt_s=RETAINED_S, wait_s=0.0, patient=True
    )
    tilts = np.radians(np.arange(0.0, np.degrees(RETAINED_MAX_RAD) + 0.1, 5.0))
    share = np.interp(tilts, pour.tilts_rad, pour.retained, right=0.0 if pour.n_retained == 0 else None)
    kept_m3 = retained_volume_m3(cup, lip, axis, tilts)
    return [
        row("retained", name, vessel, n, tilt, n * vessel.spacing_m**3 * measured, expected)
        for tilt, measured, expected in zip(tilts, share, kept_m3, strict=True)
    ]


def leaks(name: str, vessel: Vessel, trials: int, seed: int) -> list[Row]:
    """Return the particles that crossed the wall in pours of random fill and tilt; x: trial."""
    cup = vessel.cavity
    lip, axis = lip_alone(cup), pour_axis(cup.opening_m, lip_alone(cup))
    rows = []
    for trial in range(trials):
        rng = np.random.default_rng((seed, trial))
        n = liquid.particles_for(vessel, rng.uniform(0.05, 1.0) * cup.capacity_m3)
        pour = liquid.pour(vessel, n, lip, axis, rng.uniform(0.0, 2.0 * np.pi / 3.0), trial)
        rows.append(row("leaked", name, vessel, n, trial, pour.n_leaked, 0.0))
    return rows
