"""Which objects take part."""

import pytest

from pipeline.errors import PipelineError
from pipeline.workflow.objects import demonstrated, files, find


def _config(scanned=("mug", "jug"), exclude=(), held=("mug",), source="mug") -> dict:
    return {
        "objects": {"source": source, "exclude": list(exclude)},
        "scan": {"objects": list(scanned)},
        "simulate": {"filling": {"held_objects": list(held)}},
    }


def test_demonstration_and_dropped_objects_in_alphabetical_order(tmp_path):
    for name in ("zulu", "alpha", ".hidden", "mug"):
        (tmp_path / name).mkdir()
    found = find(tmp_path, _config())
    assert found.demonstration == ("jug", "mug")
    assert found.dropped == ("alpha", "zulu")
    assert found.names == ("alpha", "jug", "mug", "zulu")


def test_excluded_objects_of_both_kinds_take_no_part(tmp_path):
    (tmp_path / "alpha").mkdir()
    (tmp_path / "zulu").mkdir()
    assert find(tmp_path, _config(exclude=["alpha", "jug"])).names == ("mug", "zulu")


def test_a_dropped_object_can_be_source_and_held(tmp_path):
    (tmp_path / "alpha").mkdir()
    assert find(tmp_path, _config(source="alpha", held=["alpha"])).dropped == ("alpha",)


def test_frames_of_a_demonstration_scan_are_no_foreign_files(tmp_path):
    (tmp_path / "mug").mkdir()
    for name in ("frame-000000.depth.png", "frame-000000.pose.txt", "camera-intrinsics.txt", ".directory"):
        (tmp_path / "mug" / name).touch()
    assert find(tmp_path, _config()).demonstration == ("jug", "mug")


def test_one_object_alone_is_refused(tmp_path):
    with pytest.raises(PipelineError, match="expected at least two"):
        find(tmp_path, _config(scanned=["mug"]))


def test_without_a_raw_folder_the_demonstration_objects_are_there(tmp_path):
    assert find(tmp_path / "nothing", _config()).names == ("jug", "mug")


def test_files_follow_links_and_skip_hidden_ones(tmp_path):
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "elsewhere/b.png").touch()
    (tmp_path / "cup/.git").mkdir(parents=True)
    for name in (".git/x", "a.txt", ".DS_Store"):
        (tmp_path / "cup" / name).touch()
    (tmp_path / "cup/depth").symlink_to(tmp_path / "elsewhere")
    assert files(tmp_path / "cup") == [f"{tmp_path}/cup/a.txt", f"{tmp_path}/cup/depth/b.png"]


def test_links_that_lead_round_or_nowhere(tmp_path):
    (tmp_path / "cup").mkdir()
    (tmp_path / "cup/a.txt").touch()
    (tmp_path / "cup/again").symlink_to(tmp_path / "cup")
    assert files(tmp_path / "cup") == [f"{tmp_path}/cup/a.txt"]
    (tmp_path / "cup/b.ply").symlink_to(tmp_path / "nothing")
    with pytest.raises(PipelineError, match=r"cup/b.ply: expected a file, found a link to nothing"):
        find(tmp_path, _config())


def test_a_file_name_that_no_one_can_print(tmp_path):
    (tmp_path / "cup").mkdir()
    (tmp_path / "cup/a\nb.ply").touch()
    with pytest.raises(PipelineError, match="printable"):
        find(tmp_path, _config())


def test_demonstrations_count_where_both_containers_take_part(tmp_path):
    folder = tmp_path / "mine"
    assert not demonstrated(folder, ["mug", "bowl"])
    folder.mkdir()
    (folder / "pair.yaml").write_text("held_object: mug\ntarget_object: bowl\n")
    assert demonstrated(folder, ["mug", "bowl"])
    assert not demonstrated(folder, ["mug", "jug"])
    with pytest.raises(PipelineError, match=r"expected one of mine, found 'mime' \(did you mean 'mine'"):
        demonstrated(tmp_path / "mime", ["mug", "bowl"])
