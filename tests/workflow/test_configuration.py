"""The schema is closed and says what each key means; the shipped files fit it."""

from pathlib import Path

import pytest
import yaml

from pipeline.errors import PipelineError
from pipeline.parametrise.parameters import PARAMETERS
from pipeline.scan.shapes import NAMES
from pipeline.workflow.configuration import check, nearest, typed

ROOT = Path(__file__).parents[2]
SCHEMA = yaml.safe_load((ROOT / "workflow/schemas/config.schema.yaml").read_text())


def _config() -> dict:
    return yaml.safe_load((ROOT / "config/config.yaml").read_text())


def _sections(schema, name=""):
    yield name, schema
    for key, inner in schema.get("properties", {}).items():
        yield from _sections(inner, f"{name}.{key}")


def test_the_shipped_configuration_has_every_key_and_fits():
    check(_config(), SCHEMA)
    for name, section in _sections(SCHEMA):
        if section["type"] == "object":
            assert section["additionalProperties"] is False, name
            assert set(section["required"]) == set(section["properties"]), name


def test_every_key_is_explained_and_every_number_has_a_unit_and_a_range():
    units = ("metres", "degrees", "count", "no unit", "share", "radii", "heights", "particles", "Factor")
    for name, key in _sections(SCHEMA):
        if name:
            assert key["description"].endswith("."), name
        number = key.get("items", key)
        if number["type"] in ("number", "integer"):
            assert any(unit in key["description"] for unit in units), name
            assert "minimum" in number or "exclusiveMinimum" in number, name


def test_demonstration_objects_agree_with_the_shapes():
    assert tuple(SCHEMA["properties"]["scan"]["properties"]["objects"]["items"]["enum"]) == tuple(NAMES)


def test_listed_parameters_agree_with_the_registered_ones():
    listed = SCHEMA["properties"]["parametrise"]["properties"]["parameters"]["items"]["enum"]
    assert sorted(listed) == sorted(PARAMETERS)
    config = _config()
    config["parametrise"]["parameters"] = ["radius_m", "volum_m3"]
    with pytest.raises(PipelineError, match=r"parametrise\.parameters\.1: .*did you mean 'volume_m3'"):
        check(config, SCHEMA)


def test_texts_become_numbers_where_numbers_are_asked_for():
    config = _config()
    config["fuse"]["voxel_m"], config["scan"]["views"], config["track"]["enabled"] = "1e-3", "20", "False"
    config["track"]["experiment"] = "12"
    read = typed(config, SCHEMA)
    assert (read["fuse"]["voxel_m"], read["scan"]["views"]) == (0.001, 20)
    assert read["track"] == {"enabled": False, "experiment": "12"}


@pytest.mark.parametrize("value", [True, None, [], float("nan")])
def test_no_other_type_passes_for_a_number(value):
    config = _config()
    config["fuse"]["voxel_m"] = value
    with pytest.raises(PipelineError, match=r"^fuse\.voxel_m: expected"):
        check(config, SCHEMA)


def test_a_card_is_for_the_liquid_alone():
    config = _config()
    config["simulate"]["device"] = "cuda"
    check(config, SCHEMA)
    config["simulate"]["engine"] = "bullet"
    with pytest.raises(
        PipelineError, match=r"^simulate\.device: expected cpu with simulate\.engine bullet, found cuda"
    ):
        check(config, SCHEMA)


def test_nearest_proposes_only_what_is_near():
    assert nearest("voxl_m", ["voxel_m", "points"]) == " (did you mean 'voxel_m'?)"
    assert nearest("abc", ["voxel_m", "points"]) == ""
    assert nearest("MUG", ["jug", "mug", "my_mug"]) == " (did you mean 'mug'?)"
    assert nearest("My-Mug", ["jug", "mug", "my_mug"]) == " (did you mean 'my_mug'?)"


@pytest.mark.parametrize(
    ("pairs", "said"),
    [
        (["mug/wide_bowl"], "two pairs at least or none, found mug/wide_bowl alone"),
        (["mug/wide_bowl", "tall_cup/wide_bowl"], "found tall_cup/wide_bowl in both"),
    ],
)
def test_what_is_shown_is_several_pairs_and_not_what_is_tested(pairs, said):
    config = _config()
    config["primitives"]["pairs"] = pairs
    with pytest.raises(PipelineError, match=rf"^primitives\.pairs: .*{said}"):
        check(config, SCHEMA)
    config["primitives"]["pairs"] = []
    check(config, SCHEMA)
