"""A warp of a source onto a target, by whatever method: what it moves, and what it maps (sections II-B and II-C)."""

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from pipeline.geometry import frames
from pipeline.warp.alignment import PartFrame
from pipeline.warp.clouds import Cloud, Mapped, subset
from pipeline.warp.deformation import Deformation
from pipeline.warp.foreign import foreign, near_rim, rim_ring
from pipeline.warp.nearest import agreeing_neighbours, majority_of_neighbours, mean_of_neighbours
from pipeline.warp.ring import Ring


@dataclass(frozen=True)
class Warp:
    """A source fitted to a target: their part frames, and the deformation that takes the one onto the other.

    `diagnostics` are numbers that the method says of itself.
    """

    method: str
    source: Cloud
    target: Cloud
    source_frame: PartFrame
    target_frame: PartFrame
    deformation: Deformation
    diagnostics: dict[str, float] = field(default_factory=dict)

    @property
    def pose(self) -> np.ndarray:
        """T_target_source (4, 4): the coarse alignment, part frame onto part frame."""
        return self.target_frame.T_object_part @ frames.inverse(self.source_frame.T_object_part)

    @cached_property
    def scale(self) -> np.ndarray:
        """Factors (3,) on the spread of the source's container along the part axes."""
        T_part_object = frames.inverse(self.target_frame.T_object_part)
        container_m = self.aligned.points_m[self.source.parts[:, 0]]
        return frames.apply(T_part_object, container_m).std(axis=0) / self.source_frame.spread_m

    @cached_property
    def aligned(self) -> Cloud:
        """The source, deformed, in the target's object frame."""
        return self.deformation.carry(self.source)

    @property
    def has_counterpart(self) -> np.ndarray:
        """Which of the source's points (N,) the target can have, too: all but a handle's, where no handle was found."""
        return ~self.source.parts[:, 2] | (self.target_frame.handles > 0)

    @cached_property
    def is_known(self) -> np.ndarray:
        """Which of the target's points (M,) the source can have, too: all but what is `foreign` to it.

        By the clouds alone: the target's frame is that of what was left when it was fitted.
        """
        return ~foreign(self.target, self.source)

    @cached_property
    def ring(self) -> Ring | None:
        """The ring of the target's opening, by its initial labels."""
        return rim_ring(self.target)

    @property
    def source_index(self) -> np.ndarray:
        """Rows (N,) of the source's points, each paired with one of `target_index`."""
        return np.arange(len(self.source.points_m))

    @cached_property
    def _pairs(self) -> tuple[np.ndarray, np.ndarray]:
        return point_pairs(self, 1, self.is_known)

    @property
    def target_index(self) -> np.ndarray:
        """Rows (N,) of the target's points that the source's go to; −1 where `valid` is not."""
        return self._pairs[0][:, 0]

    @property
    def valid(self) -> np.ndarray:
        """Whether (N,) a source point has a target point with an agreeing normal."""
        return self.target_index >= 0

    @property
    def cost_m(self) -> float:
        """Root mean squared distance of the paired points, in metres; inf without any pair."""
        distance_m = self._pairs[1][self.valid, 0]
        return float(np.sqrt(np.mean(distance_m**2))) if len(distance_m) else float("inf")

    def map_points(self, points_m: np.ndarray) -> np.ndarray:
        """Return where points (N, 3) of the source's object frame go in the target's: contact points, via-points."""
        return self.deformation.map(points_m)

    def map_frames(self, T_source_frame: np.ndarray) -> np.ndarray:
        """Return task frames (N, 4, 4) of the source's object frame in the target's.

        The rotation is the nearest one to the Jacobian's image of the old axes.
        """
        origins_m = T_source_frame[:, :3, 3]
        axes = self.jacobian(origins_m) @ T_source_frame[:, :3, :3]
        left, _, right = np.linalg.svd(axes)
        left[:, :, 2] *= np.sign(np.linalg.det(left @ right))[:, None]
        T_target_frame = np.tile(np.eye(4), (len(origins_m), 1, 1))
        T_target_frame[:, :3, :3], T_target_frame[:, :3, 3] = left @ right, self.map_points(origins_m)
        return T_target_frame

    def jacobian(self, points_m: np.ndarray) -> np.ndarray:
        """Return the deformation's derivatives (N, 3, 3) at points (N, 3) of the source's object frame."""
        return self.deformation.jacobian(points_m)

    def map_cloud(self, k: int) -> Mapped:
        """Map each source point to the mean of its k nearest target points with an agreeing normal; labels stay.

        The paper's point mapping.
        """
        target, aligned = self.target, self.aligned
        index, distance = self._pairs if k == 1 else point_pairs(self, k, self.is_known)
        normals = mean_of_neighbours(target.normals, index)
        normals = normals / np.linalg.norm(normals, axis=1, keepdims=True)
        points_m = mean_of_neighbours(target.points_m, index)
        parts, valid = aligned.parts.copy(), index[:, 0] >= 0
        parts[valid, 1] &= near_rim(points_m[valid], self.ring)
        cloud = Cloud(target.name, points_m, normals, aligned.area_m2, parts)
        return Mapped(cloud, self.source_index, index[:, 0], valid, distance[:, 0])

    def map_labels(self, k: int) -> Mapped:
        """Give each target point the labels that most of its k nearest source points with an agreeing normal have.

        The paper's label mapping.
        """
        index, distance = label_pairs(self, k)
        parts = majority_of_neighbours(self.aligned.parts, index) & self.is_known[:, None]
        parts[:, 1] &= near_rim(self.target.points_m, self.ring)
        cloud = replace(self.target, parts=parts)
        return Mapped(cloud, index[:, 0], np.arange(len(parts)), index[:, 0] >= 0, distance[:, 0])


def point_pairs(warp: Warp, k: int, known: np.ndarray | None = None) -> tuple[np.ndarray, np.ndarray]:
    """Return for each source point the k nearest target points with an agreeing normal: rows (N, k), distances (N, k).

    Of target points that are not `known` (M,) there are none.
    """
    aligned, rows = (
        warp.aligned,
        np.arange(len(warp.target.points_m)) if known is None else np.flatnonzero(known),
    )
    near = subset(warp.target, rows)
    index, distance = agreeing_neighbours(aligned.points_m, aligned.normals, near.points_m, near.normals, k)
    return np.where(index >= 0, rows[index], -1), distance


def label_pairs(warp: Warp, k: int) -> tuple[np.ndarray, np.ndarray]:
    """Return for each target point the k nearest source points with an agreeing normal: rows (M, k), distances (M, k).

    Those without a counterpart are none: where the handle was, a wall without one would get its label.
    """
    target, rows = warp.target, np.flatnonzero(warp.has_counterpart)
    near = subset(warp.aligned, rows)
    index, distance = agreeing_neighbours(target.points_m, target.normals, near.points_m, near.normals, k)
    return np.where(index >= 0, rows[index], -1), distance
