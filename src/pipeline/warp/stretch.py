"""How an aligned source is stretched along the part axes onto a target."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Stretch:
    """A map of part coordinates (N, 3), source to target, each axis by itself; the third and second are linear.

    The first axis goes through `knots_m` (2, K), source above target, straight between them and beyond; the others by
    `scale` (2,) and `offset_m` (2,).
    """

    knots_m: np.ndarray
    scale: np.ndarray
    offset_m: np.ndarray

    def map(self, points_m: np.ndarray) -> np.ndarray:
        """Return where points (N, 3) go."""
        source, target = self.knots_m
        segment = self._segment(points_m)
        first = target[segment] + self._slopes()[segment] * (points_m[:, 0] - source[segment])
        return np.column_stack([first, points_m[:, 1:] * self.scale + self.offset_m])

    def factors(self, points_m: np.ndarray) -> np.ndarray:
        """Return the Jacobian's diagonal (N, 3) at points (N, 3)."""
        across = np.broadcast_to(self.scale, (len(points_m), 2))
        return np.column_stack([self._slopes()[self._segment(points_m)], across])

    def _slopes(self) -> np.ndarray:
        return np.diff(self.knots_m[1]) / np.diff(self.knots_m[0])

    def _segment(self, points_m: np.ndarray) -> np.ndarray:
        return np.searchsorted(self.knots_m[0, 1:-1], points_m[:, 0])


def linear(scale: np.ndarray) -> Stretch:
    """Return the stretch by factors (3,) about the origin: the paper's, when they are those of the variances."""
    return Stretch(np.array([[0.0, 1.0], [0.0, scale[0]]]), scale[1:], np.zeros(2))


def between_extents(
    source_extent_m: np.ndarray, target_extent_m: np.ndarray, rim_m: float, scale: np.ndarray
) -> Stretch:
    """Return the stretch that takes extent to extent (2,) along the first axis and leaves the topmost `rim_m` as it is.

    A lip is as thick on a bowl as on a mug, however much higher the mug; `scale` (3,) holds for the other axes. A rim of more
    than half of either extent is not kept.
    """
    kept = [rim_m] if rim_m < 0.5 * min(np.ptp(source_extent_m), np.ptp(target_extent_m)) else []
    knots = [[low, *(high - rim for rim in kept), high] for low, high in (source_extent_m, target_extent_m)]
    return Stretch(np.array(knots), scale[1:], np.zeros(2))
