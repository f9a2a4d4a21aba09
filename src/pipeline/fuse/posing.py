"""Given poses that are a little off, as markers and calibrated arms leave them: how far, and refined on table and object."""

from contextlib import suppress
from dataclasses import replace

import numpy as np
from scipy.optimize import least_squares

from pipeline.errors import PipelineError
from pipeline.fuse import levelled, placement, registration, table, turning
from pipeline.fuse.raw import Views
from pipeline.fuse.table import Placement, Plane
from pipeline.fuse.together import HOLD_GIVEN_TURN
from pipeline.geometry import frames

# Right poses are off by 0.05 to 0.15 mm, by 0.3 in images of 512 pixels across 90°; by 0.9 mm the inside of a mug is lost.
OFF_M = 0.00035
# Right poses of cameras a metre away are off by 0.55 mm, of such at 1.5 m by 0.8 to 1.6, and by as much once they are refined:
# up to this share of the spread of depth that is its noise. Of poses that were wrong a seventh is left, in scans from 0.6 m.
NOISE_SHARE, NO_NEARER = 0.5, 0.85
MEDIUM, FINE = 6, 3  # pixels
AROUND_M, NEAR_M = 0.06, 0.015  # the object, and the plane: what counts as the table there
ALIKE_M = 0.003  # around the median height in a view; beyond it is a board's edge or clutter
LEAST_POINTS = 30
# A pose is off by less at the object. Where more makes the views fit, they show too little of table and object to tell.
MOST_M = 0.015
ROUNDS, ROBUST_M = 5, 0.003
LEAST_WAY = 0.3  # a way of 5 mm that noise of 1.5 mm does not tell is none
# What speaks for the given tilt: so many square metres of points, spread about their mean. A strip of table tells no tilt.
HELD_M2 = 0.05


def off_m(views: Views, place: Placement) -> float:
    """Return how far the poses are off by the heights of the table around the object: root mean square over the views."""
    points, view = ground(views, place, MEDIUM)
    shown = [points[view == i, 2] for i in range(len(views.depths_m))]
    heights_m = [float(z[np.abs(z - np.median(z)) < ALIKE_M].mean()) for z in shown if len(z) >= LEAST_POINTS]
    return float(np.sqrt(np.mean(np.square(heights_m)))) if heights_m else 0.0


def refined(
    views: Views, place: Placement, name: str, rng: np.random.Generator
) -> tuple[Views, list[str]] | None:
    """Return the views, each stood upright on the table that it shows, then all fitted to each other and to their fused surface.

    And the names of those that do not show the object, which are left out. Turns that nothing determines stay as given. None where
    the views do not tell how their poses are off.
    """
    points, view = ground(views, place, FINE)
    stood = []
    for i, T_world_camera in enumerate(views.T_world_cameras):
        T_level_world = _upright(points[view == i]) @ place.T_object_world
        there = replace(place, T_object_world=T_level_world @ T_world_camera)
        with suppress(PipelineError):  # a view that does not show the object is left out
            stood.append(levelled.shown(views, i, there, name))
    if len(stood) < registration.LEAST_VIEWS:
        return None
    poses = turning.swept(stood, [np.eye(4)] * len(stood), rng, HOLD_GIVEN_TURN)
    known = replace(place, T_object_world=np.eye(4))
    poses, _ = registration.fitted_to_surface(stood, poses, views, name, rng, known)
    posed = registration.posed(views, stood, poses)
    T_world_object = frames.inverse(place.T_object_world)
    posed = replace(posed, T_world_cameras=[T_world_object @ T for T in posed.T_world_cameras])
    if _moved_m(views, posed, place) > MOST_M:
        return None
    return posed, [kept for kept in views.names if kept not in posed.names]


def _moved_m(views: Views, posed: Views, place: Placement) -> float:
    """Return how far the object is from where it was for the middle one of the views, in the mean over its box's corners."""
    given = dict(zip(views.names, views.T_world_cameras, strict=True))
    corners = np.stack(np.meshgrid(*place.bounds_m.T), axis=-1).reshape(-1, 3)
    corners = frames.apply(frames.inverse(place.T_object_world), corners)
    moves = [
        frames.apply(T @ frames.inverse(given[each]), corners) - corners
        for each, T in zip(posed.names, posed.T_world_cameras, strict=True)
    ]
    return float(np.median(np.linalg.norm(moves, axis=2).mean(axis=1)))


