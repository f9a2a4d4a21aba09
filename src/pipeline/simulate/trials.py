"""The two experiments: draw a trial, let Bullet move the containers and the liquid flow, write down what happened.

Paper, Section IV-A. A trial is a pure function of (geometry, protocol, trial number, seed): running some of the trials
gives the same rows as running all.
"""

from collections.abc import Callable, Generator, Sequence
from typing import Any

import numpy as np

from pipeline.errors import PipelineError
from pipeline.geometry import frames
from pipeline.simulate import draws, liquid
from pipeline.simulate.containers import Containers
from pipeline.simulate.prepared import Container
from pipeline.simulate.rest import GRAVITY

Row = dict[str, Any]
# A trial under way: it asks for a simulation by the arguments of an engine's `pour` or `fill`, is sent the result, returns its row.
Trial = Generator[tuple[Any, ...], Any, Row]
# Nine of ten placements may collide; a trial that needs more draws than this has a geometry that cannot work.
MAX_ATTEMPTS = 1000


def alone(trial: Trial, simulate: Callable[..., Any]) -> Row:
    """Run a trial to its end by `simulate`; return its row."""
    result = None
    try:
        while True:
            result = simulate(*trial.send(result))
    except StopIteration as end:
        return end.value


def pouring_trial(cup: Container, protocol: draws.Pouring, trial: int, seed: int) -> Row:
    """Run one pouring trial of a cup alone; return its row of the table "trials"."""
    return alone(pouring(cup, protocol, trial, seed), cup.engine.pour)


def pouring(cup: Container, protocol: draws.Pouring, trial: int, seed: int) -> Trial:
    """Begin one pouring trial of a cup alone."""
    own_seed = draws.trial_seed(seed, "pouring", cup.name, trial)
    draw = draws.draw_pouring(cup.cavity, protocol, draws.stream(own_seed, 0))
    n = cup.engine.particles_for(cup.vessel, draw.fill_m3)
    pour = yield cup.vessel, n, draw.lip_m, draw.axis, draw.tilt_rad, own_seed
    kept_m3 = cup.kept_m3(draw.lip_m, draw.axis, draw.tilt_rad)
    return {
        **_identity(trial, own_seed, "pouring", cup.name, cup.name, "capacity"),
        **_poses(draw.lip_m, draw.axis, np.eye(4), np.full((4, 4), np.nan)),
        **{"fill_m3": draw.fill_m3, "second_fill_m3": np.nan, "tilt_rad": draw.tilt_rad},
        **{"dx_m": np.nan, "dy_m": np.nan, "dz_m": np.nan},
        **_counts(pour, n, 0, pour.n_left),
        "n_void": 0,
        "hydrostatic_margin": (draw.fill_m3 - kept_m3) / cup.cavity.capacity_m3,
        "poured": bool(not pour.failed and pour.n_left >= protocol.threshold),
        "filled": False,
    }


