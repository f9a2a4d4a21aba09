"""A project with a mug that was fused: its true shape, so that nothing has to run."""

import numpy as np
import pytest
import yaml
from conftest import sampled

from pipeline.artefacts import write_json, write_mesh, write_table
from pipeline.geometry.frames import rotation_about
from pipeline.pour.project import Project
from pipeline.scan.shapes import shape

CLOUD = ["x_m", "y_m", "z_m", "nx", "ny", "nz", "area_m2", "seen"]


@pytest.fixture
def T_object_world():
    """How the mug was turned upright."""
    pose = np.eye(4)
    pose[:3, :3] = rotation_about(np.array([0.0, 0.0, 1.0]), 0.4)
    pose[:3, 3] = 0.03, 0.06, -0.7
    return pose


@pytest.fixture
def project(tmp_path, T_object_world):
    """Objects mug (fused) and jug (dropped), tall_cup (configured)."""
    (tmp_path / "config").mkdir()
    for name in ("mug", "jug"):
        (tmp_path / "data/raw" / name).mkdir(parents=True)
    config = {
        "objects": {"source": "mug", "exclude": ["old_cup"]},
        "scan": {"objects": ["tall_cup", "old_cup"]},
    }
    (tmp_path / "config/config.yaml").write_text(yaml.safe_dump(config))
    body, folder = shape("mug"), tmp_path / "data/processed/fuse/mug"
    write_mesh(folder / "mesh.ply", (body.vertices_m, body.triangles))
    write_table(folder / "cloud.parquet", sampled("mug")[CLOUD], "cloud")
    write_json(folder / "fusion.json", {"T_object_world": T_object_world.tolist()})
    return Project(tmp_path)
