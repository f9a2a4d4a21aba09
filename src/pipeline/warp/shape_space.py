"""A warp within the space of shapes that other objects span, as in Interaction Warping (Biza et al. 2023)."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from pipeline.errors import PipelineError
from pipeline.geometry import frames
from pipeline.warp import nearest_neighbour, splines
from pipeline.warp.alignment import PartFrame
from pipeline.warp.clouds import Cloud
from pipeline.warp.deformation import Chain, Deformation, Kernels, PartStretch, kernel
from pipeline.warp.stretch import linear
from pipeline.warp.warp import Warp

CENTRES, SPLINE_STIFFNESS = 150, 1e-4
POINTS, ROUNDS = 1500, 30
# What a coefficient of one standard deviation costs, as mean squared distance, in squared spreads of the target's container.
PRIOR = 1e-5
UP = np.array([1.0, 0.0, 0.0])  # the first part axis


@dataclass(frozen=True)
class Space:
    """Splines of a source's part frame: the mean of those onto other objects, and their principal components.

    Centres (K, 3) in metres; coefficients (4 + K, 3) of the mean and (D, 4 + K, 3) of the components, one standard deviation
    each: of the coordinates, of 1 and of the kernels.
    """

    centres_m: np.ndarray
    mean: np.ndarray
    components: np.ndarray

    def spline(self, place: np.ndarray) -> Kernels:
        """Return the spline at a place (D,) in the space, in standard deviations."""
        found = self.mean + np.tensordot(place, self.components, axes=1)
        return Kernels(found[:3].T, found[3], self.centres_m, found[4:])

    def directions(self, points_m: np.ndarray) -> np.ndarray:
        """Return where points (N, 3) move along the components: (N, 3, D)."""
        terms = np.hstack([points_m, np.ones((len(points_m), 1)), kernel(points_m, self.centres_m, 0.0)])
        return np.einsum("nb,dbc->ncd", terms, self.components, optimize=True)


@dataclass(frozen=True)
class Pose:
    """A turn about the first part axis, a scale and a shift (3,) in metres, in the target's part frame."""

    turn_rad: float
    scale: float
    shift_m: np.ndarray

    @property
    def rotation(self) -> np.ndarray:
        """The turn (3, 3)."""
        return frames.rotation_about(UP, self.turn_rad)


def fit(source: Cloud, target: Cloud, *, rng: np.random.Generator, examples: Sequence[np.ndarray]) -> Warp:
    """Return the source in the shape, among those that examples span, and in the pose and size that fit the target best.

    Examples (N, 3) are from `example`, the target's own left out; the source as it is counts as one. Gauss-Newton steps on
    pairs with agreeing normals, both ways, in place of the paper's gradient descent; the parts' frames are the only start, as
    the table tells what is up. A shape costs what it is away from the mean.
    """
    if not examples:
        raise PipelineError(
            f"{target.name}: expected objects beside it and {source.name} to learn shapes from, found none; "
            "add objects, or choose another warp.method than shape_space"
        )
    warp = nearest_neighbour.coarse(source, target)
    space = learnt(_in_part_frame(source, warp.source_frame), examples)
    place = np.zeros(len(space.components))
    pose = Pose(0.0, _size(warp.target_frame) / _size(warp.source_frame), np.zeros(3))
    for _ in range(ROUNDS):
        place, pose = _step(_with(warp, space, place, pose), space, place, pose)
    diagnostics = {
        "examples": float(len(examples) + 1),
        "components": float(len(place)),
        "deviations": float(np.linalg.norm(place)),
    }
    return replace(_with(warp, space, place, pose), method="shape_space", diagnostics=diagnostics)


def example(source: Cloud, warp: Deformation, source_frame: PartFrame, other_frame: PartFrame) -> np.ndarray:
    """Return a source's points warped onto another object (N, 3): in the part frame of that, at the source's own size."""
    T_part_other = frames.inverse(other_frame.T_object_part)
    return frames.apply(T_part_other, warp.map(source.points_m)) * (_size(source_frame) / _size(other_frame))


