"""The arm: its kinematics, what it refuses, and how near to a plan its motors come."""

import itertools

import numpy as np
import pytest
import trimesh

from pipeline.execute import following, kinematics, teacher
from pipeline.execute.cell import FLANGE, READY_RAD, Cell, Solid, T_cup_flange
from pipeline.execute.task import Task


def tube(name, radius_m, height_m):
    """A straight-sided beaker as Bullet gets one: sixteen staves and a floor; the mesh where it stands."""
    mesh = trimesh.creation.cylinder(radius_m, height_m, sections=32)
    mesh.apply_translation([0, 0, height_m / 2])
    angle = np.linspace(0, 2 * np.pi, 17)
    pieces = []
    for a, b in itertools.pairwise(angle):
        ring = [[r * np.cos(t), r * np.sin(t)] for r in (radius_m, radius_m - 0.003) for t in (a, b)]
        pieces.append(np.array([[*xy, z] for xy in ring for z in (0.0, height_m)]))
    centre = np.array([0.0, 0.0, height_m])
    return Solid(
        name, height_m, radius_m, centre, pieces, (np.asarray(mesh.vertices), np.asarray(mesh.faces))
    )


TASK = Task(np.array([0.036, 0.0, 0.130]), 0.0, np.array([0.01, 0.0, 0.055]))


@pytest.fixture(scope="module")
def cell():
    held, second = tube("cup", 0.036, 0.130), tube("bowl", 0.072, 0.055)
    with Cell(held, second, TASK.T_world_second, T_cup_flange(held, 0.0)) as ready:
        yield ready


@pytest.mark.parametrize("yaw_rad", [0.0, 1.2, -2.9])
def test_task_space_and_cup_poses_are_two_words_for_one_motion(yaw_rad):
    rng = np.random.default_rng(1)
    task = Task(rng.normal(0, 0.05, 3), yaw_rad, rng.normal(0, 0.05, 3))
    wanted = np.column_stack([rng.uniform(-0.3, 0.3, (20, 3)), np.linspace(0.0, 2.8, 20)])
    assert task.trajectory(task.cup_poses(wanted)) == pytest.approx(wanted, abs=1e-12)


def test_the_jacobian_is_how_the_flange_moves(cell):
    q, small = READY_RAD + 0.2, 1e-3
    cell.pose_arm(q)
    frames = cell.frames()
    J = kinematics.jacobian(frames)
    for joint in range(7):
        cell.pose_arm(q + small * np.eye(7)[joint])
        moved = cell.frames()[FLANGE]
        assert (moved[:3, 3] - frames[FLANGE][:3, 3]) / small == pytest.approx(J[:3, joint], abs=1e-3)


def test_it_reaches_random_postures_and_says_when_it_cannot(cell):
    rng, reached = np.random.default_rng(2), 0
    for _ in range(10):
        q = np.clip(READY_RAD + rng.normal(0.0, 0.3, 7), cell.low_rad, cell.high_rad)
        cell.pose_arm(q)
        wanted = cell.frames()[FLANGE]
        found = kinematics.solve(cell, wanted, READY_RAD, 300)
        if found is not None:
            cell.pose_arm(found)
            assert np.linalg.norm(cell.frames()[FLANGE][:3, 3] - wanted[:3, 3]) < kinematics.POSITION_M
            reached += 1
    assert reached >= 9
    wanted[:3, 3] = [3.0, 0.0, 0.0]
    assert kinematics.solve(cell, wanted, READY_RAD, 300) is None


def test_a_trajectory_of_another_lip_and_opening_is_the_same_motion():
    rng = np.random.default_rng(3)
    believed = Task(rng.normal(0, 0.05, 3), 1.1, rng.normal(0, 0.05, 3))
    lip_m, opening_m = rng.normal(0, 0.05, (2, 3))
    wanted = np.column_stack([rng.uniform(-0.3, 0.3, (20, 3)), np.linspace(0.0, 2.8, 20)])
    there = Task(lip_m, believed.yaw_rad, opening_m)
    seen = there.trajectory(believed.cup_poses(wanted), believed.T_world_second)
    assert believed.own(wanted[None], lip_m, opening_m)[0] == pytest.approx(seen, abs=1e-12)


def test_a_teacher_who_sees_the_demonstration_pair_means_what_was_shown():
    shown, meant = teacher.DEMONSTRATED, teacher.seen(tube("cup", 0.036, 0.130), tube("bowl", 0.072, 0.055))
    for name in ("start_m", "pour_m", "end_m"):
        assert getattr(meant, name) == pytest.approx(getattr(shown, name), abs=0.002)
    assert meant.carried_rad == pytest.approx(shown.carried_rad, abs=0.02)
    one, two = (teacher.draw(np.random.default_rng(5), each) for each in (shown, meant))
    assert np.abs(one - two).max() < 0.02


def test_a_seen_pair_keeps_peoples_distances():
    low, narrow = tube("cup", 0.030, 0.060), tube("mug", 0.040, 0.095)
    meant = teacher.seen(low, narrow)
    assert meant.pour_m == pytest.approx([-0.013, 0.0, 0.055])
    assert meant.start_m == pytest.approx([-0.208, 0.0, 0.080])
    assert teacher.seen(low, tube("egg cup", 0.020, 0.03)).pour_m[0] == 0.0
    assert meant.carried_rad == pytest.approx(0.57 * np.pi / 4)


def straight(start, end, seconds):
    share = np.linspace(0.0, 1.0, round(seconds / following.PLAN_S) + 1)[:, None]
    return TASK.cup_poses(np.array(start) + share * (np.array(end) - start))


@pytest.mark.parametrize(
    ("poses", "reason"),
    [
        (straight([-0.2, 0, 0.15, 0], [-1.5, 0, 0.15, 0], 5.0), "no joint angles within their limits"),
        (straight([-0.25, 0, 0.15, 0], [0.05, 0, 0.15, 0], 0.1), "times its limit"),
        (straight([-0.25, 0, 0.10, 0], [-0.05, 0, 0.10, 0], 2.0), "the cup touches the second container"),
        (straight([-0.25, 0, 0.15, 0], [-0.25, 0, 0.06, 0], 2.0), "the cup touches the table"),
    ],
)
def test_what_the_arm_cannot_follow_is_refused_with_the_reason(cell, poses, reason):
    assert reason in following.plan(cell, poses).refused


def test_a_teachers_pour_is_followed_to_two_millimetres_and_twice_the_same(cell):
    wanted = teacher.draw(np.random.default_rng(5))
    plan = following.plan(cell, TASK.cup_poses(wanted))
    assert plan.refused == ""
    one, two = (following.follow(cell, plan.q_rad) for _ in range(2))
    assert one.tobytes() == two.tobytes()
    off = TASK.trajectory(one) - wanted
    assert np.abs(off[:, :3]).max() < 0.002
    assert np.degrees(np.abs(off[:, 3]).max()) < 1.0
