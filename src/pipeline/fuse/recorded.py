"""Depth images on their way to fusion: poses checked, or found where there are none; table and object found."""

from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from pipeline.errors import PipelineError
from pipeline.fuse import agreement, placement, posing, registration, sliding
from pipeline.fuse.planes import Planes, planes
from pipeline.fuse.raw import Views
from pipeline.fuse.table import Placement, Plane

NOISY_M = 0.0025  # standard deviation: with 3.2 mm, 36 views do not hold a wall of 3.5 mm together; with 2.1 mm they do
# A Kinect's depths are off by 1 %, arms' cameras by some millimetres: from here on capacities are off by 3 % if it is the depths.
MUCH_TOO_LONG = 0.009
LEAST_ASTRAY_M = 0.005
LEAST_SEEN, LOW_SHARE = 0.85, 0.1  # of the surface higher than this share of the object


@dataclass(frozen=True)
class Located:
    """Views that fit together and, where they are at hand, their planes; the table and the object on it.

    left_out: names of the views that do not fit; without_object: of those without depth, or, where poses were refined, that show
    too little of the object; registration: how poses were found, empty where they were given; poses_off_m: by how much more than
    noise they were off as given, all but those of the views astray, and whether they were refined; depths_too_long: by which share
    depths are, if that is why they were off along the cameras' axes.
    """

    views: Views
    plane: Plane
    placement: Placement
    seen_by: Planes | None
    left_out: list[str]
    registration: dict[str, Any]
    poses_off_m: float | None = None
    astray: tuple[str, ...] = ()
    is_refined: bool = False
    depths_too_long: float | None = None
    without_object: tuple[str, ...] = ()

    @cached_property
    def spread_m(self) -> float:
        """The noise of depth, from the table."""
        return placement.spread_m(posing.ground(self.views, self.placement, posing.MEDIUM)[0][:, 2])

    def facts(self) -> dict[str, Any]:
        """Return what fusion.json says of the scan."""
        views = self.views
        eyes = [(self.placement.T_object_world @ T)[:3, 3].tolist() for T in views.T_world_cameras]
        return {
            "layout": views.layout,
            "n_views": len(views.depths_m),
            "n_views_found": views.n_found,
            "views_left_out": self.left_out,
            "views_without_object": list(self.without_object),
            "unit_m": 1.0,
            "T_object_world": self.placement.T_object_world.tolist(),
            "table_plane_world": [*self.plane.normal.tolist(), self.plane.offset_m],
            "table_rms_m": self.plane.rms_m,
            "table_spread_m": self.spread_m,
            "raised_m": self.placement.raised_m,
            "eyes_object_m": eyes,
            "poses": "registered" if self.registration else "refined" if self.is_refined else "given",
            "poses_off_m": self.poses_off_m,
            "views_astray": list(self.astray),
            "depths_too_long": self.depths_too_long,
            "depth_scale": views.depth_scale,
            "colours_differ": views.colours_differ,
            **self.registration,
        }


def complaints(facts: dict[str, Any]) -> list[str]:
    """Return a sentence each: views that do not fit, colours that were not used, poses that are off, depth too noisy for walls."""
    told = []
    off_m, as_given = facts["poses_off_m"] or 0.0, facts["poses"] == "given"
    refused = "fused as given, as they are too far off to be refined, or too little is seen"
    done = refused if as_given else "refined on table and object"
    if off_m > posing.OFF_M:
        told.append(
            f"the poses are off by {1e3 * off_m:.1f} mm, by table and object in each view; they were {done}; "
            "calibrate the camera's pose better"
        )
    if astray := facts.get("views_astray", []):
        told.append(
            f"{_named(astray)}: off by {1e3 * LEAST_ASTRAY_M:.0f} mm or more along the table; poses were {done}; correct these, "
            "or remove the views"
        )
    if abs(too_long := facts.get("depths_too_long") or 0.0) > MUCH_TOO_LONG:
        told.append(_of_depths(too_long, facts["depth_scale"]))
    by_poses, spread_m = off_m > posing.OFF_M and as_given, facts["table_spread_m"]
    if spread_m > NOISY_M and not by_poses:
        told.append(
            f"depth is noisy: points of the table spread by {1e3 * spread_m:.1f} mm, which tears thin walls; "
            "record from nearer, more views, or the mean of several images a view"
        )
    if placement.LEAST_BOARD_M < (raised_m := facts.get("raised_m", 0.0)) < placement.THICK_M:
        told.append(
            f"it stands on a board, {1e3 * raised_m:.0f} mm above the table around, whose top counts as the table; if that is a "
            "foot of its own, a scan cannot tell: drop a mesh of it"
        )
    is_registered = facts["poses"] == "registered"
    if left_out := facts.get("views_left_out"):
        cure = "remove them" if is_registered else "correct their poses or remove them"
        told.append(f"{_named(left_out)}: left out, as they do not fit the other views; {cure}")
    without = facts.get("views_without_object", [])
    if without and is_registered:
        told.append(
            f"{_named(without)}: left out, as no table with the one object was found in them; remove them"
        )
    elif without := [view for view in without if view not in astray]:
        told.append(
            f"{_named(without)}: left out, as they show too little of the object; if they look elsewhere, all is well; if not, "
            "correct their poses, or go nearer"
        )
    if facts.get("colours_differ"):
        told.append(
            "colours were not used to find poses, as their images are of another size than depth; align colour to depth"
        )
    return told


