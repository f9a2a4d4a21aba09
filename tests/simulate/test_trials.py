"""The trials as a whole: rows that repeat bit for bit, voids that are redrawn and counted, margins of known cups."""

import sys

import numpy as np
import pandas as pd
import pytest
import trimesh
from simulate.test_batches import Core

from pipeline import artefacts
from pipeline.errors import PipelineError
from pipeline.geometry import frames
from pipeline.simulate import __main__ as command_line
from pipeline.simulate import batches, draws, prepared, trials

SPACING_M = 0.010
HALF_FULL = draws.Pouring(fill_min=0.5, fill_max=0.5, tilt_max_rad=np.radians(120.0), threshold=1)
FILLING = draws.Filling(10, np.radians(120.0), 1.5, 0.1, 1.0, 20)
INNER_M, DEPTH_M = 0.030, 0.060


def lathe(inner, depth, wall=0.003):
    outer, top = inner + wall, depth + wall
    profile = [(0, 0), (outer, 0), (outer, top), (inner, top), (inner, wall), (0, wall)]
    mesh = trimesh.creation.revolve(profile, sections=96)
    return np.array(mesh.vertices), np.array(mesh.faces)


def prepare(name, mesh, folder, spacing_m=SPACING_M):
    """Prepare a mesh (vertices, triangles) as the workflow does; return the container's file."""
    artefacts.write_mesh(folder / f"{name}.ply", mesh)
    path = str(folder / f"{name}.npz")
    words = ["prepare", "--object", name, "--mesh", str(folder / f"{name}.ply"), "--container", path]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "argv", ["simulate", *words, "--spacing-m", str(spacing_m)])
        command_line.main()
    return path


@pytest.fixture(scope="module")
def cup():
    return prepared.container("cup", *lathe(INNER_M, DEPTH_M), SPACING_M)


@pytest.fixture(scope="module")
def bowl():
    return prepared.container("bowl", *lathe(0.060, 0.045), SPACING_M)


@pytest.fixture(scope="module")
def experiment(cup, bowl):
    low = prepared.container("low", *lathe(0.028, 0.040), SPACING_M)
    with trials.FillingExperiment(bowl, [cup, low], FILLING) as experiment:
        yield experiment


@pytest.fixture(scope="module")
def pourings(cup):
    return pd.DataFrame([trials.pouring_trial(cup, HALF_FULL, k, seed=4) for k in range(24)])


@pytest.fixture(scope="module")
def fillings(experiment):
    return pd.DataFrame([experiment.trial(k, seed=4) for k in range(20)])


def test_a_half_full_cylinder_pours_when_theory_says(pourings):
    # The surface of a half-full cylinder runs through the rim and the opposite edge of the floor's middle: atan(h / 2r).
    theory_deg = np.degrees(np.arctan2(DEPTH_M, 2 * INNER_M))
    beyond_deg = np.degrees(pourings.tilt_rad) - theory_deg
    assert ((pourings.hydrostatic_margin > 0) == (beyond_deg > 0))[beyond_deg.abs() > 2].all()
    assert (pourings.poured == (beyond_deg > 0))[beyond_deg.abs() > 15].all()
    assert pourings.poured.any()
    assert not pourings.poured.all()


def test_the_margin_grows_with_the_tilt_and_is_a_share_of_the_capacity(pourings):
    by_tilt = pourings.sort_values("tilt_rad").hydrostatic_margin
    assert (by_tilt.diff().dropna() >= 0).all()
    assert by_tilt.between(-0.5, 0.5).all()
    assert by_tilt.iloc[-1] == pytest.approx(0.5, abs=0.01)


def test_particles_are_conserved(pourings, fillings):
    for rows in (pourings, fillings):
        assert (rows.n_left + rows.n_retained == rows.n_particles).all()
        assert (rows.n_leaked == 0).all()
        assert not rows.failed.any()
    assert (pourings.n_spilled == pourings.n_left).all()
    assert (fillings.n_particles == FILLING.held_particles).all()
    assert (fillings.n_spilled <= fillings.n_left + fillings.n_second).all()


def test_filled_means_that_nothing_is_outside(fillings):
    outside = fillings.n_spilled + fillings.n_retained
    assert (fillings.filled == (outside == 0)).all()


