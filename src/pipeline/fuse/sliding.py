"""Given poses that are off along the table, as of a turntable whose axis is elsewhere: that shows in the object alone.

Each view's small turn and shift that bring it to where the others see the object, of all views at once: neighbours are off alike.
"""

import numpy as np

from pipeline.fuse.planes import Planes
from pipeline.fuse.table import Placement
from pipeline.fuse.together import ALIKE, HOLD, HOLD_GIVEN_TURN, LEAST_FACING, NEAR_M, ROBUST_M, motions

SAMPLES, OTHERS = 250, 10  # points of each view, and views that each of them is looked for in
ABOVE_M = 0.010  # what is lower may be the table
# Of a view's points others look through so many, or it through theirs: with right poses up to 16 %, 25 with twice the noise; of one
# that is off by 20 mm 71 % and more. Of few points that is chance.
THROUGH_M, ASTRAY, FEW = 0.010, 0.6, 30
MOST_ASTRAY = 0.2  # of the views
HELD = np.diag(HOLD + [HOLD_GIVEN_TURN, 0.0, 0.0])


def off(seen_by: Planes, place: Placement, rng: np.random.Generator) -> tuple[float, np.ndarray]:
    """Return how far poses are off along the table, at the object, and which (V,) are astray: by about `NEAR_M` or more.

    How far is the root mean square over views that are not astray, as the points of those find nothing near enough to say.
    Where more than a fifth would be, it is no single ones, and they count as `NEAR_M`. Right poses are off by 0.08 to 0.17 mm; an
    axis or views that are off by 1 mm, by 0.6 to 1.5.
    """
    n = len(seen_by.view)
    points, normals, view = _sampled(seen_by, place, rng)
    is_asked, met, seen, through = _asked(n, rng), [], np.zeros(n), np.zeros(n)
    for j in range(n):
        of = np.flatnonzero(is_asked[view, j])
        apart_m, is_found, is_through, facing = _met(seen_by, j, points[of], normals[of])
        for total, is_counted in ((through, is_through), (seen, is_through | is_found)):
            total += np.bincount(view[of[is_counted]], minlength=n)
            total[j] += np.count_nonzero(is_counted)
        found = of[is_found]
        met.append((view[found], apart_m[is_found], motions(points[found], facing[is_found])))
    counts = np.bincount(view, minlength=n)
    turn, dx, dy = _steps(met, counts)[view].T
    moved = (dx - turn * points[:, 1]) ** 2 + (dy + turn * points[:, 0]) ** 2
    squares = np.bincount(view, moved, n) / np.maximum(counts, 1)
    is_astray = (through > ASTRAY * seen) & (seen > FEW)
    if is_astray.mean() > MOST_ASTRAY:
        squares[is_astray], is_astray = np.maximum(squares[is_astray], NEAR_M**2), np.zeros(n, bool)
    telling = (seen > 0) & ~is_astray
    return float(np.sqrt(squares[telling].mean())) if telling.any() else 0.0, is_astray


def _asked(n: int, rng: np.random.Generator) -> np.ndarray:
    """Return in which other views (n, n) the points of each are looked for."""
    chosen = np.argsort(rng.random((n, n)) + np.eye(n), axis=1)[:, : min(OTHERS, n - 1)]
    is_asked = np.zeros((n, n), bool)
    np.put_along_axis(is_asked, chosen, values=True, axis=1)
    return is_asked


