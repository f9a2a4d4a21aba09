"""Do the views agree with each other? If not, which common mistake in poses or units would make them agree?"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from pipeline.errors import PipelineError
from pipeline.fuse.raw import Views
from pipeline.geometry import frames

# Two views agree at a point when the second measures it within this; coarse, as it is to tell mistakes from noise.
TOLERANCE_M, TOLERANCE_SHARE = 0.010, 0.01
LEAST = 0.4  # of the points that another view could see: right poses reach 0.6 to 0.9, wrong ones 0.15
LEAST_OF_A_VIEW = 0.2
MOST_LEFT_OUT = 0.2  # of the views
# Another focal length or unit of depth brings what views measure nearer, where that is what is wrong: from 9 mm to 1.6 with 10 % of
# focal length; poses off at random, to 0.8 of it.
SLIGHT, NEARER, MUCH_NEARER = 1.03, 0.9, 0.7
WIDEST, STEPS = (1.5, 1.02), 41
EVERY = 4  # of the points
# Along the camera's axis another unit of depth and poses that are off look alike; less is refined.
LEAST_ALONG_M = 0.015
MUCH_MOVED = 0.05  # of the points above the table: flying pixels at edges are up to 0.03
NEAREST_M, FURTHEST_M = 0.1, 10.0  # of what stands on a table, from a depth camera
POINTS, PAIRS = 400, 200
_RANGE_STEP = 16  # pixels


@dataclass(frozen=True)
class Mistake:
    """A common mistake: what to say of it, what to do, and the poses and the factor on depths without it."""

    says: str
    cure: str
    right: Callable[[np.ndarray], np.ndarray]
    depth_factor: float = 1.0


def checked(
    views: Views, name: str, rng: np.random.Generator, are_given: bool = True
) -> tuple[Views, list[str]]:
    """Return the views whose poses fit the others', and the names of those left out.

    A `PipelineError` names the mistake that explains the disagreement: poses world→camera, another unit of lengths or
    depths, another convention of camera axes or quaternions; of given poses, as found ones fit any, another focal length.
    """
    _check_range(views, name)
    if len(views.depths_m) < 2:
        return views, []
    sample = _sample(views, rng)
    poses = np.stack(views.T_world_cameras)
    shares = agreement(views, sample, poses, 1.0)
    bad = np.nan_to_num(shares) < LEAST_OF_A_VIEW
    left_out = [view for view, is_bad in zip(views.names, bad, strict=True) if is_bad]
    if np.median(np.nan_to_num(shares)) < LEAST or bad.mean() > MOST_LEFT_OUT:
        raise PipelineError(_named(views, sample, poses, float(np.nan_to_num(shares).mean()), left_out, name))
    mistake = _of_scale(views, sample, poses, name) if are_given else None
    if mistake is not None:
        raise PipelineError(_sentence(mistake, name))
    return only(views, ~bad), left_out


def with_depth(views: Views) -> tuple[Views, list[str]]:
    """Return the views that hold enough depth to compare, and the names of the others: they look elsewhere, or from too near."""
    is_empty = np.array([np.count_nonzero(depth) < POINTS for depth in views.depths_m])
    if is_empty.all() or not is_empty.any():
        return views, []
    return only(views, ~is_empty), [name for name, empty in zip(views.names, is_empty, strict=True) if empty]


def only(views: Views, kept: np.ndarray) -> Views:
    """Return the views (N,) that are kept."""
    index = np.nonzero(kept)[0]
    angles = views.options.turntable_deg
    options = (
        replace(views.options, turntable_deg=tuple(angles[i] for i in index)) if angles else views.options
    )
    return replace(
        views,
        depths_m=[views.depths_m[i] for i in index],
        T_world_cameras=[views.T_world_cameras[i] for i in index if views.T_world_cameras],
        intrinsics=views.intrinsics[index],
        names=[views.names[i] for i in index],
        colours=[views.colours[i] for i in index if views.colours],
        options=options,
    )


def _check_range(views: Views, name: str) -> None:
    depths = np.array([np.median(depth[depth > 0][::_RANGE_STEP]) for depth in views.depths_m if depth.any()])
    median = float(np.median(depths))
    if not NEAREST_M < median < FURTHEST_M:
        raise PipelineError(
            f"{name}: expected depths between {NEAREST_M} and {FURTHEST_M:g} m, found {median:.3g} m in the middle; the images "
            f"have other units: write `depth_scale:` with their units per metre into {Path(name) / 'scan.yaml'} (1000 for mm)"
        )


@dataclass(frozen=True)
class Sample:
    """Points (M, 3) of each view in its camera's frame, and the pairs (P, 2) of views that are compared: all of them, or
    neighbours and after them `PAIRS` by chance."""

    points_m: list[np.ndarray]
    pairs: np.ndarray


def _sample(views: Views, rng: np.random.Generator) -> Sample:
    points = []
    for depth, K in zip(views.depths_m, views.intrinsics, strict=True):
        known = np.flatnonzero(depth > 0)
        chosen = rng.integers(len(known), size=POINTS) if len(known) else np.zeros(0, int)
        v, u = np.divmod(known[chosen], depth.shape[1])
        points.append(unprojected(u, v, depth[v, u], K))
    n = len(points)
    pairs = np.array([(i, j) for i in range(n) for j in range(n) if i != j])
    if len(pairs) > PAIRS:
        near = np.array([(i, (i + step) % n) for i in range(n) for step in (1, n - 1)])
        pairs = np.concatenate([near, pairs[rng.choice(len(pairs), PAIRS, replace=False)]])
    return Sample(points, pairs)


def unprojected(u: np.ndarray, v: np.ndarray, depth_m: np.ndarray, K: np.ndarray) -> np.ndarray:
    """Return points (N, 3) in the camera's frame of pixels (u, v) with their depths (N,)."""
    z = depth_m.astype(float)
    return np.stack([(u - K[0, 2]) / K[0, 0] * z, (v - K[1, 2]) / K[1, 1] * z, z], axis=-1)


