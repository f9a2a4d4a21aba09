"""Coarse alignment by parts, and scaling by variances (section II-B, first stage)."""

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from pipeline.errors import PipelineError
from pipeline.geometry import frames

UPRIGHT_MAX_RAD = np.radians(30.0)
HANDLE_MIN_SHARE = 0.02
RING_COVERAGE_BINS = 36


@dataclass(frozen=True)
class PartFrame:
    """An object's part frame: origin at the mean of the container, first axis to the rim, second to the handle.

    `T_object_part` is 4×4, metres. `spread_m` (3,) is the standard deviation of the container along its axes.
    """

    T_object_part: np.ndarray
    spread_m: np.ndarray
    roll_observable: bool


def part_frame(points_m: np.ndarray, parts: np.ndarray, *, name: str) -> PartFrame:
    """Return the part frame of an upright object with points (N, 3) and labels container, rim, handle (N, 3 bool).

    Raises PipelineError when no rim is found, or when the rim is not on top of the container.
    """
    container = points_m[parts[:, 0]]
    if len(container) < 100:
        raise PipelineError(
            f"{name}: expected a container, but only {len(container)} of its points look like one"
        )
    origin = container.mean(axis=0)
    first = _first_axis(_rim_ring(points_m, parts[:, 1], name=name).mean(axis=0) - origin, name=name)
    handle = _handle(points_m, parts[:, 2], origin)
    second = np.array([1.0, 0.0, 0.0]) if handle is None else handle - origin
    second = second - first * (second @ first)
    second = second / np.linalg.norm(second)
    rotation = np.column_stack([first, second, np.cross(first, second)])
    spread = ((container - origin) @ rotation).std(axis=0)
    return PartFrame(frames.transform(rotation, origin), spread, handle is not None)


def scale(source: PartFrame, target: PartFrame) -> np.ndarray:
    """Return the factors (3,) along the part axes that give the source's container the target's variances."""
    return target.spread_m / source.spread_m


def _first_axis(to_rim: np.ndarray, *, name: str) -> np.ndarray:
    """Return +z where the direction to the rim agrees: the table knows it better than the initial labels do."""
    tilt = np.arccos(to_rim[2] / np.linalg.norm(to_rim))
    if tilt > UPRIGHT_MAX_RAD:
        raise PipelineError(
            f"{name}: expected an upright container, but its rim lies {np.degrees(tilt):.0f}° from the top "
            "(upside down or lying?); scan it standing on its base, or give `up` in its scan.yaml"
        )
    return np.array([0.0, 0.0, 1.0])


def _rim_ring(points_m: np.ndarray, rim: np.ndarray, *, name: str) -> np.ndarray:
    """Return the points of the candidate ring that goes round most of an opening that is open.

    Edges of a base look like rims to local features; but across a base there is a surface.
    """
    rings = [ring for ring in _components(points_m, rim) if len(ring) >= 30]
    scores = [_ring_score(points_m, ring) for ring in rings]
    if not scores or max(scores) <= 0.0:
        raise PipelineError(
            f"{name}: expected a rim around an opening, but no ring of its points looks like one"
        )
    return rings[int(np.argmax(scores))]


def _ring_score(points_m: np.ndarray, ring_m: np.ndarray) -> float:
    """Return coverage × radius of a ring about the vertical through its mean; 0 where a surface closes it."""
    centre = ring_m.mean(axis=0)
    radius = np.linalg.norm((ring_m - centre)[:, :2], axis=1).mean()
    azimuth = np.arctan2(*(ring_m - centre)[:, 1::-1].T)
    bins = np.floor((azimuth + np.pi) / (2 * np.pi) * RING_COVERAGE_BINS).astype(int)
    coverage = len(np.unique(bins)) / RING_COVERAGE_BINS
    offset = points_m - centre
    across = (np.linalg.norm(offset[:, :2], axis=1) < 0.5 * radius) & (np.abs(offset[:, 2]) < 0.15 * radius)
    return 0.0 if across.any() else coverage * radius


def _handle(points_m: np.ndarray, handle: np.ndarray, origin_m: np.ndarray) -> np.ndarray | None:
    """Return the mean of the largest handle candidate, None where there is none worth the name."""
    components = _components(points_m, handle)
    if not components or len(components[0]) < HANDLE_MIN_SHARE * len(points_m):
        return None
    return components[0].mean(axis=0)


def _components(points_m: np.ndarray, chosen: np.ndarray) -> list[np.ndarray]:
    """Return the chosen points as connected components, largest first; linked over twice the distance to a sixth neighbour."""
    subset = points_m[chosen]
    if len(subset) == 0:
        return []
    link_m = 2.0 * np.median(cKDTree(points_m).query(points_m, k=7)[0][:, 6])
    pairs = cKDTree(subset).query_pairs(link_m, output_type="ndarray")
    graph = coo_matrix((np.ones(len(pairs)), pairs.T), shape=(len(subset), len(subset)))
    count, label = connected_components(graph, directed=False)
    order = np.argsort(-np.bincount(label, minlength=count), kind="stable")
    return [subset[label == component] for component in order]
