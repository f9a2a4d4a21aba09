"""Files of demonstrations: what is read, and what is refused by name."""

import numpy as np
import pytest
from motion import pours
from scipy.spatial.transform import Rotation

from pipeline.errors import PipelineError
from pipeline.geometry.frames import apply, rotation_about, transform
from pipeline.motion import checks, demonstrations, poses


@pytest.fixture
def folder(tmp_path):
    return pours.write(tmp_path / "mine", [pours.pour(seed) for seed in range(3)])


def test_files_are_read_in_order_from_time_zero(folder):
    t, values = pours.pour(0)
    pours.write_csv(folder / "pour_00.csv", t + 100.0, values)
    shown = demonstrations.read(folder)
    assert (shown.held_object, shown.target_object) == ("tall_cup", "wide_bowl")
    assert shown.files == ("pour_00.csv", "pour_01.csv", "pour_02.csv")
    assert shown.times_s[0] == pytest.approx(t)
    assert shown.values[2] == pytest.approx(pours.pour(2)[1], abs=1e-6)


def _late(t, values):
    return np.where(np.arange(len(t)) > 90, t + 0.5, t), values


def _backwards(t, values):
    t[60] = t[58]
    return t, values


def _jump(t, values):
    values[100:, 0] += 0.3
    return t, values


MISTAKES = {
    "gap": (_late, r"line 93: .* gap of 0\.52 s after t_s = 1\.8"),
    "time": (_backwards, "line 62: expected t_s to grow"),
    "millimetres": (lambda t, v: (t, v * [1000.0, 1000.0, 1000.0, 1.0]), "millimetres"),
    "degrees": (lambda t, v: (t, v * [1.0, 1.0, 1.0, 180.0 / np.pi]), "degrees"),
    "milliseconds": (lambda t, v: (t * 1000.0, v), "milliseconds"),
    "minutes": (lambda t, v: (t / 60.0, v), "is t_s in minutes"),
    "never": (lambda t, v: (t, v * [1.0, 1.0, 1.0, 0.01]), "never tilts"),
    "other way": (lambda t, v: (t, v * [1.0, 1.0, 1.0, -1.0]), "tilts the other way"),
    "jump": (_jump, "line 102: .* a jump of 0.3"),
    "short": (lambda t, v: (t[:10], v[:10]), "at least 20 rows, found 10"),
}


@pytest.mark.parametrize("name", MISTAKES)
def test_mistakes_are_told_by_file(folder, name):
    spoil, said = MISTAKES[name]
    pours.write_csv(folder / "pour_01.csv", *spoil(*pours.pour(1)))
    with pytest.raises(PipelineError, match=rf"pour_01\.csv.*{said}"):
        demonstrations.read(folder)


@pytest.mark.parametrize("found", ["nan", "", "inf", "1,5", "fast"])
def test_what_is_no_number_is_told_by_line(folder, found):
    path = folder / "pour_02.csv"
    lines = path.read_text().splitlines()
    lines[40] = ",".join([*lines[40].split(",")[:-1], f'"{found}"' if "," in found else found])
    path.write_text("\n".join(lines))
    with pytest.raises(PipelineError, match=r"pour_02\.csv, line 41: expected a number in tilt_rad"):
        demonstrations.read(folder)


def test_other_columns_and_empty_files_are_refused(folder):
    path = folder / "pour_00.csv"
    path.write_text(path.read_text().replace("tilt_rad", "tilt_deg"))
    with pytest.raises(PipelineError, match=r"pour_00\.csv: expected the columns .* found .*tilt_deg"):
        demonstrations.read(folder)
    path.write_text("")
    with pytest.raises(PipelineError, match=r"pour_00\.csv: expected a CSV table"):
        demonstrations.read(folder)
    path.write_bytes(b"\xff\xfe\x00\x01" * 50)
    with pytest.raises(PipelineError, match=r"pour_00\.csv: expected"):
        demonstrations.read(folder)


def test_a_pour_that_comes_from_beyond_or_ends_on_the_way_is_told():
    whole = [pours.pour(seed)[1] for seed in range(3)]
    checks.together("abc", whole)
    checks.together("abc", [one[:150] for one in whole])  # none is taken back
    with pytest.raises(PipelineError, match=r"^b: .* begins 0\.2\d* m beyond .* the other way round"):
        checks.together("abc", [whole[0], whole[1] * [-1.0, -1.0, 1.0, 1.0], whole[2]])
    with pytest.raises(
        PipelineError, match=r"^c: .* as in a, found a recording that ends while it is tilted"
    ):
        checks.together("abc", [*whole[:2], whole[2][:150]])


def test_one_demonstration_is_too_few(tmp_path):
    one = pours.write(tmp_path / "one", [pours.pour(0)])
    with pytest.raises(PipelineError, match=r"one: expected at least two demonstrations .* found 1"):
        demonstrations.read(one)