def _steps(met: list[tuple[np.ndarray, np.ndarray, np.ndarray]], counts: np.ndarray) -> np.ndarray:
    """Return turn and shift (V, 3) of each view, of `counts` points, that bring points to where they are met.

    met: for each view, of the points that it meets, the view that they are from, their ways (M,) and motions (M, 3). A way is what
    the points' view and the one that meets them move relative to each other.
    """
    n = len(met)
    left, right = np.zeros((n, 3, n, 3)), np.zeros((n, 3))
    left[np.arange(n), :, np.arange(n)] = HELD * (counts + 1)[:, None, None]
    for j, (own, apart_m, motion) in enumerate(met):
        weighted = motion / (1 + (apart_m / ROBUST_M) ** 2)[:, None]
        pull = _by_view(own, weighted * apart_m[:, None], n)
        square = _by_view(own, (weighted[:, :, None] * motion[:, None]).reshape(-1, 9), n).reshape(n, 3, 3)
        right += pull
        right[j] -= pull.sum(axis=0)
        left[np.arange(n), :, np.arange(n)] += square
        left[j, :, j] += square.sum(axis=0)
        left[:, :, j] -= square
        left[j] -= square.transpose(1, 0, 2)
    return np.linalg.solve(left.reshape(3 * n, 3 * n), right.ravel()).reshape(n, 3)


def _by_view(view: np.ndarray, values: np.ndarray, n: int) -> np.ndarray:
    """Return the sums (n, K) of the values (N, K) of each view."""
    return np.stack([np.bincount(view, column, n) for column in values.T], axis=1)


def _sampled(
    seen_by: Planes, place: Placement, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return some points (N, 3) of the object, their normals (N, 3), and the view (N,) that each is from."""
    some = [_of_view(seen_by, i, place, rng) for i in range(len(seen_by.view))]
    points, normals = (np.concatenate(parts) for parts in zip(*some, strict=True))
    return points, normals, np.repeat(np.arange(len(some)), [len(points) for points, _ in some])


def _of_view(
    seen_by: Planes, i: int, place: Placement, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    first, width, height = seen_by.view[i]
    plane = seen_by.plane[first : first + width * height]
    known = np.flatnonzero(plane[:, 4] > LEAST_FACING)
    known = known[rng.integers(len(known), size=8 * SAMPLES)] if len(known) else known
    v, u = np.divmod(known, width)
    plane = plane[known].astype(float)
    ray = np.linalg.solve(seen_by.projection[i][:, :3], np.stack([u, v, np.ones(len(u))])).T
    reach = _reach(plane, ray, seen_by.eye[i])
    places = seen_by.eye[i] + reach[:, None] * ray
    is_own = (places[:, 2] > ABOVE_M) & (places[:, 2] < place.bounds_m[1, 2])
    own = np.flatnonzero(is_own & place.covers(places[:, 0], places[:, 1]))[:SAMPLES]
    return places[own], plane[own, :3]


def _met(
    seen_by: Planes, j: int, points: np.ndarray, normals: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return the ways (N,) of points (N, 3) to view j's planes where they appear, which planes are of the same place, which are
    behind it, and their normals (N, 3)."""
    first, width, height = seen_by.view[j]
    x, y, z = seen_by.projection[j] @ np.column_stack([points, np.ones(len(points))]).T
    u, v = np.rint(np.stack([x, y]) / z).astype(int)
    inside = (z > 0) & (u >= 0) & (v >= 0) & (u < width) & (v < height)
    plane = seen_by.plane[first + np.where(inside, v * width + u, 0)].astype(float)
    facing, cosine = plane[:, :3], np.where(inside, plane[:, 4], 0.0)
    apart_m = plane[:, 3] - np.einsum("nc,nc->n", facing, points)
    is_same = (np.abs(apart_m) < NEAR_M) & (np.einsum("nc,nc->n", facing, normals) > ALIKE)
    ray = points - seen_by.eye[j]
    behind_m = (_reach(plane, ray, seen_by.eye[j]) - 1) * np.linalg.norm(ray, axis=1)
    return apart_m, is_same & (cosine > LEAST_FACING), (cosine > 0) & (behind_m > THROUGH_M), facing


def _reach(plane: np.ndarray, ray: np.ndarray, eye: np.ndarray) -> np.ndarray:
    """Return how many times its length each ray (N, 3) goes from the eye (3,) to its plane (N, 5), which faces it."""
    towards = np.einsum("nc,nc->n", plane[:, :3], ray)
    return (plane[:, 3] - plane[:, :3] @ eye) / np.minimum(towards, -1e-9)
