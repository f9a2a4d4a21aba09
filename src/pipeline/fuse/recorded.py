"""Depth images on their way to fusion: poses checked, or found where there are none; table and object found."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from pipeline.fuse import agreement, placement, registration
from pipeline.fuse.raw import Views
from pipeline.fuse.table import Placement, Plane


@dataclass(frozen=True)
class Located:
    """Views that fit together, the table and the object on it; left_out: names of the views that do not fit;
    registration: how poses were found, empty where they were given."""

    views: Views
    plane: Plane
    placement: Placement
    left_out: list[str]
    registration: dict[str, Any]

    def facts(self) -> dict[str, Any]:
        """Return what fusion.json says of the scan."""
        views = self.views
        eyes = [(self.placement.T_object_world @ T)[:3, 3].tolist() for T in views.T_world_cameras]
        return {
            "layout": views.layout,
            "n_views": len(views.depths_m),
            "n_views_found": views.n_found,
            "views_left_out": self.left_out,
            "unit_m": 1.0,
            "T_object_world": self.placement.T_object_world.tolist(),
            "table_plane_world": [*self.plane.normal.tolist(), self.plane.offset_m],
            "table_rms_m": self.plane.rms_m,
            "eyes_object_m": eyes,
            "poses": "registered" if self.registration else "given",
            **self.registration,
        }


def located(views: Views, name: str, rng: np.random.Generator) -> Located:
    """Return the views in one world, with the table and the object; a `PipelineError` names the folder and what is wrong."""
    found: dict[str, Any] = {}
    if not views.T_world_cameras:
        views, found = registration.registered(views, name, rng)
    views, left_out = agreement.checked(views, name, rng)
    plane, place = placement.find(views, name, rng)
    return Located(views, plane, place, left_out, found)
