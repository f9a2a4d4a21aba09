"""Upright views turned and shifted on the table until they fit the others.

Turns are searched all round, so that neither an order of the views nor an overlap of neighbours is needed. A fit counts
what a view measures (places, normals, colours: nearest neighbours in all three) and what it looks through.
"""

from dataclasses import replace

import numpy as np
from scipy.spatial import cKDTree

from pipeline.command import progress
from pipeline.fuse.evidence import Evidence, nearest
from pipeline.fuse.levelled import NORMAL_M, Levelled
from pipeline.fuse.raw import Views
from pipeline.fuse.together import ALIKE, HOLD, ROBUST_M, motions, moved, turn_rad
from pipeline.geometry import frames

TURNS, REFINED = 72, 6
CAP_M = 0.010  # a point further than this from all others fits nothing
EDGE_M, SURE_EDGE_M = (
    0.006,
    0.009,
)  # to either side of a pixel: to choose a turn, and to say that it can be told
AS_GOOD = 0.01  # turns that so few points more contradict may as well be right
APART = 0.05  # one less the cosine between directions, of cameras that show something else
SAME_CAMERA = 0.02  # of its height in metres and the sines of its tilt
ALONG = 0.1  # weight of distances along the surface
TURNS_BY_COLOUR_RAD = (0.04, 0.02, 0.01)
COARSE, FINE, MODEL, MOST_MODEL = 300, 1200, 1500, 15_000  # points
ITERATIONS, SWEEPS = 12, 10
WITNESSES = 8  # views that are asked whether they look through another's points
MISFIT = 0.03  # weight of distances beside that of contradictions