def learnt(part_m: np.ndarray, examples: Sequence[np.ndarray]) -> Space:
    """Return the space of a source's points (N, 3), part frame, and of where they are on other objects (N, 3) each.

    Principal components of the displacements, as splines: a spline's coefficients are linear in what it is fitted to.
    """
    step = max(1, len(part_m) // nearest_neighbour.REFINEMENT_POINTS)
    thin_m, centres_m = part_m[::step], part_m[:: max(1, len(part_m) // CENTRES)]
    shapes_m = np.stack([part_m[::step], *(points_m[::step] for points_m in examples)])
    fitted = [splines.fit(thin_m, shape_m, centres_m, SPLINE_STIFFNESS) for shape_m in shapes_m]
    coefficients = np.stack([np.vstack([s.affine.T, s.offset_m, s.weights]) for s in fitted])
    mean = coefficients.mean(axis=0)
    away_m = (shapes_m - shapes_m.mean(axis=0)).reshape(len(shapes_m), -1)
    left, _, _ = np.linalg.svd(away_m, full_matrices=False)
    # All but the last, which is nothing: as many shapes differ from their mean in one way less.
    components = np.tensordot(left[:, :-1].T, coefficients - mean, axes=1) / np.sqrt(len(shapes_m) - 1)
    return Space(centres_m, mean, components)


def _in_part_frame(cloud: Cloud, frame: PartFrame) -> np.ndarray:
    return frames.apply(frames.inverse(frame.T_object_part), cloud.points_m)


def _size(frame: PartFrame) -> float:
    return float(np.linalg.norm(frame.spread_m))


def _with(warp: Warp, space: Space, place: np.ndarray, pose: Pose) -> Warp:
    into = PartStretch(warp.source_frame.T_object_part, np.eye(4), linear(np.ones(3)))
    T_target_shape = warp.target_frame.T_object_part @ frames.transform(pose.rotation, pose.shift_m)
    onto = PartStretch(np.eye(4), T_target_shape, linear(np.full(3, pose.scale)))
    return replace(warp, deformation=Chain(Chain(into, space.spline(place)), onto))


def _step(warp: Warp, space: Space, place: np.ndarray, pose: Pose) -> tuple[np.ndarray, Pose]:
    """Return the place and the pose after a Gauss-Newton step on the present pairs."""
    thin, from_rows, to_rows = nearest_neighbour.pairs(warp, POINTS)
    part_m = _in_part_frame(thin.source, warp.source_frame)
    T_part_target = frames.inverse(warp.target_frame.T_object_part)
    apart_m = frames.rotate(T_part_target, thin.target.points_m[to_rows] - thin.aligned.points_m[from_rows])
    turned = pose.scale * pose.rotation
    shape_m = space.spline(place).map(part_m) @ turned.T
    slopes = [
        np.einsum("ij,njd->nid", turned, space.directions(part_m), optimize=True),
        np.cross(UP, shape_m)[..., None],
        shape_m[..., None],
        np.tile(np.eye(3), (len(shape_m), 1, 1)),
    ]
    count = len(place)
    cost = np.zeros(count + 5)
    cost[:count] = PRIOR * _size(warp.target_frame) ** 2
    change = _solved(np.concatenate(slopes, axis=2)[from_rows], apart_m, cost, np.append(place, np.zeros(5)))
    turn_rad, log_scale, *shift_m = change[count:]
    moved = Pose(pose.turn_rad + turn_rad, pose.scale * np.exp(log_scale), pose.shift_m + shift_m)
    return place + change[:count], moved


def _solved(slopes: np.ndarray, apart_m: np.ndarray, cost: np.ndarray, now: np.ndarray) -> np.ndarray:
    """Return the change (P,) of unknowns (P,) that least squares of (N, 3), slopes (N, 3, P), and their cost ask for."""
    flat = slopes.reshape(-1, slopes.shape[2])
    matrix = flat.T @ flat / len(apart_m) + np.diag(cost)
    return np.linalg.solve(matrix, flat.T @ apart_m.ravel() / len(apart_m) - cost * now)