def projected(points_camera: np.ndarray, K: np.ndarray, depth_m: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the measured depth (N,) where points (N, 3) of the camera's frame appear, 0 for none, and their own depth."""
    x, y, z = points_camera.T
    safe = np.where(z > 1e-6, z, 1.0)
    u, v = np.rint(x / safe * K[0, 0] + K[0, 2]), np.rint(y / safe * K[1, 1] + K[1, 2])
    height, width = depth_m.shape
    inside = (z > 1e-6) & (u >= 0) & (v >= 0) & (u < width) & (v < height)
    row, column = np.where(inside, v, 0).astype(int), np.where(inside, u, 0).astype(int)
    return np.where(inside, depth_m[row, column], 0.0), z


def agreement(views: Views, sample: Sample, T_world_cameras: np.ndarray, depth_factor: float) -> np.ndarray:
    """Return for each view (N,) the share of points that it and another view both see and both measure alike.

    NaN for a view that sees nothing of what the others do.
    """
    n = len(sample.points_m)
    alike, seen = np.zeros(n), np.zeros(n)
    places = [
        frames.apply(T, points * depth_factor)
        for T, points in zip(T_world_cameras, sample.points_m, strict=True)
    ]
    T_camera_worlds = np.linalg.inv(T_world_cameras)
    for j in range(n):
        others = sample.pairs[sample.pairs[:, 1] == j, 0]
        if len(others) == 0:
            continue
        own = np.repeat(others, [len(places[i]) for i in others])
        points = frames.apply(T_camera_worlds[j], np.concatenate([places[i] for i in others]))
        measured, expected = projected(points, views.intrinsics[j], views.depths_m[j])
        there = measured > 0
        near = np.abs(measured * depth_factor - expected) < TOLERANCE_M + TOLERANCE_SHARE * np.abs(expected)
        for total, counted in ((alike, near & there), (seen, there)):
            total += np.bincount(own[counted], minlength=n)
            total[j] += np.count_nonzero(counted)
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.where(seen >= 0.02 * POINTS, alike / seen, np.nan)


def seen_through(points_world: np.ndarray, views: Views, own: np.ndarray, others: int) -> np.ndarray:
    """Return which points (N, 3) more of a few other views look through than measure: of what moved, or of noise.

    Nobody looks through what stays, but past its edges: where much moved, half as many are enough. own (N,): the view that each
    point is from.
    """
    n = len(views.depths_m)
    through, there = np.zeros((2, len(points_world)), int)
    for j in np.unique(np.linspace(0, n - 1, min(n, others)).round().astype(int)):
        points = frames.apply(frames.inverse(views.T_world_cameras[j]), points_world)
        measured, expected = projected(points, views.intrinsics[j], views.depths_m[j])
        behind = measured - expected
        limit = TOLERANCE_M + TOLERANCE_SHARE * np.abs(expected)
        seen = (measured > 0) & (own != j)
        through += seen & (behind > limit)
        there += seen & (np.abs(behind) <= limit)
    moved = through > there
    return 2 * through > there if np.count_nonzero(moved) > MUCH_MOVED * len(moved) else moved


def _named(
    views: Views, sample: Sample, poses: np.ndarray, given: float, left_out: list[str], name: str
) -> str:
    """Return the sentence about the mistake that explains the disagreement best, if one does."""
    best, mistake = max(LEAST, given + 0.1), None
    for candidate in _mistakes(name, views.depth_scale):
        shares = agreement(views, sample, candidate.right(poses), candidate.depth_factor)
        share = float(np.nan_to_num(shares).mean())
        if share > best + 0.02:  # of two that explain it alike, the simpler one, which comes first
            best, mistake = share, candidate
    if mistake is not None:
        return _sentence(mistake, name)
    if given < LEAST:
        return (
            f"{name}: expected views that agree with each other, found that they do not, nor with any common mistake corrected; "
            "check that poses are camera→world in metres, the order of images and poses, the intrinsics and depth_scale"
        )
    return (
        f"{name}: expected poses that fit the images, found {len(left_out)} of {len(views.names)} views that others do not "
        f"agree with, such as {left_out[0]}; correct their poses or remove them"
    )


def _sentence(mistake: Mistake, name: str) -> str:
    return f"{name}: expected poses camera→world in metres and depths that fit them, found {mistake.says}; {mistake.cure}"


def _of_scale(views: Views, sample: Sample, poses: np.ndarray, name: str) -> Mistake | None:
    """Return what explains how far views are apart whose poses are about right: focal length or unit of depth some percent off."""
    # Neighbours in a hand-held sequence stand so near to each other that they agree with any scale.
    by_chance = sample.pairs[-PAIRS:]
    thinned = Sample([points[::EVERY] for points in sample.points_m], by_chance)

    def apart_m(focal: float = 1.0, depth: float = 1.0) -> float:
        return _apart_m(views, thinned, poses, focal, depth)

    given_m = apart_m()
    if not np.isfinite(given_m):  # none of them show the same
        return None
    slight = (1 / SLIGHT, SLIGHT)
    if min(*map(apart_m, slight), *(apart_m(depth=factor) for factor in slight)) > NEARER * given_m:
        return None
    focal, depth = _least(apart_m), _least(lambda factor: apart_m(depth=factor))
    if min(focal, depth)[0] > MUCH_NEARER * given_m:
        return None
    if depth < focal:
        off_m = abs(depth[1] - 1) * float(np.median(np.concatenate(thinned.points_m)[:, 2]))
        found = _of_depth(views.depth_scale / depth[1], name)
        or_else = f", or correct the poses, if they are {1e3 * off_m:.0f} mm off along the camera's axis"
        return replace(found, cure=found.cure + or_else) if off_m > LEAST_ALONG_M else None
    fx = views.intrinsics[0, 0, 0]
    says = f"that they fit with a focal length of about {fx * focal[1]:.0f} pixels instead of {fx:.0f}"
    cure = "correct the intrinsics: they are another camera's, or of images of another size"
    return Mistake(says, cure, lambda T: T)


def _least(apart_m: Callable[[float], float]) -> tuple[float, float]:
    """Return the least distance that a factor leads to, and the factor."""
    factor = 1.0
    for widest in WIDEST:
        factor = min((float(f) for f in factor * np.geomspace(1 / widest, widest, STEPS)), key=apart_m)
    return apart_m(factor), factor


def _apart_m(views: Views, sample: Sample, poses: np.ndarray, focal: float, depth: float) -> float:
    """Return the median distance of what two views measure at a place, with another focal length and unit of depth."""
    K = views.intrinsics * np.array([[focal, 1, 1], [1, focal, 1], [1, 1, 1]])
    factors = depth / np.array([focal, focal, 1.0])
    places = [frames.apply(T, points * factors) for T, points in zip(poses, sample.points_m, strict=True)]
    apart = []
    for j, T in enumerate(poses):
        others = sample.pairs[sample.pairs[:, 1] == j, 0]
        if len(others) == 0:
            continue
        points = frames.apply(frames.inverse(T), np.concatenate([places[i] for i in others]))
        measured, expected = projected(points, K[j], views.depths_m[j])
        apart.append(np.abs(measured * depth - expected)[measured > 0])
    together = np.concatenate(apart)
    return float(np.median(together)) if len(together) else np.inf


def _of_depth(scale: float, name: str) -> Mistake:
    cure = f"write `depth_scale: {scale:.4g}` into {Path(name) / 'scan.yaml'}"
    return Mistake(f"depths that fit at about {scale:.4g} units per metre", cure, lambda T: T)


def _mistakes(name: str, depth_scale: float) -> Iterator[Mistake]:
    file = Path(name) / "scan.yaml"
    yield Mistake("poses world→camera", "write their inverses", np.linalg.inv)
    for factor, unit in ((0.001, "mm"), (0.01, "cm"), (1000.0, "m")):
        cure = f"write `units: {unit}` into {file}"
        yield Mistake(f"translations in {unit}", cure, _scaled(factor))
        both = f"write the inverses of the poses, and `units: {unit}` into {file}"
        yield Mistake(f"poses world→camera in {unit}", both, lambda T, f=factor: np.linalg.inv(_scaled(f)(T)))  # type: ignore[misc]
    flip = np.diag([1.0, -1.0, -1.0, 1.0])
    cure = "turn the axes y and z of each pose round (OpenCV's convention: x right, y down, z forward)"
    yield Mistake("cameras that look along -z (OpenGL's convention)", cure, lambda T: T @ flip)
    yield Mistake(
        "poses world→camera of cameras that look along -z (OpenGL's convention)",
        f"write their inverses and {cure}",
        lambda T: np.linalg.inv(T) @ flip,
    )
    yield Mistake("quaternions in the order w x y z", "write them as x y z w", _reordered)
    for scale in (
        1000.0,
        5000.0,
        10000.0,
        100.0,
        4000.0,
        2000.0,
        *np.geomspace(depth_scale / 8, depth_scale * 8, 81),
    ):
        yield replace(_of_depth(scale, name), depth_factor=depth_scale / scale)


def _scaled(factor: float) -> Callable[[np.ndarray], np.ndarray]:
    scale = np.ones((4, 4))
    scale[:3, 3] = factor
    return lambda T: T * scale


def _reordered(T: np.ndarray) -> np.ndarray:
    """Return poses (N, 4, 4) whose quaternions w x y z were read as x y z w."""
    from scipy.spatial.transform import Rotation

    right = T.copy()
    right[:, :3, :3] = Rotation.from_quat(
        np.roll(Rotation.from_matrix(T[:, :3, :3]).as_quat(), -1, axis=1)
    ).as_matrix()
    return right
