"""The configuration is checked before anything runs: against its schema, then key against key."""

import difflib
import math
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from pipeline.errors import PipelineError


def check(config: dict, schema: dict) -> None:
    """Raise a `PipelineError` for the first thing in `config` that `schema` or another key does not allow."""
    import jsonschema

    errors = jsonschema.Draft202012Validator(schema).iter_errors(config)
    first = min(errors, key=_order, default=None)
    if first is not None:
        raise PipelineError(_sentence(first))
    _check_finite(config, "")
    _check_pairs(config)


def typed(config: Any, schema: dict) -> Any:
    """Return `config` with texts turned into the numbers and switches that `schema` asks for, where they can be read so.

    YAML reads 1e-3 as text, and Snakemake's `--config section={key: 1}` makes texts of all values.
    """
    if isinstance(config, dict):
        properties = schema.get("properties", {})
        return {key: typed(value, properties.get(key, {})) for key, value in config.items()}
    if isinstance(config, list):
        return [typed(value, schema.get("items", {})) for value in config]
    reader: Any = {"integer": int, "number": float, "boolean": _switch}.get(str(schema.get("type")))
    if isinstance(config, str) and reader:
        try:
            return reader(config)
        except ValueError:
            return config
    return config


def _switch(text: str) -> bool:
    if text.lower() not in ("true", "false"):
        raise ValueError(text)
    return text.lower() == "true"


def _order(error: Any) -> tuple[bool, list[str]]:
    # A misspelt key is also a missing one: say the former.
    return error.validator != "additionalProperties", list(map(str, error.absolute_path))


def check_annotation(folder: str | Path, source: str) -> str:
    """Return the path of the source's annotation below `folder`; it must exist."""
    path = Path(folder) / f"{source}.parquet"
    if not path.is_file():
        found = sorted(file.stem for file in Path(folder).glob("*.parquet"))
        raise PipelineError(
            f"{path}: expected the human annotation of objects.source '{source}', found annotations of "
            f"{' '.join(found) or 'no object'}; choose one of these as source, or annotate it (pour annotate {source})"
        )
    return str(path)


def nearest(name: str, known: Iterable[str]) -> str:
    """Return ' (did you mean …?)' for the most similar of `known`, or nothing."""
    written = {_plain(word): word for word in sorted(known)}
    close = difflib.get_close_matches(_plain(name), written, n=1, cutoff=0.6)
    return f" (did you mean '{written[close[0]]}'?)" if close else ""


def _plain(name: str) -> str:
    """Return a name without what people write in more than one way: My-Mug and my_mug are one."""
    return name.lower().replace("-", "_")


def _sentence(error: Any) -> str:
    key = ".".join(str(part) for part in error.absolute_path) or "the configuration"
    if error.validator == "additionalProperties":
        known = error.schema.get("properties", {})
        name = next(name for name in error.instance if name not in known)
        dotted = ".".join([*(str(part) for part in error.absolute_path), str(name)])
        proposal = nearest(str(name), known)
        return f"{dotted}: expected one of the keys {' '.join(known)}, found '{name}'{proposal}; correct or remove it"
    if error.validator == "required":
        missing = next(name for name in error.validator_value if name not in error.instance)
        return f"{key}: expected the key '{missing}', found none; take it from config/config.yaml"
    return f"{key}: expected {_expected(error)}, found {error.instance!r}; {_advice(error)}"


def _expected(error: Any) -> str:
    value = error.validator_value
    words = {
        "type": f"a value of type {value}",
        "enum": f"one of {value}",
        "minimum": f"at least {value}",
        "maximum": f"at most {value}",
        "exclusiveMinimum": f"more than {value}",
        "exclusiveMaximum": f"less than {value}",
        "minItems": f"at least {value} entries",
        "uniqueItems": "every entry once",
        "pattern": f"text like {value}",
    }
    meaning = error.schema.get("description", "")
    return words.get(error.validator, error.message) + (f" ({meaning.rstrip('.')})" if meaning else "")


def _advice(error: Any) -> str:
    if error.validator == "enum" and isinstance(error.instance, str):
        return f"correct it{nearest(error.instance, map(str, error.validator_value))}"
    return "correct it"


def _check_finite(config: Any, key: str) -> None:
    for name, value in config.items():
        if isinstance(value, dict):
            _check_finite(value, f"{key}{name}.")
        elif isinstance(value, float) and not math.isfinite(value):  # passes every range of the schema
            raise PipelineError(f"{key}{name}: expected a finite number, found {value}; correct it")


def _check_pairs(config: dict) -> None:
    simulate = config["simulate"]
    pouring, filling = simulate["pouring"], simulate["filling"]
    for name, section in (("pouring", pouring), ("filling", filling)):
        _below(
            "classify.samples", config["classify"]["samples"], f"simulate.{name}.trials", section["trials"]
        )
        most = max(config["classify"]["learning_samples"])
        _below("classify.learning_samples", most, f"simulate.{name}.trials", section["trials"])
    _below("classify.samples", config["classify"]["samples"], "ablate.trials", config["ablate"]["trials"])
    if simulate["device"] == "cuda" and simulate["engine"] != "liquid":
        raise PipelineError(
            f"simulate.device: expected cpu with simulate.engine {simulate['engine']}, found cuda, which computes the "
            "liquid alone; set it to cpu"
        )
    _below("simulate.pouring.fill_min", pouring["fill_min"], "fill_max", pouring["fill_max"])
    _below("simulate.filling.height_min", filling["height_min"], "height_max", filling["height_max"])
    voxel_m, truncation_m = config["fuse"]["voxel_m"], config["fuse"]["truncation_m"]
    if truncation_m < 2 * voxel_m:  # below, marching cubes loses inner walls
        raise PipelineError(
            f"fuse.truncation_m: expected at least two voxels ({2 * voxel_m} m), found {truncation_m}; "
            "raise it or lower fuse.voxel_m"
        )
    _check_shown(config["primitives"]["pairs"], config["execute"]["pairs"])


def _check_shown(shown: list[str], executed: list[str]) -> None:
    if len(shown) == 1:
        raise PipelineError(
            f"primitives.pairs: expected two pairs at least or none, found {shown[0]} alone; add another or take it out"
        )
    if both := sorted(set(shown) & set(executed)):
        raise PipelineError(
            f"primitives.pairs: expected pairs that are not tested in execute.pairs, found {both[0]} in both; take it out of one"
        )


def _below(key: str, value: float, other: str, limit: float) -> None:
    if not value < limit:
        raise PipelineError(
            f"{key}: expected less than {other} ({limit}), found {value}; lower it or raise {other}"
        )
