"""The page of parameters: its numbers, and that it says what is listed and no more."""

import numpy as np
import pandas as pd
import pytest
from conftest import sampled
from parametrise.clouds import cloud

from pipeline.artefacts import points
from pipeline.geometry.cavity import cavity
from pipeline.parametrise.parameters import PARAMETERS
from pipeline.parametrise.uncertainty import estimates
from pipeline.report.parameters_page import Drawn, drawings
from pipeline.report.parameters_table import table
from pipeline.report.volumes import biases, comparison, volumes
from pipeline.scan.shapes import shape

CONTAINER = {
    "cavity_capacity_m3": np.array(400e-6),
    "spacing_m": np.array(0.01),
    "settled_keys": np.array([-1, 0, 8]),
    "settled_counts": np.array([412, 404, 8]),
}

JUG = shape("jug")
CAVITY = {
    f"cavity_{name}": np.asarray(value)
    for name, value in vars(cavity(JUG.vertices_m, JUG.triangles, name="jug")).items()
}


def _listed(names) -> pd.DataFrame:
    found = estimates(names, cloud("jug"), 1000, 2, np.random.default_rng(1))
    return pd.concat(
        [found.assign(object="jug", mapping=mapping) for mapping in ("label_mapping", "point_mapping")]
    )


def _drawn(listed: pd.DataFrame) -> Drawn:
    own, cloud_of = listed[listed["mapping"] == "label_mapping"].set_index("parameter"), sampled("jug")
    container = cloud_of["container"].to_numpy(bool)
    return Drawn("jug", points(cloud_of), container, own["value"].to_dict(), own["std"].to_dict())


def test_volumes_stand_side_by_side_with_their_bias():
    listed = pd.DataFrame(
        {
            "object": "jug",
            "mapping": ["label_mapping", "label_mapping", "point_mapping"],
            "parameter": ["volume_m3", "capacity_m3", "volume_m3"],
            "value": [500e-6, 396e-6, 510e-6],
        }
    )
    numbers = biases(volumes(listed, {"jug": CONTAINER}, {"jug": {"fuse.capacity_relative_error": -0.02}}))
    assert numbers["volumes.jug.overflow_m3"] == pytest.approx(404e-6)
    expected = {"hull_label_mapping": 0.25, "capacity_label_mapping": -0.01, "overflow": 0.01}
    expected |= {"hull_point_mapping": 0.275, "true_cavity": 1 / 0.98 - 1}
    for kind, bias in expected.items():
        assert numbers[f"volumes.jug.{kind}.bias"] == pytest.approx(bias), kind
    assert "volumes.jug.capacity_point_mapping_m3" not in numbers  # not listed


def test_every_parameter_that_has_a_picture_is_drawn_and_the_lip_is_where_it_is():
    drawn = _drawn(_listed(list(PARAMETERS)))
    axis = drawings([drawn]).axes[0]
    marks = dict(zip(*reversed(axis.get_legend_handles_labels()), strict=True))
    assert len(marks) == 11
    lip, opening = drawn.vector_mm("lip"), drawn.vector_mm("opening")
    (along,), (height,) = marks["lip"].get_data()
    assert along == pytest.approx(np.linalg.norm((lip - opening)[:2]))
    assert height == pytest.approx(lip[2])


def test_what_is_not_listed_is_not_drawn():
    axis = drawings([_drawn(_listed(["opening_m", "lip_m", "height_m"]))]).axes[0]
    assert set(axis.get_legend_handles_labels()[1]) == {"height", "lip"}
    listed = _listed(["wall_m"])
    assert not drawings([_drawn(listed)]).axes[0].collections
    found = volumes(listed, {"jug": CONTAINER}, {})
    kept = comparison(found, [_drawn(listed)], {"jug": CAVITY}).axes[1]
    assert kept.get_title() == "jug"
    assert not kept.lines


def test_what_is_kept_is_drawn_beside_what_hydrostatics_says():
    listed = _listed(["lip_m", "opening_m", "retained_m3"])
    figure = comparison(volumes(listed, {"jug": CONTAINER}, {}), [_drawn(listed)], {"jug": CAVITY})
    mapped, hydrostatic = (line.get_xydata() for line in figure.axes[1].lines)
    assert mapped[0] == pytest.approx([0.0, 100.0])
    said = np.interp(mapped[:, 0], *hydrostatic.T)
    np.testing.assert_allclose(mapped[:, 1], said, atol=3.0)


def test_the_table_has_value_uncertainty_and_the_known_error():
    listed = _listed(["radius_m", "retained_m3"])
    own = listed[listed["mapping"] == "label_mapping"].iloc[0]
    pages = table(listed, {"jug": {"parametrise.label_mapping.radius": -0.0123}})
    assert len(pages) == 2
    cells = {
        place: cell.get_text().get_text() for place, cell in pages[0].axes[0].tables[0].get_celld().items()
    }
    assert cells[(1, -1)] == "radius, mm"
    assert cells[(1, 0)] == f"{own['value'] * 1e3:.2f} ± {own['std'] * 1e3:.2f} (−1.2 %)"
    assert cells[(2, -1)] == "retained 0°, ml"


def test_a_parameter_that_could_not_be_told_is_a_dash():
    listed = _listed(["wall_m"]).assign(value=np.nan, std=np.nan)
    (page, _) = table(listed, {"jug": {"parametrise.label_mapping.radius": 0.01}})
    assert page.axes[0].tables[0][1, 0].get_text().get_text() == "–"
