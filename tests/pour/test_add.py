"""`pour add` of recordings, in every layout; meshes are in test_learnt."""

import json

import numpy as np
import pytest
import trimesh
import yaml
from fuse import writers

from pipeline.errors import PipelineError
from pipeline.pour.__main__ import main
from pipeline.scan import recording
from pipeline.scan.shapes import shape


@pytest.fixture(scope="module")
def recorded():
    """Ten views of a cup that stands somewhere on the table."""
    T_world_object = recording.pose_on_table(recording.generator(1, "small_cup", 0))
    return recording.views(shape("small_cup"), T_world_object, 10, 0.6, 1.0, 1)


def _added(project, capsys, folder, *options) -> dict:
    main(["add", str(folder), "--name", "my_cup", *options, "--json", "--project", str(project.folder)])
    return json.loads(capsys.readouterr().out)


def _files(folder) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


@pytest.mark.parametrize("layout", writers.WRITERS)
def test_a_folder_of_every_layout_is_read_and_copied_as_it_is(project, recorded, tmp_path, capsys, layout):
    scan = tmp_path / "scan"
    writers.WRITERS[layout](scan, recorded)
    found = _added(project, capsys, scan, "--notes", "lent by a neighbour")
    assert found["layout"] == ("7-scenes" if layout == "numbered" else layout)
    assert (found["n_views"], found["views_left_out"]) == (len(recorded), [])
    added = _files(project.raw / "my_cup")
    assert yaml.safe_load(added.pop("scan.yaml")) == {"notes": "lent by a neighbour"}
    assert added == _files(scan)


def test_without_poses_it_is_read_and_left_to_the_workflow_to_register(project, recorded, tmp_path, capsys):
    scan = tmp_path / "scan"
    writers.seven_scenes(scan, recorded)
    for path in scan.glob("*.pose.txt"):
        path.unlink()
    assert _added(project, capsys, scan)["n_views"] == len(recorded)


def test_inverted_poses_are_named_before_the_workflow_runs(project, recorded, tmp_path):
    scan = tmp_path / "scan"
    writers.seven_scenes(scan, [(depth, np.linalg.inv(T)) for depth, T in recorded])
    with pytest.raises(PipelineError, match=r"scan.*world.*camera") as refusal:
        main(["add", str(scan), "--name", "my_cup", "--project", str(project.folder)])
    assert str(project.raw) not in str(refusal.value)
    assert not (project.raw / "my_cup").exists()


def test_another_depth_scale_is_an_option(project, recorded, tmp_path, capsys):
    scan = tmp_path / "scan"
    writers.seven_scenes(scan, [(5 * depth, T) for depth, T in recorded])
    with pytest.raises(PipelineError, match=r"depth.scale"):
        main(["add", str(scan), "--name", "my_cup", "--project", str(project.folder)])
    assert _added(project, capsys, scan, "--depth-scale", "5000")["views_left_out"] == []


def test_poses_and_meshes_that_fuse_would_complain_of_are_told_at_once(project, recorded, tmp_path, capsys):
    """Of a recording, and of a mesh; they were left to the log of the workflow."""
    scan, pot = tmp_path / "scan", tmp_path / "pot.stl"
    moved = np.eye(4)
    moved[0, 3] = 0.1
    writers.seven_scenes(scan, [*recorded[:-1], (recorded[-1][0], moved @ recorded[-1][1])])
    found = _added(project, capsys, scan)
    assert any(said.startswith("frame-000009.depth.png: off by 5 mm or more") for said in found["complaints"])
    assert found["views_left_out"] == []
    assert found["views_without_object"] == ["frame-000009.depth.png"]
    profile = [(0.003, 0), (0.04, 0), (0.04, 0.08), (0.037, 0.08), (0.037, 0.003), (0.003, 0.003), (0.003, 0)]
    trimesh.creation.revolve(profile, sections=64).export(pot)
    main(["add", str(pot), "--name", "pot", "--project", str(project.folder)])
    place, complaint, following = capsys.readouterr().out.splitlines()
    assert "pot: a mesh" in place
    assert "a hole through which liquid would leave" in complaint
    assert following == "next: snakemake -c2 reports/roc.pdf"


def test_an_empty_folder_is_refused(project, tmp_path):
    (tmp_path / "nothing").mkdir()
    with pytest.raises(PipelineError, match="nothing"):
        main(["add", str(tmp_path / "nothing"), "--name", "my_cup", "--project", str(project.folder)])