def placed(stood: list[Levelled], views: Views, rng: np.random.Generator) -> tuple[list[np.ndarray], float]:
    """Return T_world_level of each view: one after the other against all before it, then again against all others.

    And how well turns are told apart: the share of points that the worst turn contradicts, in the middle of the views.
    """
    cameras = list(zip(views.depths_m, views.intrinsics, strict=True))
    near, sure = ([nearest(depth, K, edge) for depth, K in cameras] for edge in (EDGE_M, SURE_EDGE_M))
    poses, told = [np.eye(4)], np.zeros(len(stood))
    turns = [*range(1, len(stood)), *range(1, len(stood))]
    for k in progress(turns, len(turns), f"finding poses of {len(stood)} views: fits"):
        others = np.array([j for j in range(len(poses)) if j != k])
        asked = rng.choice(others, size=min(len(others), WITNESSES), replace=False)
        witnesses = [(stood[j].number, frames.inverse(poses[j] @ stood[j].T_level_camera)) for j in asked]
        share = max(COARSE, MOST_MODEL // len(others))
        model = np.concatenate([_some(stood[j], share, rng).features(poses[j]) for j in others])
        known = _known_turn(stood, poses, k, views.options.turntable_deg)
        contrasts = {view.number: view.contrasts for view in stood}
        evidence, certain = (
            Evidence(views.depths_m, images, views.intrinsics, witnesses, contrasts)
            for images in (near, sure)
        )
        eyes = np.stack([(poses[j] @ stood[j].T_level_camera)[:3, 3] for j in others])
        pose, told[k] = _best(stood[k], known, model, evidence, certain, eyes, rng)
        poses = [*poses[:k], pose, *poses[k + 1 :]]
    return poses, float(np.median(told[1:]))


def _known_turn(
    stood: list[Levelled], poses: list[np.ndarray], k: int, angles_deg: tuple[float, ...] | None
) -> float | None:
    """Return the turn of the k-th view by the turntable's angle since a view placed before, of a camera that stands alike.

    Angles count anticlockwise, seen from above. None where there are no angles or no such view.
    """
    if angles_deg is None:
        return None
    for j in range(len(poses)):
        moved = np.abs(stood[j].T_level_camera[2] - stood[k].T_level_camera[2]).max()
        if j != k and moved < SAME_CAMERA:
            turned = angles_deg[stood[k].number] - angles_deg[stood[j].number]
            return turn_rad(poses[j]) - float(np.radians(turned))
    return None


def _best(
    view: Levelled,
    known: float | None,
    model: np.ndarray,
    evidence: Evidence,
    sure: Evidence,
    eyes: np.ndarray,
    rng: np.random.Generator,
) -> tuple[np.ndarray, float]:
    """Return T_world_level that fits a view best to the model (M, 7), and how well the evidence tells turns apart.

    What counts is what contradicts: parts that only one of them saw are no evidence. Of turns that are as good, such as the
    quarter turns of a square, it is the one that looks from where the fewest of the other cameras (N, 3) do.
    """
    coarse, fine = (_some(view, n, rng) for n in (COARSE, FINE))
    probe = model[rng.integers(len(model), size=MODEL)]
    turned = [_turn(2 * np.pi * i / TURNS) for i in range(TURNS)]
    costs = np.array([evidence.against(coarse, T, probe) for T in turned])
    lower = (costs <= np.roll(costs, 1)) & (costs <= np.roll(costs, -1))
    starts = [turned[i] for i in sorted(np.nonzero(lower)[0], key=lambda i: costs[i])[:REFINED]]
    tree = cKDTree(model)
    ends = [_icp(fine, T, tree, ITERATIONS) for T in (starts if known is None else [_turn(known)])]
    against = [evidence.against(fine, T, probe) + MISFIT * _misfit(fine, T, tree) for T in ends]
    most = min(against) + (AS_GOOD if view.contrasts is None else 0.0)  # paint tells them apart
    as_good = [T for T, cost in zip(ends, against, strict=True) if cost <= most]
    best = min(as_good, key=lambda T: _crowded((T @ view.T_level_camera)[:3, 3], eyes))
    return best, float(np.ptp([sure.against(coarse, T, probe) for T in turned]))


def _crowded(eye: np.ndarray, others: np.ndarray) -> float:
    """Return how many of the other cameras (N, 3) look from about the direction of a camera (3,)."""
    cosine = others @ eye / (np.linalg.norm(others, axis=1) * np.linalg.norm(eye))
    return float(np.exp((cosine - 1.0) / APART).sum())


def _some(view: Levelled, n: int, rng: np.random.Generator) -> Levelled:
    index = rng.choice(len(view.points_m), size=min(n, len(view.points_m)), replace=False)
    return replace(
        view, points_m=view.points_m[index], normals=view.normals[index], contrast=view.contrast[index]
    )


def _turn(angle_rad: float) -> np.ndarray:
    return moved(angle_rad, 0.0, 0.0)


def _misfit(view: Levelled, T: np.ndarray, tree: cKDTree) -> float:
    """Return the mean squared distance of a view's features to the model's, in parts of `CAP_M`, each at most one."""
    distance, _ = tree.query(view.features(T), distance_upper_bound=CAP_M)
    return float(np.mean(np.minimum(distance / CAP_M, 1.0) ** 2))


def _icp(view: Levelled, T: np.ndarray, tree: cKDTree, iterations: int, hold_turn: float = 0.0) -> np.ndarray:
    """Return T after steps towards the nearest features of the model; hold_turn: how much, a point, its turn is held to none."""
    for _ in range(iterations):
        features = view.features(T)
        distance, index = tree.query(features, distance_upper_bound=CAP_M)
        near = distance < CAP_M
        here, there = features[near], tree.data[index[near]]
        # A handle's left half, seen by one view, is not its right half, seen by another.
        alike = np.einsum("nc,nc->n", here[:, 3:6], there[:, 3:6]) > ALIKE * NORMAL_M**2
        planes = there[alike, :3], there[alike, 3:6] / NORMAL_M
        step = _fitting_step(here[alike, :3], *planes, hold_turn, turn_rad(T))
        T = step @ T
        if np.abs(step - np.eye(4)).max() < 1e-5:
            break
    return T if view.contrasts is None else _turned_by_colour(view, T, tree)


def _turned_by_colour(view: Levelled, T: np.ndarray, tree: cKDTree) -> np.ndarray:
    """Return T turned about the view's axis to where its colours fit best: planes of a round object do not tell turns."""
    cost = _misfit(view, T, tree)
    for angle_rad in TURNS_BY_COLOUR_RAD:
        for turned in (T @ _turn(angle_rad), T @ _turn(-angle_rad)):
            if (other := _misfit(view, turned, tree)) < cost:
                T, cost = turned, other
    return T


def _fitting_step(
    here: np.ndarray, there: np.ndarray, normals: np.ndarray, hold_turn: float, turned_rad: float
) -> np.ndarray:
    """Return the small turn about z and shift across it that bring points (N, 3) into planes (Chen & Medioni 1991).

    The planes pass through `there` (N, 3) with unit normals (N, 3); turned_rad: by how much the view is turned already.
    """
    if len(here) < 20:
        return np.eye(4)
    A = motions(here, normals)
    b = np.einsum("nc,nc->n", normals, there - here)
    w = 1 / (1 + (b / ROBUST_M) ** 2)
    normal = np.einsum("n,ni,nj->ij", w, A, A) + np.diag(HOLD) * len(b)
    right = np.einsum("n,ni,n->i", w, A, b)
    # The pairs hold themselves a little, for the shift alone: of a rim seen from above no plane stands across.
    normal[[1, 2], [1, 2]] += ALONG * w.sum()
    normal[0, 0] += hold_turn * len(b)
    right[0] -= hold_turn * len(b) * turned_rad
    right[1:] += ALONG * np.einsum("n,nc->c", w, (there - here)[:, :2])
    return moved(*np.linalg.solve(normal, right))


def swept(
    stood: list[Levelled], poses: list[np.ndarray], rng: np.random.Generator, hold_turn: float = 0.0
) -> list[np.ndarray]:
    """Return the poses after every view was fitted to those of the other half, again and again.

    hold_turn: how much, a point, each view's turn is held to none.
    """
    poses = list(poses)
    fine = [_some(view, FINE, rng) for view in stood]
    for sweep in range(2 * SWEEPS):
        half = rng.permutation(len(stood)) % 2 == sweep % 2
        tree = cKDTree(np.concatenate([fine[k].features(poses[k]) for k in np.nonzero(half)[0]]))
        for k in np.nonzero(~half)[0]:
            poses[k] = _icp(fine[k], poses[k], tree, 3, hold_turn)
    return poses
