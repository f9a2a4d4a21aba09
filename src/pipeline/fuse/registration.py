"""Views without poses: stood upright by the table in each, turned and shifted on it, then fitted to their fused surface."""

from contextlib import suppress
from dataclasses import replace
from typing import Any

import numpy as np

from pipeline.errors import PipelineError
from pipeline.fuse import placement, tsdf, turning
from pipeline.fuse.evidence import unlike_by_chance
from pipeline.fuse.levelled import Levelled, axis_of, level, raised_m
from pipeline.fuse.raw import Views
from pipeline.fuse.smoothing import vertex_normals
from pipeline.fuse.table import Placement
from pipeline.fuse.together import HOLD_GIVEN_TURN, fitted_together, moved
from pipeline.geometry import frames
from pipeline.geometry.surface import Surface

FIRST_STEEPNESS = 0.85  # sine of the elevation of the view that the others are fitted to
TOLD = 0.03  # of the points must contradict a wrong turn
GOLDEN = 0.381966  # of a whole turn
LEAST_VIEWS = 6
VOXEL_M, ROUNDS = 0.002, 3  # of the fit to the fused surface
MOST_LEFT_OUT = 0.2
LEAST_RAISED_M = 0.006  # lower than this is a board that each view may or may not show
# Of the points of round objects 0.3 % are further than that from their surface, of bowls with beads on the rim as well; 2.5 % where
# it lacks a handle of 14 mm.
BEYOND_M, MOST_BEYOND = 0.005, 0.01
# Of what a surface of revolution lacks, the right turns lack nothing; one view of twelve that is turned the wrong way leaves 8 %.
MOST_LEFT = 0.05
MOST_WIDER = 3.0  # a pan is twice as wide where its handle is seen
# Of pairs of points are unlike: where fewer are, it is shade, gloss and the camera's noise.
LEAST_PAINT = 0.15


def registered(views: Views, name: str, rng: np.random.Generator) -> tuple[Views, dict[str, Any]]:
    """Return the views with poses T_world_camera, and what fusion.json says of how they were found.

    The world is that of a steep view: z up from the table. A `PipelineError` says what views lack, or that they do not fit
    together.
    """
    if len(views.depths_m) < LEAST_VIEWS:
        raise PipelineError(
            f"{name}: expected at least {LEAST_VIEWS} views where there are no poses, found {len(views.depths_m)}; record more, or "
            "add their poses"
        )
    stood, left_out = levelled_all(views, name, rng)
    if views.colours and not _is_painted(stood):
        views, stood = replace(views, colours=[]), [_without_colours(view) for view in stood]
    poses, told = turning.placed(stood, views, rng)
    if views.colours:  # which the surface does not have
        poses = turning.swept(stood, poses, rng)
    poses, is_told = _fitted(stood, poses, told, views, name, rng)
    facts = {"views_without_object": left_out, "roll_observable": is_told, "roll_evidence": told}
    facts["turns_given"] = views.options.turntable_deg is not None
    return posed(views, stood, poses), facts


def _fitted(
    stood: list[Levelled],
    poses: list[np.ndarray],
    told: float,
    views: Views,
    name: str,
    rng: np.random.Generator,
) -> tuple[list[np.ndarray], bool]:
    """Return the poses fitted to the fused surface, and whether the views' turns are told, by the evidence or by what sticks out.

    A small handle contradicts too few points of a wrong turn; but a surface of revolution lacks it. Where there is none of it the
    turns are as found if hardly anything is off the surface that they make.
    """
    if told >= TOLD:
        return fitted_to_surface(stood, poses, views, name, rng)[0], True
    known = views.options.turntable_deg is not None
    lacking, most = 0.0, MOST_BEYOND if known else MOST_LEFT * MOST_BEYOND
    if not known:
        with suppress(PipelineError):  # a handle that is turned all round may be a second object, or nothing
            turned, surface = fitted_to_surface(stood, _all_round(stood, poses), views, name, rng)
            if (lacking := _beyond(stood, turned, surface)) < MOST_BEYOND:
                return turned, False
            most = MOST_LEFT * lacking
    found, surface = fitted_to_surface(stood, poses, views, name, rng)
    if (beyond := _beyond(stood, found, surface)) < most:
        return found, not known
    cure = "correct `turntable_deg:` in scan.yaml" if known else "write `turntable_deg:` into scan.yaml"
    raise PipelineError(
        f"{name}: expected a round object where turns of the views cannot be told, found {max(lacking, beyond):.1%} of what they "
        f"show more than {BEYOND_M * 1e3:g} mm off one, as a small handle is, or views that do not fit; add poses, {cure}, or go "
        "nearer"
    )


def _beyond(stood: list[Levelled], poses: list[np.ndarray], surface: Surface) -> float:
    """Return the share of the views' points that are not on their fused surface, in the mean over the views."""
    own = [frames.apply(T, view.points_m) for view, T in zip(stood, poses, strict=True)]
    return float(np.mean([(surface.distance(points) > BEYOND_M).mean() for points in own]))