def _named(views: list[str]) -> str:
    return ", ".join(views[:3]) + (f" and {len(views) - 3} more" if len(views) > 3 else "")


def _of_depths(too_long: float, depth_scale: float) -> str:
    """Return a sentence on poses that were off along the cameras' axes by so large a share of the distance."""
    where, length, much = ("back", "long", "much") if too_long > 0 else ("forward", "short", "little")
    return (
        f"all cameras were moved {where} along their axes, by {abs(too_long):.1%} of the distance: if the poses were right there, "
        f"depths are so much too {length}, and it holds {3 * abs(too_long):.0%} too {much}; measure it, and if it is not as high "
        f"as this, write `depth_scale: {depth_scale * (1 + too_long):.5g}` into scan.yaml"
    )


def located(views: Views, name: str, rng: np.random.Generator) -> Located:
    """Return the views in one world, with the table and the object; a `PipelineError` names the folder and what is wrong."""
    if views.options.on_table is False:
        raise PipelineError(
            f"{name}/scan.yaml: on_table: expected true for depth images, as up comes from the table, found false; remove the key"
        )
    found: dict[str, Any] = {}
    if not views.T_world_cameras:
        views, found = registration.registered(views, name, rng)
    views, empty = agreement.with_depth(views)
    views, left_out = agreement.checked(views, name, rng, are_given=not found)
    plane, place = placement.find(views, name, rng)
    seen_by = planes(views, place)
    if found:
        return Located(views, plane, place, seen_by, left_out, found)
    aside = rng.spawn(1)[0]  # what is drawn later stays as it is
    off_m, astray = _off(views, place, seen_by, aside)
    given = Located(views, plane, place, None, left_out, found, off_m, astray, without_object=tuple(empty))
    if off_m <= posing.OFF_M and not astray:
        return replace(given, seen_by=seen_by)
    del seen_by  # much, of many views
    refined = posing.refined(views, place, name, rng)
    return given if refined is None else _refined(given, *refined, name, aside)


def _off(
    views: Views, place: Placement, seen_by: Planes, rng: np.random.Generator
) -> tuple[float, tuple[str, ...]]:
    """Return how far poses are off, by the table and along it, and the names of the views that are astray."""
    along_m, is_astray = sliding.off(seen_by, place, rng)
    astray = tuple(view for view, is_off in zip(views.names, is_astray, strict=True) if is_off)
    return max(posing.off_m(views, place), along_m), astray


def _refined(given: Located, views: Views, unseen: list[str], name: str, rng: np.random.Generator) -> Located:
    """Return the views with refined poses, of which some do not show the object; or as given where what was off is noise."""
    plane, place = given.plane, given.placement
    if place.raised_m > 0:  # a table that poses split in two looks like a board
        with suppress(PipelineError):
            plane, place = placement.find(views, name, rng)
    place = posing.shown_again(views, place)
    seen_by, off_m = planes(views, place), given.poses_off_m or 0.0
    if not given.astray and off_m < posing.NOISE_SHARE * given.spread_m:
        left_m, astray = _off(views, place, seen_by, rng)
        if left_m > posing.NO_NEARER * off_m or astray:
            more_m = float(np.sqrt(max(off_m**2 - left_m**2, 0.0)))
            return replace(given, poses_off_m=min(more_m, posing.OFF_M))
    return Located(
        *(views, plane, place, seen_by, given.left_out, {}, given.poses_off_m, given.astray),
        is_refined=True,
        depths_too_long=posing.too_long(given.views, views),
        without_object=(*given.without_object, *unseen),
    )


def check_registered(scan: Located, vertices_m: np.ndarray, seen: np.ndarray, name: str) -> None:
    """Refuse registered views whose surface, vertices (V, 3) of which some were seen (V,), is not shown from all sides.

    Views that were turned wrongly contradict each other: they leave holes, or what nobody saw.
    """
    if not scan.registration:
        return
    share = float(seen[vertices_m[:, 2] > LOW_SHARE * vertices_m[:, 2].max()].mean())
    if share < LEAST_SEEN:
        raise PipelineError(
            f"{name}: expected views without poses to show the whole object once they are registered, found {share:.0%} of its "
            "surface seen; record more views all round and from above, write `turntable_deg:` into scan.yaml, or add poses"
        )
