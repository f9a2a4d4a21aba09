"""What the rim tells: opening, radius, lip, spout. Lengths in metres, object frame, z up."""

import numpy as np

from pipeline.geometry.cavity import lowest_point, spout_depth
from pipeline.parametrise.library import ingredient, parameter

STEPS = 180
# Points that are as near in azimuth are at the same place of the rim. 4°, but no rational part of a turn: on a regular rim, points
# would be just as far from a step, and rounding would decide.
_BESIDE_RAD = 0.07
_CENTRINGS = 3


@ingredient
def rim_turn(rim_m: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The rim by length: which points are at each of 180 steps round it (180, N), the share of its length each stands for (N,).

    Labels are deeper here and thinner there, scans denser; the length is the same whatever the points. Hence even steps of
    azimuth about the centre, each as long as the contour is there, divided among the points within 4°, in a gap the nearest.
    They begin at the first point, so that all that is read off them turns with the object; another order of the points
    moves it by hundredths of a millimetre.
    """
    steps = np.arange(STEPS) * 2 * np.pi / STEPS
    centre = rim_m.mean(axis=0)
    for _ in range(_CENTRINGS):
        azimuth = np.arctan2(*(rim_m - centre)[:, 1::-1].T)
        apart = np.abs((azimuth - azimuth[0] - steps[:, None] + np.pi) % (2 * np.pi) - np.pi)
        near = apart <= np.maximum(_BESIDE_RAD, apart.min(axis=1, keepdims=True))
        share = near / near.sum(axis=1, keepdims=True)
        contour = _smooth(share @ rim_m)
        length = np.linalg.norm(np.roll(contour, -1, axis=0) - np.roll(contour, 1, axis=0), axis=1)
        weight = length @ share / length.sum()
        centre = weight @ rim_m
    return near, weight


@ingredient
def contour_m(rim_m: np.ndarray, rim_turn: tuple[np.ndarray, np.ndarray]) -> np.ndarray:
    """Smoothed contour of the rim (180, 3), in even steps of azimuth: the mean of each step's points, at their top's height."""
    near, _ = rim_turn
    across = near @ rim_m[:, :2] / near.sum(axis=1, keepdims=True)
    return _smooth(np.column_stack([across, np.where(near, rim_m[:, 2], -np.inf).max(axis=1)]))


def _smooth(contour: np.ndarray) -> np.ndarray:
    """Return the circular mean over nine neighbours, 18°: single noisy points make no lip."""
    return np.mean([np.roll(contour, shift, axis=0) for shift in range(-4, 5)], axis=0)


@parameter("m", parts="xyz")
def opening_m(rim_m: np.ndarray, rim_turn: tuple[np.ndarray, np.ndarray]) -> np.ndarray:
    """Centre of the opening: o = ∑ w p over the rim points p, each weighted by the length of rim it stands for.

    The paper's plain mean (w = 1/N) is drawn to where the label is deeper, on the jug by 2 mm.
    """
    return rim_turn[1] @ rim_m


@parameter("m")
def radius_m(rim_m: np.ndarray, opening_m: np.ndarray, rim_turn: tuple[np.ndarray, np.ndarray]) -> float:
    """Radius of the opening: r = ∑ w |p - o|, the mean distance of the rim to the opening's centre."""
    return float(rim_turn[1] @ np.linalg.norm(rim_m - opening_m, axis=1))


@ingredient
def lowest_m(contour_m: np.ndarray) -> np.ndarray:
    """Lowest point of the contour (3,): the middle of a spout's bed; of a level rim, the point furthest along +x."""
    return lowest_point(contour_m)


@parameter("m", parts="xyz")
def lip_m(rim_m: np.ndarray, lowest_m: np.ndarray) -> np.ndarray:
    """Lip of the cup alone: the rim point nearest to the contour's lowest (of a level rim, 2 mm, to that furthest along +x)."""
    return rim_m[np.argmin(np.linalg.norm(rim_m - lowest_m, axis=1))]


@parameter("1", parts="xy")
def spout_direction(lowest_m: np.ndarray, opening_m: np.ndarray) -> np.ndarray:
    """Where a cup alone pours to: the horizontal unit vector from the opening's centre to the contour's lowest point.

    Where `spout_depth_m` is within 2 mm there is no spout, and the direction is +x by convention.
    """
    outward = (lowest_m - opening_m)[:2]
    return outward / np.linalg.norm(outward)


@parameter("m")
def spout_depth_m(contour_m: np.ndarray) -> float:
    """Depth of the spout: how far the contour's lowest point is below its median height."""
    return spout_depth(contour_m)