def test_rows_fit_the_table(tmp_path, pourings, fillings):
    for name, rows in (("pouring", pourings), ("filling", fillings)):
        artefacts.write_table(tmp_path / f"{name}.parquet", rows, "trials")
        back = artefacts.read_table(tmp_path / f"{name}.parquet", "trials")
        pd.testing.assert_series_equal(back.fill_m3, rows.fill_m3)
        np.testing.assert_array_equal(np.stack(back.T_world_held), np.stack(rows.T_world_held))


def test_a_trial_is_the_same_alone_and_again(cup, experiment, pourings, fillings):
    assert_same_row(trials.pouring_trial(cup, HALF_FULL, 7, seed=4), pourings.iloc[7])
    for k in (13, 2):
        assert_same_row(experiment.trial(k, seed=4), fillings.iloc[k])


def test_a_trial_is_the_same_with_a_container_that_was_stored(cup, pourings):
    """Down to the states at rest and the scalars' types, which the compiled code was compiled for."""
    stored = prepared.from_arrays("cup", prepared.to_arrays(cup))
    assert stored.vessel.settled.keys() == cup.vessel.settled.keys()
    for value, expected in zip(stored.vessel.walls, cup.vessel.walls, strict=True):
        assert type(value) is type(expected)
    assert_same_row(trials.pouring_trial(stored, HALF_FULL, 7, seed=4), pourings.iloc[7])


def test_another_seed_is_another_trial(cup, pourings):
    other = trials.pouring_trial(cup, HALF_FULL, 7, seed=5)
    assert other["seed"] != pourings.seed[7]
    assert other["tilt_rad"] != pourings.tilt_rad[7]


def test_void_draws_are_drawn_again_with_the_same_cup_and_counted(experiment, fillings):
    assert fillings.n_void.sum() > 0
    names = [held.name for held in experiment.held]
    for row in fillings.itertuples():
        number = draws.draw_held(draws.stream(row.seed, 0), len(names))
        assert row.held_object == names[number]
        accepted = experiment.draw(row.trial, row.seed, number, row.n_void)
        assert accepted.dx_m == row.dx_m
        assert not experiment.touches(accepted, number)
        for attempt in range(row.n_void):
            void = experiment.draw(row.trial, row.seed, number, attempt)
            touches = experiment.touches(void, number)
            assert touches or experiment.simulate(void, number, row.seed).spilled_while_settling


def test_a_geometry_without_room_says_so(cup, bowl, monkeypatch):
    monkeypatch.setattr(trials, "MAX_ATTEMPTS", 20)
    centred = draws.Filling(10, np.radians(120.0), 0.05, 0.1, 0.2, 20)
    with (
        trials.FillingExperiment(cup, [bowl], centred) as experiment,
        pytest.raises(PipelineError, match=r"cup: .*bowl.*20 contacts.*20 draws.*held_objects"),
    ):
        experiment.trial(0, seed=4)


@pytest.mark.parametrize(
    ("landing_m", "second_fill", "margin"),
    [
        (0.0, 0.5, 0.4),  # in the middle, limited by the room left
        (-0.045, 0.2, 0.25),  # a quarter of a radius inside the rim
        (-0.075, 0.2, -0.25),  # a quarter outside
        (0.0, 0.95, -0.05),  # no room for a tenth of the capacity
    ],
)
def test_margin_of_a_filling(cup, bowl, landing_m, second_fill, margin):
    protocol = draws.Filling(
        round(0.1 * bowl.cavity.capacity_m3 / SPACING_M**3), np.radians(120.0), 1.5, 0.1, 1.0, 20
    )
    lip = np.array([INNER_M, 0.0, cup.height_m])
    # Down a wall of 60 mm that slopes by 30°: 0.767 m/s, of which 0.664 forwards; 0.0691 s to fall by 50 mm.
    dx_m = landing_m - 0.0459
    lip_world = bowl.cavity.opening_m + np.array([dx_m, 0.0, 0.05])
    draw = draws.FillingDraw(
        second_fill_m3=second_fill * bowl.cavity.capacity_m3,
        half="relative",
        T_world_held=frames.transform(np.eye(3), lip_world - lip),
        T_world_second=np.eye(4),
        lip_m=lip,
        axis_world=np.array([0.0, 1.0, 0.0]),
        dx_m=dx_m,
        dy_m=0.0,
        dz_m=0.05,
    )
    assert trials.filling_margin(draw, cup, bowl, protocol) == pytest.approx(margin, abs=0.03)