@pytest.mark.parametrize(
    "pair",
    [
        "",
        "held_object: tall_cup\n",
        "held_object: 3\ntarget_object: wide_bowl\n",
        pours.PAIR + "colour: red\n",
        "{",
        pours.PAIR + "target_pose: {x_m: 0}\n",
        pours.PAIR + "target_pose: {x_m: 0, y_m: 0, z_m: 0, qx: 0, qy: 0, qz: 0, qw: 2}\n",
    ],
)
def test_damaged_pairs_are_refused(folder, pair):
    (folder / "pair.yaml").write_text(pair)
    with pytest.raises(PipelineError, match=r"pair\.yaml: expected"):
        demonstrations.read(folder)


# A cup of radius 40 mm and height 130 mm, and a bowl whose opening is 53 mm above its foot.
ANGLE = np.linspace(0.0, 2.0 * np.pi, 360, endpoint=False)
RIM = np.column_stack([0.04 * np.cos(ANGLE), 0.04 * np.sin(ANGLE), np.full(360, 0.13)])
OPENING = np.array([0.0, 0.0, 0.053])
TURN = rotation_about(np.array([0.0, 0.0, 1.0]), 0.7)
T_WORLD_SECOND = transform(TURN, np.array([0.5, -0.2, 0.75]))


def _cup_poses(trajectory: np.ndarray, yaw_rad: float) -> np.ndarray:
    """Return T_world_cup (T, 4, 4) with the lip at angle `yaw_rad` of the rim and the pour along x of the bowl's frame."""
    lip = np.array([0.04 * np.cos(yaw_rad), 0.04 * np.sin(yaw_rad), 0.13])
    upright = rotation_about(np.array([0.0, 0.0, 1.0]), -yaw_rad)
    found = []
    for *offset, tilt in trajectory:
        R = TURN @ rotation_about(np.array([0.0, 1.0, 0.0]), tilt) @ upright
        found.append(transform(R, apply(T_WORLD_SECOND, OPENING) + TURN @ np.array(offset) - R @ lip))
    return np.array(found)


@pytest.mark.parametrize("most_rad", [1.2, 2.4])
@pytest.mark.parametrize("yaw_rad", [0.0, np.pi / 3.0])
def test_cup_poses_become_the_lips_trajectory(tmp_path, yaw_rad, most_rad):
    t, wanted = pours.pour(0)
    wanted[:, 3] *= most_rad / wanted[:, 3].max()
    T_world_cup = _cup_poses(wanted, yaw_rad)
    quaternions = Rotation.from_matrix(T_world_cup[:, :3, :3]).as_quat()
    rows = np.column_stack([T_world_cup[:, :3, 3], quaternions])
    second = [0.5, -0.2, 0.75, *Rotation.from_matrix(TURN).as_quat()]
    named = ", ".join(f"{key}: {value}" for key, value in zip(demonstrations.POSE_KEYS, second, strict=True))
    folder = pours.write(
        tmp_path / "poses", [(t, rows), (t, rows)], f"{pours.PAIR}target_pose: {{{named}}}\n"
    )
    shown = demonstrations.read(folder)
    T_second = poses.matrices(shown.target_pose[None])[0]
    found = poses.trajectory(poses.matrices(shown.values[0]), RIM, T_second, OPENING, "pour")
    assert found == pytest.approx(wanted, abs=2e-5)


def test_poses_need_the_second_container_and_unit_quaternions(tmp_path):
    t, _ = pours.pour(0)
    rows = np.tile([0.0, 0.0, 0.2, 0.0, 0.0, 0.0, 1.0], (len(t), 1))
    folder = pours.write(tmp_path / "poses", [(t, rows), (t, rows)])
    with pytest.raises(PipelineError, match=r"pair\.yaml: expected target_pose"):
        demonstrations.read(folder)
    named = "target_pose: {x_m: 0, y_m: 0, z_m: 0, qx: 0, qy: 0, qz: 0, qw: 1}\n"
    (folder / "pair.yaml").write_text(pours.PAIR + named)
    pours.write_csv(folder / "pour_01.csv", t, rows * 2.0)
    with pytest.raises(PipelineError, match=r"pour_01\.csv, line 2: expected a quaternion"):
        demonstrations.read(folder)
    upright = poses.matrices(rows)
    with pytest.raises(PipelineError, match="pour_00: expected a pour, found a cup that never tilts"):
        poses.trajectory(upright, RIM, T_WORLD_SECOND, OPENING, "pour_00")
    pours.write_csv(folder / "pour_01.csv", *pours.pour(0))
    with pytest.raises(PipelineError, match="expected one layout"):
        demonstrations.read(folder)
