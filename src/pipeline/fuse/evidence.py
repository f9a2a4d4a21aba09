"""What contradicts a view's pose: what it looks through, what others look through, and paint of another colour."""

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import minimum_filter

from pipeline.fuse.agreement import projected
from pipeline.fuse.levelled import COLOUR_M, Levelled
from pipeline.geometry import frames

THROUGH_M = 0.008  # a view looks through what is this far in front of what it measures
OTHER_CONTRAST = 0.1  # of the whole range of intensities: other paint
SAME_M = 0.004  # along the ray: both see the same place
FEW = 0.05  # of the points: that many more would be seen by both with paint as by chance


def nearest(depth_m: np.ndarray, K: np.ndarray, edge_m: float) -> np.ndarray:
    """Return the least depth within `edge_m` of each pixel (H, W): edges are not that sure."""
    known = depth_m[depth_m > 0]
    pixels = 1 + 2 * round(edge_m * K[0, 0] / float(np.median(known))) if len(known) else 1
    least = minimum_filter(np.where(depth_m > 0, depth_m, np.inf), pixels)
    return np.where(np.isfinite(least), least, 0.0)


@dataclass(frozen=True)
class Evidence:
    """Depths and nearest depths around each pixel (H, W), cameras, and some that are placed already: number and T_camera_world.

    contrasts: of each view by its number, where there are colours.
    """

    depths_m: list[np.ndarray]
    nearest_m: list[np.ndarray]
    intrinsics: np.ndarray
    witnesses: list[tuple[int, np.ndarray]]
    contrasts: dict[int, np.ndarray | None]

    def against(self, view: Levelled, T: np.ndarray, probe: np.ndarray) -> float:
        """Return the share of the model's points that the view contradicts, and of the view's that others contradict."""
        T_camera_world = frames.inverse(T @ view.T_level_camera)
        own = self._contradicted(view.number, T_camera_world, probe)
        features = view.features(T)
        others = [self._contradicted(number, T_camera, features) for number, T_camera in self.witnesses]
        return own + float(np.mean(others))

    def _contradicted(self, number: int, T_camera_world: np.ndarray, features: np.ndarray) -> float:
        """Return the share of points that face the camera and that it looks through, and that of other paint."""
        points = frames.apply(T_camera_world, features[:, :3])
        facing = np.einsum("nc,nc->n", points, frames.rotate(T_camera_world, features[:, 3:6])) < 0
        measured, expected = projected(points, self.intrinsics[number], self.nearest_m[number])
        asked = facing & (measured > 0)
        through = float(np.mean(asked & (measured - expected > THROUGH_M)))
        contrasts = self.contrasts[number]
        if contrasts is None:
            return through
        there, _ = projected(points, self.intrinsics[number], contrasts)
        measured, _ = projected(points, self.intrinsics[number], self.depths_m[number])
        both = asked & (np.abs(measured - expected) < SAME_M) & np.isfinite(there)
        return through + _otherwise_painted(features[:, 6] / COLOUR_M, there, both)


def _otherwise_painted(own: np.ndarray, there: np.ndarray, both: np.ndarray) -> float:
    """Return the share of the points that both see (N,) that have unlike contrasts (N,).

    Where hardly any are seen by both, it is that of any two points: little overlap is no agreement.
    """
    by_chance = unlike_by_chance(own)
    unlike = np.count_nonzero(np.abs(own - there)[both] > OTHER_CONTRAST)
    few = FEW * len(own)
    return (unlike + few * by_chance) / (np.count_nonzero(both) + few)


def unlike_by_chance(contrast: np.ndarray) -> float:
    """Return the share of pairs of points, whatever two of them (N,), that have unlike contrasts."""
    return float(np.mean(np.abs(contrast - np.roll(contrast, len(contrast) // 2)) > OTHER_CONTRAST))