def test_without_a_slope_liquid_falls_straight_down():
    assert trials.throw_m(0.06, 0.05, np.radians(90.0)) == pytest.approx(0.0, abs=1e-9)
    assert trials.throw_m(0.06, 0.05, np.radians(60.0)) == 0.0
    assert trials.throw_m(0.06, 0.05, np.radians(120.0)) == pytest.approx(0.0459, abs=1e-4)


def test_what_the_held_cup_keeps_is_not_filled(cup, bowl):
    protocol = draws.Filling(10, np.radians(45.0), 1.5, 0.1, 1.0, 20)
    draw = draws.draw_filling(cup.cavity, cup.height_m, bowl.cavity, 1e-6, protocol, 0, draws.stream(1, 1))
    assert trials.filling_margin(draw, cup, bowl, protocol) <= -0.99


def test_distance_inside_a_contour():
    square = np.array([[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0]])
    for contour in (square, square[::-1]):
        assert trials.inside_m(contour, np.array([1.0, 0.5])) == pytest.approx(0.5)
        assert trials.inside_m(contour, np.array([3.0, 1.0])) == pytest.approx(-1.0)
        assert trials.inside_m(contour, np.array([-3.0, -4.0])) == pytest.approx(-5.0)


def test_a_block_is_refused_by_name():
    block = trimesh.creation.box([0.06, 0.06, 0.06])
    block.apply_translation([0, 0, 0.03])
    with pytest.raises(PipelineError, match="block"):
        prepared.container("block", np.array(block.vertices), np.array(block.faces), SPACING_M)


def test_the_command_line_runs_both_experiments_thrice_to_the_same_bytes(tmp_path, monkeypatch):
    """Alone, again, and many at once: then a core plays the card."""
    cup = prepare("cup", lathe(INNER_M, DEPTH_M), tmp_path)
    bowl = prepare("bowl", lathe(0.060, 0.045), tmp_path)

    def run(name, *options):
        output = tmp_path / name
        common = ["--seed", "4", "--trials", "20", "--trials-table", str(output)]
        monkeypatch.setattr(sys, "argv", ["simulate", *options, *common])
        command_line.main()
        return output.read_bytes()

    pour = ["pouring", "--object", "cup", "--container", cup]
    fill = ["filling", "--object", "bowl", "--container", bowl, "--held", f"cup={cup}", f"bowl={bowl}"]
    assert run("p1.parquet", *pour) == run("p2.parquet", *pour)
    assert run("f1.parquet", *fill) == run("f2.parquet", *fill)
    monkeypatch.setattr(batches, "card", lambda device, engine: Core() if device == "cuda" else None)
    monkeypatch.setattr(batches, "AT_ONCE", 8)
    assert run("p1.parquet", *pour) == run("p3.parquet", *pour, "--device", "cuda")
    assert run("f1.parquet", *fill) == run("f3.parquet", *fill, "--device", "cuda")
    rows = artefacts.read_table(tmp_path / "f1.parquet", "trials")
    assert rows.trial.tolist() == list(range(20))
    assert set(rows.held_object) == {"cup", "bowl"}
    assert set(rows.half) == {"relative", "free_room"}


def test_bad_options_are_one_sentence(tmp_path, monkeypatch):
    output = str(tmp_path / "trials.parquet")
    missing = str(tmp_path / "missing.npz")
    for options, text in (
        (["pouring", "--object", "cup", "--container", missing], "missing.npz"),
        (["filling", "--object", "bowl", "--container", missing, "--held", "cup"], "missing.npz|NAME=FILE"),
    ):
        monkeypatch.setattr(sys, "argv", ["simulate", *options, "--trials-table", output])
        with pytest.raises(PipelineError, match=text):
            command_line.main()
    assert not list(tmp_path.iterdir())


def assert_same_row(row, expected):
    for key, value in row.items():
        if isinstance(value, (float, list)):
            np.testing.assert_array_equal(value, expected[key], err_msg=key)
        else:
            assert value == expected[key], key
