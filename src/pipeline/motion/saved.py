"""The file of a primitive, promp.json: its schema, and a check of what the schema cannot say."""

from typing import Any

import numpy as np

from pipeline.errors import PipelineError

_NUMBERS = {"type": "array", "minItems": 1, "items": {"type": "number"}}
_TEXTS = {"type": "array", "minItems": 1, "items": {"type": "string"}}
SCHEMA = {
    "$schema": "https://json-schema.org/draft/2020-12/schema",
    "title": "A probabilistic movement primitive of pouring",
    "type": "object",
    "additionalProperties": False,
    "required": [
        *("dimensions", "units", "duration_s", "n_basis", "width"),
        *("weights_mean", "weights_covariance", "noise_variance"),
    ],
    "properties": {
        "dimensions": {**_TEXTS, "description": "names of the D dimensions", "uniqueItems": True},
        "units": {**_TEXTS, "description": "unit of each dimension; 1 is dimensionless"},
        "duration_s": {"type": "number", "exclusiveMinimum": 0, "description": "mean duration, seconds"},
        "n_basis": {"type": "integer", "minimum": 2, "description": "basis functions B a dimension"},
        "width": {
            "type": "number",
            "exclusiveMinimum": 0,
            "description": "standard deviation of one, in the phase",
        },
        "weights_mean": {**_NUMBERS, "description": "D*B numbers, dimension by dimension"},
        "weights_covariance": {"type": "array", "items": _NUMBERS, "description": "D*B rows of D*B numbers"},
        "noise_variance": {
            "type": "array",
            "items": {"type": "number", "minimum": 0},
            "description": "D numbers",
        },
        "learnt_from": {"type": "object", "description": "what it was learnt from, for people"},
    },
}


def fields(content: Any, where: str) -> dict[str, Any]:
    """Return the fields of a `ProMP` in the content of a promp.json; `where` names the file in errors."""
    import jsonschema

    error = next(jsonschema.Draft202012Validator(SCHEMA).iter_errors(content), None)
    if error is not None:
        key = ".".join(map(str, error.absolute_path)) or "the file"
        raise PipelineError(
            f"{where}: expected a primitive as the stage primitives writes it, found {key}: {error.message[:120]}; "
            "make it again or correct it"
        )
    count = len(content["dimensions"])
    n = count * content["n_basis"]
    arrays = {key: array(content[key], where, key) for key in _shapes(count, n)}
    for key, shape in _shapes(count, n).items():
        if arrays[key].shape != shape or not np.isfinite(arrays[key]).all():
            raise PipelineError(
                f"{where}: expected {key} of shape {shape} without gaps for {count} dimensions and {content['n_basis']} basis "
                f"functions, found {arrays[key].shape}; make it again or correct it"
            )
    if len(content["units"]) != count:
        raise PipelineError(
            f"{where}: expected {count} units, found {len(content['units'])}; give each dimension one"
        )
    texts = {key: tuple(content[key]) for key in ("dimensions", "units")}
    return {**arrays, **texts, **{key: content[key] for key in ("n_basis", "width", "duration_s")}}


def _shapes(count: int, n: int) -> dict[str, tuple[int, ...]]:
    return {"weights_mean": (n,), "weights_covariance": (n, n), "noise_variance": (count,)}


def array(value: Any, where: str, key: str) -> np.ndarray:
    """Return rows of numbers as an array; `where` and `key` name them in errors."""
    try:
        return np.array(value, dtype=float)
    except ValueError as error:
        raise PipelineError(f"{where}: expected {key} as even rows of numbers, found {error}") from error