class FillingExperiment:
    """The filling trials of one second container: the held cups, and a Bullet world with all of them; close after use."""

    def __init__(self, second: Container, held: Sequence[Container], protocol: draws.Filling) -> None:
        self.second, self.held, self.protocol = second, tuple(held), protocol
        self._bullet = Containers()
        self._second_body = self._bullet.add_second(*second.coarse)
        self._held_bodies = [self._bullet.add_held(cup.pieces) for cup in self.held]

    def __enter__(self) -> "FillingExperiment":
        return self

    def __exit__(self, *_: object) -> None:
        self._bullet.close()

    def trial(self, trial: int, seed: int) -> Row:
        """Run one filling trial; return its row of the table "trials"."""
        return alone(self.filling(trial, seed), self.second.engine.fill)

    def filling(self, trial: int, seed: int) -> Trial:
        """Begin one filling trial.

        A contact between the containers on the way, or liquid over a rim before the tilt, voids a draw: it is repeated
        with the same held cup and counted.
        """
        own_seed = draws.trial_seed(seed, "filling", self.second.name, trial)
        number = draws.draw_held(draws.stream(own_seed, 0), len(self.held))
        n_contacts = 0
        for n_void in range(MAX_ATTEMPTS):
            draw = self.draw(trial, own_seed, number, n_void)
            if self.touches(draw, number):
                n_contacts += 1
                continue
            filling = yield self._call(draw, number, own_seed)
            if filling.failed or not filling.spilled_while_settling:
                return self._row(trial, own_seed, draw, self.held[number], filling, n_void)
        raise PipelineError(
            f"{self.second.name}: expected a trial with {self.held[number].name} held above it that is not void, found "
            f"{n_contacts} contacts and {MAX_ATTEMPTS - n_contacts} spills at rest in {MAX_ATTEMPTS} draws; take "
            f"{self.held[number].name} out of simulate.filling.held_objects or widen its ranges"
        )

    def draw(self, trial: int, own_seed: int, number: int, attempt: int) -> draws.FillingDraw:
        """Draw attempt `attempt` at a trial with held cup `number`."""
        held, rng = self.held[number], draws.stream(own_seed, attempt + 1)
        return draws.draw_filling(
            held.cavity, held.height_m, self.second.cavity, held.particle_m3, self.protocol, trial, rng
        )

    def touches(self, draw: draws.FillingDraw, number: int) -> bool:
        """Return whether the containers touch on the way from upright to the tilt."""
        return self._bullet.touch_on_the_way(
            self._held_bodies[number],
            self._second_body,
            draw.T_world_held,
            draw.T_world_second,
            draw.lip_world,
            draw.axis_world,
            self.protocol.tilt_rad,
        )

    def simulate(self, draw: draws.FillingDraw, number: int, seed: int) -> liquid.Filling:
        """Let the liquid flow from held cup `number` as drawn."""
        return self.second.engine.fill(*self._call(draw, number, seed))

    def _call(self, draw: draws.FillingDraw, number: int, seed: int) -> tuple[Any, ...]:
        return (
            self.held[number].vessel,
            self.second.vessel,
            draw.T_world_held,
            draw.T_world_second,
            draw.lip_m,
            draw.axis_world,
            self.protocol.tilt_rad,
            self.protocol.held_particles,
            self.second.engine.particles_for(self.second.vessel, draw.second_fill_m3),
            seed,
        )

    def _row(
        self,
        trial: int,
        own_seed: int,
        draw: draws.FillingDraw,
        held: Container,
        filling: liquid.Filling,
        n_void: int,
    ) -> Row:
        n_second = self.second.engine.particles_for(self.second.vessel, draw.second_fill_m3)
        n_left = self.protocol.held_particles - filling.n_retained
        outside = filling.n_spilled + filling.n_retained
        return {
            **_identity(trial, own_seed, "filling", self.second.name, held.name, draw.half),
            **_poses(draw.lip_m, draw.axis_world, draw.T_world_held, draw.T_world_second),
            "fill_m3": self.protocol.held_particles * held.particle_m3,
            "second_fill_m3": draw.second_fill_m3,
            "tilt_rad": self.protocol.tilt_rad,
            **{"dx_m": draw.dx_m, "dy_m": draw.dy_m, "dz_m": draw.dz_m},
            **_counts(filling, self.protocol.held_particles, n_second, filling.n_spilled),
            "n_void": n_void,
            "hydrostatic_margin": filling_margin(draw, held, self.second, self.protocol),
            "poured": bool(not filling.failed and n_left > 0),
            "filled": bool(not filling.failed and outside == 0),
        }


