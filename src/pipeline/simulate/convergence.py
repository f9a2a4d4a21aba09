"""Trials run again: as they were, at half the spacing (and so half the time step), and at their own with another seed.

Volumes, poses and the threshold as a volume stay: a trial has poured when as much has left as the threshold's particles are
at the default spacing, and has filled when less than one of its particles is outside.
"""

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from pipeline.simulate import liquid
from pipeline.simulate.liquid import Vessel
from pipeline.simulate.measures import Row, row

ANOTHER_SEED = 1  # exclusive or with the trial's own

Pair = tuple[Vessel, Vessel]  # one container at the default spacing and at half of it


class Trial(NamedTuple):
    """What is needed of a row of the table "trials"."""

    trial: int
    seed: int
    held_object: str
    fill_m3: float
    second_fill_m3: float
    tilt_rad: float
    lip_m: np.ndarray
    axis_world: np.ndarray
    T_world_held: np.ndarray
    T_world_second: np.ndarray


def trial_of(found: Any) -> Trial:
    """Return a trial from a row (as of `itertuples`) of the table "trials"."""
    return Trial(
        *(found.trial, found.seed, found.held_object, found.fill_m3, found.second_fill_m3, found.tilt_rad),
        np.array([found.lip_x_m, found.lip_y_m, found.lip_z_m]),
        np.array([found.axis_x, found.axis_y, found.axis_z]),
        np.reshape(found.T_world_held, (4, 4)),
        np.reshape(found.T_world_second, (4, 4)),
    )


def pouring(name: str, pair: Pair, trial: Trial, threshold: int) -> list[Row]:
    """Return the rows of one pouring trial in a container's vessels.

    x: trial, measured: its label when it runs again, expected: as it was; NaN when it failed.
    """
    threshold_m3 = threshold * pair[0].spacing_m ** 3

    def label(vessel: Vessel, seed: int) -> float:
        n = liquid.particles_for(vessel, trial.fill_m3)
        pour = liquid.pour(vessel, n, trial.lip_m, trial.axis_world, trial.tilt_rad, seed)
        one_m3 = vessel.spacing_m**3
        return np.nan if pour.failed else pour.n_left * one_m3 > threshold_m3 - one_m3 / 2

    expected = label(pair[0], trial.seed)
    return [
        row(
            "repeat_pouring",
            name,
            pair[0],
            0,
            trial.trial,
            label(pair[0], trial.seed ^ ANOTHER_SEED),
            expected,
        ),
        row("converge_pouring", name, pair[1], 0, trial.trial, label(pair[1], trial.seed), expected),
    ]


def filling(name: str, pair: Pair, held: Mapping[str, Pair], trial: Trial) -> list[Row]:
    """Return the rows of one filling trial of the second container, poured into from one of the held; as `pouring`."""
    room_m3 = pair[0].spacing_m ** 3
    cups = held[trial.held_object]

    def label(which: int, seed: int) -> float:
        cup, second, one_m3 = cups[which], pair[which], pair[which].spacing_m ** 3
        n_held = liquid.particles_for(cup, trial.fill_m3)
        n_second = liquid.particles_for(second, trial.second_fill_m3)
        filling = liquid.fill(
            cup,
            second,
            trial.T_world_held,
            trial.T_world_second,
            trial.lip_m,
            trial.axis_world,
            trial.tilt_rad,
            n_held,
            n_second,
            seed,
        )
        outside_m3 = (filling.n_spilled + filling.n_retained) * one_m3
        filled = not filling.spilled_while_settling and outside_m3 < room_m3 - one_m3 / 2
        return np.nan if filling.failed else filled

    expected = label(0, trial.seed)
    return [
        row("repeat_filling", name, pair[0], 0, trial.trial, label(0, trial.seed ^ ANOTHER_SEED), expected),
        row("converge_filling", name, pair[1], 0, trial.trial, label(1, trial.seed), expected),
    ]