def _all_round(stood: list[Levelled], poses: list[np.ndarray]) -> list[np.ndarray]:
    """Return the poses of views of a round object, turned about its axis so that they come from all sides.

    Where no view tells turns apart, each is as right from any side, and together they show the whole surface of revolution.
    """
    features = np.concatenate([view.features(T) for view, T in zip(stood, poses, strict=True)])
    normals = features[:, 3:6] / np.maximum(np.linalg.norm(features[:, 3:6], axis=1, keepdims=True), 1e-12)
    shift = frames.transform(np.eye(3), np.array([*-axis_of(features[:, :3], normals), 0.0]))
    turned = []
    for k, (view, T) in enumerate(zip(stood, poses, strict=True)):
        x, y, _ = (shift @ T @ view.T_level_camera)[:3, 3]
        turn = moved(2 * np.pi * GOLDEN * k - np.arctan2(y, x), 0.0, 0.0)
        turned.append(frames.inverse(shift) @ turn @ shift @ T)
    return turned


def levelled_all(views: Views, name: str, rng: np.random.Generator) -> tuple[list[Levelled], list[str]]:
    """Return the views that show table and object; those that see a handle or a corner first, as they tell turns apart."""
    stood, failures = [], {}
    for i in range(len(views.depths_m)):
        try:
            stood.append(level(views, i, name, rng))
        except PipelineError as failure:
            failures[views.names[i]] = failure
    stood = _as_high(stood, failures, views, name, rng)
    if len(failures) > MOST_LEFT_OUT * len(views.depths_m):
        raise next(iter(failures.values()))
    check_alike(stood, views.names, name)
    return sorted(
        stood, key=lambda view: (-round(view.lopsided_m / 0.005), abs(view.steepness - FIRST_STEEPNESS))
    ), list(failures)


def _as_high(
    stood: list[Levelled],
    failures: dict[str, PipelineError],
    views: Views,
    name: str,
    rng: np.random.Generator,
) -> list[Levelled]:
    """Return the views with the object as high above the table as in most: grazing ones do not show a turntable's top.

    Those that then show no object join the failures.
    """
    heights_m = np.array([raised_m(views, view) for view in stood])
    tops_m = np.array([view.points_m[:, 2].max() for view in stood])
    usual_m = float(np.median(heights_m)) if len(stood) else 0.0
    if usual_m < LEAST_RAISED_M:
        return stood
    right = heights_m >= usual_m / 2
    # Others either stand too low, or see nothing lower than the base: their object is as tall as it is.
    too_low = ~right & (tops_m > np.median(tops_m[right]) + usual_m / 2)
    alike = []
    for view, is_low in zip(stood, too_low, strict=True):
        try:
            alike.append(level(views, view.number, name, rng, usual_m) if is_low else view)
        except PipelineError as failure:
            failures[views.names[view.number]] = failure
    return alike


def check_alike(stood: list[Levelled], names: list[str], name: str) -> None:
    """Refuse views that show things of such different widths that some must show the object with its turntable."""
    widths_m = np.array([np.ptp(view.points_m[:, :2], axis=0).max() for view in stood])
    order = np.argsort(widths_m)
    odd = max(1, len(order) // 10)
    narrow, wide = order[odd], order[-1 - odd]
    least, most = (f"{1e3 * widths_m[k]:.0f} mm in {names[stood[k].number]}" for k in (narrow, wide))
    if widths_m[wide] > MOST_WIDER * widths_m[narrow]:
        raise PipelineError(
            f"{name}: expected the same object in all views, found one as wide as {least} and one as wide as {most}, as with the "
            "turntable under it; put it on a table without one, or add poses"
        )


def _is_painted(stood: list[Levelled]) -> bool:
    """Return whether the middle one of the views shows paint, by which turns are told; a plain cup's shade tells wrong ones."""
    return float(np.median([unlike_by_chance(view.contrast) for view in stood])) > LEAST_PAINT


def _without_colours(view: Levelled) -> Levelled:
    return replace(view, contrast=np.zeros(len(view.points_m)), contrasts=None)


def fitted_to_surface(
    stood: list[Levelled],
    poses: list[np.ndarray],
    views: Views,
    name: str,
    rng: np.random.Generator,
    known: Placement | None = None,
) -> tuple[list[np.ndarray], Surface]:
    """Return the poses after views were fused and fitted to the surface, again and again, and the last surface.

    The surface is the mean of all views, so its normals and edges are better than those of any one. known: where the object
    stands in the level frames, when that is known, as it is with given poses: their turns are then held.
    """
    hold_turn = 0.0 if known is None else HOLD_GIVEN_TURN
    for _ in range(ROUNDS):
        shown = posed(views, stood, poses)
        if known is None:
            _, place = placement.find(shown, name, rng)
        else:
            own = [frames.apply(T, view.points_m) for view, T in zip(stood, poses, strict=True)]
            place = replace(known, points_m=np.concatenate(own))
        surface = tsdf.fuse(shown, place, VOXEL_M, 2 * VOXEL_M, name)
        T_world_object = frames.inverse(place.T_object_world)
        normals = frames.rotate(T_world_object, vertex_normals(surface.vertices_m, surface.triangles, 1))
        vertices = frames.apply(T_world_object, surface.vertices_m)
        poses = fitted_together(stood, poses, vertices, surface.triangles, normals, hold_turn)
    return poses, Surface(vertices, surface.triangles)


def posed(views: Views, stood: list[Levelled], poses: list[np.ndarray]) -> Views:
    """Return the views in their own order with poses T_world_camera."""
    order = sorted(range(len(stood)), key=lambda k: stood[k].number)
    chosen = [stood[k].number for k in order]
    return replace(
        views,
        depths_m=[views.depths_m[i] for i in chosen],
        T_world_cameras=[poses[k] @ stood[k].T_level_camera for k in order],
        intrinsics=views.intrinsics[chosen],
        names=[views.names[i] for i in chosen],
        colours=[views.colours[i] for i in chosen if views.colours],
    )