def filling_margin(
    draw: draws.FillingDraw, held: Container, second: Container, protocol: draws.Filling
) -> float:
    """Return the answer of hydrostatics and a thrown stream to a filling trial: positive when all ends in the second.

    The smaller of two shares: how far inside the second's rim the stream comes down, in radii of its opening, and the
    room that would be left, in capacities. What the held cup keeps, from half a particle on, counts against both.
    """
    held_m3, capacity_m3 = protocol.held_particles * held.particle_m3, second.cavity.capacity_m3
    along = draws.ahead(draw.axis_world)
    landing = draw.lip_world + throw_m(held.depth_m, draw.dz_m, protocol.tilt_rad) * along
    rim_world = frames.apply(draw.T_world_second, second.cavity.rim_m)
    inside = inside_m(rim_world[:, :2], landing[:2]) / second.cavity.opening_radius_m
    margin = min(inside, (capacity_m3 - draw.second_fill_m3 - held_m3) / capacity_m3)
    axis_held = draw.T_world_held[:3, :3].T @ draw.axis_world
    least_m3 = 0.5 * held.particle_m3
    if held.under_rim_m3(axis_held, protocol.tilt_rad) < least_m3:
        return float(margin)
    kept_m3 = min(held_m3, held.kept_m3(draw.lip_m, axis_held, protocol.tilt_rad))
    return float(margin if kept_m3 < least_m3 else min(margin, -kept_m3 / held_m3))


def throw_m(depth_m: float, fall_m: float, tilt_rad: float) -> float:
    """Return how far beyond the lip a little liquid lands, `fall_m` below it; 0 up to a tilt of 90°.

    It slides without friction from the floor to the lip of a cup of that depth, then flies along the wall's direction.
    """
    speed = np.sqrt(2.0 * GRAVITY * depth_m * max(0.0, -np.cos(tilt_rad)))
    forward, down = speed * np.sin(tilt_rad), -speed * np.cos(tilt_rad)
    return float(forward * (np.sqrt(down**2 + 2.0 * GRAVITY * fall_m) - down) / GRAVITY)


def inside_m(contour: np.ndarray, point: np.ndarray) -> float:
    """Return how far a point (2,) is inside a closed contour (M, 2): its distance to it, negative outside."""
    start, edge = contour, np.roll(contour, -1, axis=0) - contour
    offset = point - start
    share = np.clip(np.einsum("ij,ij->i", offset, edge) / np.einsum("ij,ij->i", edge, edge), 0.0, 1.0)
    distance = np.linalg.norm(offset - share[:, None] * edge, axis=1).min()
    end = start + edge
    crosses = (start[:, 1] > point[1]) != (end[:, 1] > point[1])
    x = start[crosses, 0] + (point[1] - start[crosses, 1]) / edge[crosses, 1] * edge[crosses, 0]
    return float(distance if np.count_nonzero(x > point[0]) % 2 else -distance)


def _identity(trial: int, seed: int, experiment: str, name: str, held: str, half: str) -> Row:
    names = {"experiment": experiment, "object": name, "held_object": held, "half": half}
    return {"trial": trial, "seed": seed, **names}


def _poses(lip: np.ndarray, axis: np.ndarray, T_world_held: np.ndarray, T_world_second: np.ndarray) -> Row:
    return {
        **dict(zip(("lip_x_m", "lip_y_m", "lip_z_m"), lip.tolist(), strict=True)),
        **dict(zip(("axis_x", "axis_y", "axis_z"), axis.tolist(), strict=True)),
        "T_world_held": T_world_held.ravel().tolist(),
        "T_world_second": T_world_second.ravel().tolist(),
    }


def _counts(result: liquid.Pour | liquid.Filling, n_held: int, n_second: int, n_spilled: int) -> Row:
    """Return what is counted alike in both experiments; `n_particles` and `n_left` are of the held cup."""
    return {
        **{"n_particles": n_held, "n_second": n_second},
        **{"n_left": n_held - result.n_retained, "n_retained": result.n_retained},
        **{"n_spilled": n_spilled, "n_leaked": result.n_leaked},
        **{"density_error": result.density_error, "failed": bool(result.failed)},
    }
