"""A robot's own view of its pour: the classifiers' answers, for the state that it is in."""

import numpy as np
import pandas as pd
import pytest

from pipeline.classify import features as classified
from pipeline.errors import PipelineError
from pipeline.models import EXPERIMENT_FEATURES, QUANTITIES, Model, mean_probability
from pipeline.watching import Portion, pair_watcher

MORE = {"capacity_m3": 3e-4}


def row(name, mapping, radius, height, lip, opening, centre):
    numbers = {"radius_m": radius, "height_m": height, "volume_m3": 4e-4 * radius / 0.04}
    places = {"lip": lip, "opening": opening, "centre": centre}
    at = {f"{what}_{axis}_m": v for what, p in places.items() for axis, v in zip("xyz", p, strict=True)}
    return {"object": name, "mapping": mapping, "tilt_reference_rad": 10 * height, **numbers, **at, **MORE}


PARAMETERS = pd.DataFrame(
    [
        row("cup", "label_mapping", 0.04, 0.12, (0, 0.04, 0.12), (0.001, 0, 0.12), (0.002, 0.001, 0.05)),
        row("cup", "point_mapping", 0.05, 0.11, (0, 0.05, 0.11), (0.001, 0, 0.12), (0.002, 0.001, 0.05)),
        row("bowl", "label_mapping", 0.08, 0.06, (0.08, 0, 0.06), (0.003, -0.002, 0.06), (0.001, 0, 0.02)),
        row("bowl", "point_mapping", 0.07, 0.06, (0.07, 0, 0.06), (0.003, -0.002, 0.06), (0.001, 0, 0.02)),
    ]
)


def models(experiment, features, draws=5, terms="linear"):
    """Classifiers with numbers of their own; nothing of them is fitted here."""
    names, rng = EXPERIMENT_FEATURES[experiment], np.random.default_rng(len(experiment + features))
    variables, references = zip(*(QUANTITIES[name] for name in names), strict=True)
    n = len(names) if terms == "linear" else len(names) * (len(names) + 3) // 2
    standard = features == "standard"
    return [
        Model(
            **{"experiment": experiment, "features": features, "training_object": "cup", "draw": draw},
            **{"feature_names": names, "variables": variables, "terms": terms},
            references=(None,) * len(names) if standard else references,
            mean=tuple(rng.normal(0.5, 0.2, len(names))),
            std=tuple(rng.uniform(0.2, 1.0, len(names))),
            weights=tuple(rng.normal(0, 1, n)),
            intercept=float(rng.normal()),
            **{"training_objects": ("cup",), "samples": 50, "penalty": "ridge", "ridge": 1.0},
            **{"converged": True, "separable": False},
        )
        for draw in range(draws)
    ]


def watcher(features, terms="linear"):
    both = (models(name, features, terms=terms) for name in ("pouring", "filling"))
    return pair_watcher(*both, PARAMETERS, features, "cup", "bowl", Portion(1e-5, 2.0))


def trials(lip_m, features):
    """The same states as trials of the stage simulate: the cup upright with its lip there, both where they stand, turned."""
    mapping = "label_mapping" if features == "standard" else features
    own = PARAMETERS[PARAMETERS["mapping"] == mapping].set_index("object")
    cup, bowl = own.loc["cup"], own.loc["bowl"]
    lip = np.array([cup["lip_x_m"], cup["lip_y_m"], cup["lip_z_m"]])
    opening = np.array([bowl["opening_x_m"], bowl["opening_y_m"], bowl["opening_z_m"]])
    yaw = np.arctan2(lip[1], lip[0] - cup["opening_x_m"])
    T_second, T_held = np.eye(4), np.eye(4)
    T_held[:2, :2] = [[np.cos(yaw), np.sin(yaw)], [-np.sin(yaw), np.cos(yaw)]]
    T_held[:3, 3] = opening + lip_m - T_held[:3, :3] @ lip
    state = {"experiment": "filling", "object": "bowl", "held_object": "cup", "tilt_rad": 2.0}
    state |= {"fill_m3": 1e-5, "second_fill_m3": 3e-5, "axis_x": 0.0, "axis_y": 1.0, "axis_z": 0.0}
    state |= dict(zip(("lip_x_m", "lip_y_m", "lip_z_m"), lip, strict=True))
    return pd.DataFrame([state | {"T_world_held": T_held.ravel(), "T_world_second": T_second.ravel()}])


@pytest.mark.parametrize("features", ["label_mapping", "point_mapping", "standard"])
def test_a_state_has_the_features_that_the_classifiers_were_taught(features):
    mapping = "label_mapping" if features == "standard" else features
    rims = PARAMETERS.rename(columns={"lip_x_m": "x_m", "lip_y_m": "y_m", "lip_z_m": "z_m"})
    known = classified.parameters_of(PARAMETERS, rims, mapping)
    for lip_m in np.random.default_rng(1).normal(0, 0.1, (10, 3)):
        taught = classified.features(trials(lip_m, features), known, standard=features == "standard")
        expected, _ = mean_probability(models("filling", features), taught)
        found = watcher(features).watch(lip_m, 0.7, 1.5e-4, 3e-5)
        assert found.fill == pytest.approx(expected[0], rel=1e-9)
        held = PARAMETERS.query("object == 'cup' and mapping == @mapping").iloc[0]
        pour = models("pouring", features)
        values = pour[0].feature_values({"tilt_rad": 0.7, "fill_m3": 1.5e-4}, {"held": held.to_dict()})
        assert found.pour == pytest.approx(mean_probability(pour, values)[0][0], rel=1e-12)


def test_quadratic_classifiers_are_watched_with_too():
    held = PARAMETERS.iloc[0].to_dict()
    pour = models("pouring", "label_mapping", terms="quadratic")
    values = pour[0].feature_values({"tilt_rad": 0.9, "fill_m3": 2e-4}, {"held": held})
    found = watcher("label_mapping", "quadratic").watch(np.zeros(3), 0.9, 2e-4)
    assert found.pour == pytest.approx(mean_probability(pour, values)[0][0], rel=1e-12)


def test_along_a_trajectory_is_state_by_state():
    states = np.random.default_rng(2).normal(0, 0.1, (7, 4))
    one = watcher("label_mapping")
    found = one.along(states, 1e-4, 2e-5)
    assert found.shape == (7, 2)
    assert found[3] == pytest.approx(one.watch(states[3, :3], states[3, 3], 1e-4, 2e-5))


def test_what_cannot_be_watched_is_said():
    with pytest.raises(PipelineError, match=r"vase: .*\(cup bowl\), found none"):
        pair_watcher(
            *(models(name, "standard") for name in ("pouring", "filling")),
            PARAMETERS,
            "standard",
            "vase",
            "bowl",
        )
