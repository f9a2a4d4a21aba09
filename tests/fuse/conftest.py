"""Scans with known truth, made once a session."""

from types import SimpleNamespace

import numpy as np
import pytest

from pipeline.fuse.fusion import fused
from pipeline.geometry import frames
from pipeline.scan import recording
from pipeline.scan.shapes import shape

OPTIONS = {"voxel_m": 0.00125, "truncation_m": 0.0025, "n_points": 6000, "seed": 2}


@pytest.fixture(scope="session")
def scan(tmp_path_factory):
    """Return a function that records an object by name and gives its folder, shape and T_world_object."""
    made = {}

    def of(name: str, views: int = 36, noise: float = 1.0) -> SimpleNamespace:
        key = (name, views, noise)
        if key not in made:
            folder = tmp_path_factory.mktemp("raw") / name
            body = shape(name)
            T_world_object = recording.pose_on_table(recording.generator(1, name, 0))
            recording.write(folder, recording.views(body, T_world_object, views, 0.6, noise, 1))
            made[key] = SimpleNamespace(folder=folder, shape=body, T_world_object=T_world_object)
        return made[key]

    return of


@pytest.fixture(scope="session")
def fusion(scan):
    """Return a function that fuses an object by name; also gives T_object_truth, the true frame in the fused one."""
    made = {}

    def of(name: str) -> SimpleNamespace:
        if name not in made:
            recorded = scan(name)
            result = fused(recorded.folder, **OPTIONS)
            T = np.array(result.report["T_object_world"]) @ recorded.T_world_object
            vertices = frames.apply(T, recorded.shape.vertices_m)
            made[name] = SimpleNamespace(
                result=result, shape=recorded.shape, T_object_truth=T, vertices_m=vertices
            )
        return made[name]

    return of