def too_long(given: Views, posed: Views) -> float:
    """Return by which share depths are too long if the way that all cameras went back along their axes is no error of their poses.

    That way is told apart from a shift of all together, and from one across the axes; of one ring of cameras, where neither tells,
    0.6 to 0.9 of it are found. A few that were astray count little.
    """
    before = dict(zip(given.names, given.T_world_cameras, strict=True))
    ways = [
        T[:3, 3] - before[each][:3, 3] for each, T in zip(posed.names, posed.T_world_cameras, strict=True)
    ]
    terms = np.concatenate(
        [*(np.hstack([np.eye(3), T[:3, :3]]) for T in posed.T_world_cameras), LEAST_WAY * np.eye(6)]
    )
    wanted = np.concatenate([*ways, np.zeros(6)])
    first = np.linalg.lstsq(terms, wanted, rcond=None)[0]
    fit = least_squares(lambda way: terms @ way - wanted, first, loss="cauchy", f_scale=ROBUST_M)
    along_m = fit.x[5]
    middles_m = np.stack([T[:3, 3] for T in posed.T_world_cameras]) - table.focus(posed)
    return -float(along_m / np.median(np.linalg.norm(middles_m, axis=1)))


def shown_again(views: Views, place: Placement) -> Placement:
    """Return where the object stands, as before, with the points that the refined views show there."""
    x, y, z = places = _about(views, place, placement.stride(views, table.focus(views)))[0].T
    own = (z > placement.ABOVE_M) & (z < place.bounds_m[1, 2]) & place.covers(x, y)
    return replace(place, points_m=places.T[own])


def ground(views: Views, place: Placement, stride: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the points (N, 3) of what the object stands on, around it, its frame, and the view (N,) that each is from."""
    places, own = _about(views, place, stride)
    x, y, z = places.T
    near = np.flatnonzero(place.beside(x, y, AROUND_M) & (np.abs(z) < NEAR_M))
    if len(near):  # what is elsewhere by all views is beside a board, or clutter
        near = near[np.abs(table.local_heights(x[near], y[near], z[near])) < ALIKE_M]
    return places[near], own[near]


def _about(views: Views, place: Placement, stride: int) -> tuple[np.ndarray, np.ndarray]:
    """Return points (N, 3) of the object and around it, its frame, and the view (N,) that each is from."""
    low, high = place.bounds_m + [[-AROUND_M], [AROUND_M]]
    middle = frames.apply(frames.inverse(place.T_object_world), (low + high) / 2)
    points = table.world_points(views, stride, middle, float(np.linalg.norm(high - low)))
    return frames.apply(place.T_object_world, points.places_m), points.view


def _upright(table_m: np.ndarray) -> np.ndarray:
    """Return the transform that takes one view's points (N, 3) of the table to z = 0; few points change nothing."""
    if len(table_m) < LEAST_POINTS:
        return np.eye(4)
    terms = np.column_stack([table_m[:, :2], np.ones(len(table_m))])
    held, plane = np.diag([HELD_M2, HELD_M2, 0.0]), np.array([0.0, 0.0, np.median(table_m[:, 2])])
    for _ in range(ROUNDS):
        weight = 1 / (1 + ((table_m[:, 2] - terms @ plane) / ROBUST_M) ** 2)
        middle = np.einsum("n,nc->c", weight, table_m[:, :2]) / weight.sum()  # not `@`, as in `table`
        about = terms - [*middle, 0.0]
        matrix = np.einsum("n,ni,nj->ij", weight, about, about) + held
        a, b, height = np.linalg.solve(matrix, np.einsum("n,ni,n->i", weight, about, table_m[:, 2]))
        plane = np.array([a, b, height - a * middle[0] - b * middle[1]])
    length = np.sqrt(plane[0] ** 2 + plane[1] ** 2 + 1.0)
    normal = np.array([-plane[0], -plane[1], 1.0]) / length
    return placement.table_frame(Plane(normal, -plane[2] / length, 0.0))
