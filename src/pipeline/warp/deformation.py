"""Where a warp takes the space around the source: maps from the source's object frame to the target's."""

from abc import ABC, abstractmethod
from dataclasses import dataclass, replace

import numpy as np

from pipeline.geometry import frames
from pipeline.warp.clouds import Cloud
from pipeline.warp.stretch import Stretch


class Deformation(ABC):
    """A smooth map of the space around a source, in metres."""

    @abstractmethod
    def map(self, points_m: np.ndarray) -> np.ndarray:
        """Return where points (N, 3) go."""

    @abstractmethod
    def jacobian(self, points_m: np.ndarray) -> np.ndarray:
        """Return the derivatives (N, 3, 3) at points (N, 3): rows are coordinates of the image."""

    def carry(self, cloud: Cloud) -> Cloud:
        """Return a cloud with its points moved; normals follow the inverse transpose, areas the cofactor."""
        cofactor = _cofactor(self.jacobian(cloud.points_m))
        turned = np.einsum("nij,nj->ni", cofactor, cloud.normals)
        length = np.linalg.norm(turned, axis=1)
        return replace(
            cloud,
            points_m=self.map(cloud.points_m),
            normals=turned / np.maximum(length, 1e-300)[:, None],
            area_m2=cloud.area_m2 * length,
        )


def _cofactor(J: np.ndarray) -> np.ndarray:
    """Return det(J) J⁻ᵀ of matrices (N, 3, 3) without dividing: its rows are the cross products of J's."""
    return np.stack([np.cross(J[:, i - 2], J[:, i - 1]) for i in range(3)], axis=1)


@dataclass(frozen=True)
class PartStretch(Deformation):
    """A stretch along the part axes, from the source's part frame to the target's."""

    T_source_part: np.ndarray
    T_target_part: np.ndarray
    stretch: Stretch

    def map(self, points_m: np.ndarray) -> np.ndarray:
        """Return where points (N, 3) go."""
        return frames.apply(self.T_target_part, self.stretch.map(self._part_m(points_m)))

    def jacobian(self, points_m: np.ndarray) -> np.ndarray:
        """Return the derivatives (N, 3, 3)."""
        factors = self.stretch.factors(self._part_m(points_m))
        back = frames.inverse(self.T_source_part)[:3, :3]
        return np.einsum("ij,nj,jk->nik", self.T_target_part[:3, :3], factors, back)

    def carry(self, cloud: Cloud) -> Cloud:
        """Return a cloud with its points, normals and areas moved, by the Jacobian's diagonal alone."""
        T_part_object = frames.inverse(self.T_source_part)
        part_m = frames.apply(T_part_object, cloud.points_m)
        factors = self.stretch.factors(part_m)
        stretched = frames.rotate(T_part_object, cloud.normals) / factors
        length = np.linalg.norm(stretched, axis=1)
        return replace(
            cloud,
            points_m=frames.apply(self.T_target_part, self.stretch.map(part_m)),
            normals=frames.rotate(self.T_target_part, stretched / length[:, None]),
            area_m2=cloud.area_m2 * factors.prod(axis=1) * length,
        )

    def _part_m(self, points_m: np.ndarray) -> np.ndarray:
        return frames.apply(frames.inverse(self.T_source_part), points_m)


@dataclass(frozen=True)
class Kernels(Deformation):
    """An affine map and weighted kernels about centres: x → A x + b + Σ wₖ φ(|x − cₖ|).

    `affine` (3, 3), `offset_m` (3,), `centres_m` (K, 3), `weights` (K, 3). With a `width_m` φ is a Gaussian,
    exp(−r²/2w²), as in coherent point drift; with none (0) it is −r, the thin-plate spline of three dimensions.
    """

    affine: np.ndarray
    offset_m: np.ndarray
    centres_m: np.ndarray
    weights: np.ndarray
    width_m: float = 0.0

    def map(self, points_m: np.ndarray) -> np.ndarray:
        """Return where points (N, 3) go."""
        bent = kernel(points_m, self.centres_m, self.width_m) @ self.weights
        return points_m @ self.affine.T + self.offset_m + bent

    def jacobian(self, points_m: np.ndarray) -> np.ndarray:
        """Return the derivatives (N, 3, 3); the spline's kernel has none at a centre, where zero is taken."""
        if self.width_m:
            slope = -kernel(points_m, self.centres_m, self.width_m) / self.width_m**2
        else:
            slope = kernel(points_m, self.centres_m, 0.0)
            np.divide(1.0, slope, out=slope, where=slope < 0.0)
        # Σ wₖ slopeₖ (x − cₖ)ᵀ as two sums over the centres, which are products of matrices.
        moments = (self.weights[:, :, None] * self.centres_m[:, None]).reshape(-1, 9)
        towards = (slope @ self.weights)[:, :, None] * points_m[:, None]
        return self.affine + towards - (slope @ moments).reshape(-1, 3, 3)


def kernel(points_m: np.ndarray, centres_m: np.ndarray, width_m: float) -> np.ndarray:
    """Return φ (N, K) of points (N, 3) about centres (K, 3); see `Kernels`."""
    from scipy.spatial.distance import cdist

    if width_m:
        return np.exp(-cdist(points_m, centres_m, "sqeuclidean") / (2.0 * width_m**2))
    distance_m = cdist(points_m, centres_m)
    return np.negative(distance_m, out=distance_m)


@dataclass(frozen=True)
class Chain(Deformation):
    """One deformation after the other."""

    first: Deformation
    then: Deformation

    def map(self, points_m: np.ndarray) -> np.ndarray:
        """Return where points (N, 3) go."""
        return self.then.map(self.first.map(points_m))

    def jacobian(self, points_m: np.ndarray) -> np.ndarray:
        """Return the derivatives (N, 3, 3), by the chain rule."""
        return self.then.jacobian(self.first.map(points_m)) @ self.first.jacobian(points_m)

    def carry(self, cloud: Cloud) -> Cloud:
        """Return a cloud with its points, normals and areas moved."""
        return self.then.carry(self.first.carry(cloud))
