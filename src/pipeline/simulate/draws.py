"""What is drawn for a trial: fills, tilts and where the held cup is put; pure functions of (geometry, trial, seed).

Every trial has a seed of its own, and every attempt at it (a void trial is drawn again) its own stream of random
numbers, so that a trial is the same alone, in any order and in any process.
"""

import zlib
from dataclasses import dataclass

import numpy as np

from pipeline.geometry import frames
from pipeline.geometry.cavity import Cavity, lip_alone, lip_towards, pour_axis

# With absolute ranges shares are of these instead of the objects at hand; fills end where the object is full. The height is
# enough for a tall cup to hang above a wide bowl.
CUP_M3, CUP_RADIUS_M, CUP_HEIGHT_M = 2.5e-4, 0.060, 0.150


@dataclass(frozen=True)
class Pouring:
    """Ranges of the pouring experiment: fill as a share of the capacity, tilt in radians, particles that make a pour.

    `ranges`: relative to the object, or absolute.
    """

    fill_min: float
    fill_max: float
    tilt_max_rad: float
    threshold: int
    ranges: str = "relative"


@dataclass(frozen=True)
class Filling:
    """Ranges of the filling experiment: offsets in radii of the second's opening, heights in heights of the held cup."""

    held_particles: int
    tilt_rad: float
    offset_max_radii: float
    height_min: float
    height_max: float
    free_room_max_particles: int
    ranges: str = "relative"


@dataclass(frozen=True)
class PouringDraw:
    """One drawn pour: lip (3,) and axis (3,) in the cup's object frame, which is the world while it is upright."""

    fill_m3: float
    tilt_rad: float
    lip_m: np.ndarray
    axis: np.ndarray


@dataclass(frozen=True)
class FillingDraw:
    """One drawn filling: the poses (4, 4) before tilting, the lip (3,) in the held cup's frame, the axis in the world.

    dx_m along the pour, dy_m across (to the left), dz_m up: the lip relative to the centre of the second's opening.
    """

    second_fill_m3: float
    half: str
    T_world_held: np.ndarray
    T_world_second: np.ndarray
    lip_m: np.ndarray
    axis_world: np.ndarray
    dx_m: float
    dy_m: float
    dz_m: float

    @property
    def lip_world(self) -> np.ndarray:
        """The lip (3,) in the world, where it stays while the cup is tilted."""
        return frames.apply(self.T_world_held, self.lip_m)


def trial_seed(seed: int, experiment: str, name: str, trial: int) -> int:
    """Return a trial's own seed (63 bits), by its experiment, object and number alone."""
    words = [seed, zlib.crc32(experiment.encode()), zlib.crc32(name.encode()), trial]
    return int(np.random.SeedSequence(words).generate_state(1, np.uint64)[0] >> np.uint64(1))


def stream(seed: int, attempt: int) -> np.random.Generator:
    """Return the random numbers of one attempt at a trial (counter-based: streams never overlap)."""
    return np.random.Generator(np.random.Philox(key=np.array([seed, attempt], dtype=np.uint64)))


def draw_pouring(cup: Cavity, protocol: Pouring, rng: np.random.Generator) -> PouringDraw:
    """Draw a pour of a cup alone: fill and tilt uniform, the lip at the rim's lowest point."""
    share = rng.uniform(protocol.fill_min, protocol.fill_max)
    fill = share * (cup.capacity_m3 if protocol.ranges == "relative" else min(CUP_M3, cup.capacity_m3))
    lip = lip_alone(cup)
    return PouringDraw(fill, rng.uniform(0.0, protocol.tilt_max_rad), lip, pour_axis(cup.opening_m, lip))


def draw_held(rng: np.random.Generator, n: int) -> int:
    """Draw which of `n` held cups a trial uses; kept when the trial is drawn again, so that each has its share."""
    return int(rng.integers(n))


def draw_filling(
    held: Cavity,
    held_height_m: float,
    second: Cavity,
    particle_m3: float,
    protocol: Filling,
    trial: int,
    rng: np.random.Generator,
) -> FillingDraw:
    """Draw a filling. The second stands at the world's origin, the direction of the pour and the held cup's yaw are uniform.

    The lip is found upright and then fixed to the cup: the rim point nearest to the centre of the second's opening when
    the cup approaches along the pour, straight ahead, at the far end of the drawn range. Then the cup is shifted so that
    this lip is at the drawn (dx, dy, dz): dx < 0 before the opening's centre, dx > 0 beyond it. (Chosen anew after the
    shift, the nearest point of a round rim would always face the centre, and dy would be zero in every trial.)
    """
    heading, yaw = rng.uniform(-np.pi, np.pi, 2)
    relative = protocol.ranges == "relative"
    radius_m = second.opening_radius_m if relative else CUP_RADIUS_M
    dx, dy = rng.uniform(-1.0, 1.0, 2) * protocol.offset_max_radii * radius_m
    dz = rng.uniform(protocol.height_min, protocol.height_max) * (held_height_m if relative else CUP_HEIGHT_M)
    half, second_fill_m3 = _second_fill(second, particle_m3, protocol, trial, rng.uniform())

    standoff_m = protocol.offset_max_radii * radius_m + held.opening_radius_m
    R = frames.rotation_about(np.array([0.0, 0.0, 1.0]), yaw)
    approach = np.array([-standoff_m * np.cos(heading), -standoff_m * np.sin(heading), dz])
    T_world_approach = _placed(R, held.opening_m, second.opening_m + approach)
    lip = lip_towards(held, T_world_approach, second.opening_m)
    axis = R @ pour_axis(held.opening_m, lip)
    along = ahead(axis)
    lip_world = second.opening_m + dx * along + dy * axis + dz * np.array([0.0, 0.0, 1.0])
    T_world_held = _placed(R, lip, lip_world)
    return FillingDraw(
        second_fill_m3, half, T_world_held, np.eye(4), lip, axis, float(dx), float(dy), float(dz)
    )


def _second_fill(
    second: Cavity, particle_m3: float, protocol: Filling, trial: int, share: float
) -> tuple[str, float]:
    """Return a trial's half and the second's fill: even trials a share of the capacity, odd ones near the brim."""
    if trial % 2 == 0:
        whole_m3 = second.capacity_m3 if protocol.ranges == "relative" else min(CUP_M3, second.capacity_m3)
        return "relative", share * whole_m3
    free_m3 = share * protocol.free_room_max_particles * particle_m3
    return "free_room", max(0.0, second.capacity_m3 - free_m3)


def ahead(axis_world: np.ndarray) -> np.ndarray:
    """Return where a cup pours to (3,) that is tilted about a horizontal axis (3,): axis × up."""
    return np.array([axis_world[1], -axis_world[0], 0.0])


def _placed(R: np.ndarray, point: np.ndarray, point_world: np.ndarray) -> np.ndarray:
    """Return the pose with rotation R that takes a point (3,) of the body to a point of the world."""
    return frames.transform(R, point_world - R @ point)
