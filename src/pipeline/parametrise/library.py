"""The library of warped parameters: what registers them, and what works them out of a cloud.

A parameter is one short pure function. Its arguments name what it needs: another parameter, an ingredient, or a piece of
the cloud (`cloud.PIECES`). To add one, write the function with the mark `parameter` in one of the modules that
`parameters` lists, and its name in `parametrise.parameters` of the configuration and its schema.
"""

import inspect
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from pipeline.errors import PipelineError

Function = Callable[..., Any]


@dataclass(frozen=True)
class Parameter:
    """A registered function, its unit (1: a pure number) and the names of its components, none if it is a scalar."""

    name: str
    unit: str
    parts: tuple[str, ...]
    function: Function

    @property
    def columns(self) -> list[str]:
        """The names of its numbers in tables: `opening_m` with parts x, y, z is opening_x_m, opening_y_m, opening_z_m."""
        end = "" if self.unit == "1" else f"_{self.unit}"
        stem = self.name.removesuffix(end)
        return [f"{stem}_{part}{end}" for part in self.parts] or [self.name]


PARAMETERS: dict[str, Parameter] = {}
INGREDIENTS: dict[str, Function] = {}


def parameter(unit: str, parts: Sequence[str] = ()) -> Callable[[Function], Function]:
    """Register a function as the parameter of its name, which ends with the unit."""

    def register(function: Function) -> Function:
        name = function.__name__
        if unit != "1" and not name.endswith(f"_{unit}"):
            raise PipelineError(f"parameter '{name}': expected a name that ends with its unit, _{unit}")
        PARAMETERS[name] = Parameter(name, unit, tuple(parts), function)
        return function

    return register


def ingredient(function: Function) -> Function:
    """Register a function that parameters build on, but that is none: an array over points, a contour."""
    INGREDIENTS[function.__name__] = function
    return function


def known(names: Iterable[str]) -> list[Parameter]:
    """Return the named parameters; a `PipelineError` names one that is not registered."""
    names = list(names)
    for name in names:
        if name not in PARAMETERS:
            raise PipelineError(
                f"parameter '{name}' is unknown; correct parametrise.parameters, there are {' '.join(sorted(PARAMETERS))}"
            )
    return [PARAMETERS[name] for name in names]


def evaluate(names: Iterable[str], pieces: Mapping[str, Any]) -> dict[str, Any]:
    """Return the named parameters and ingredients, and all that they build on, of a cloud given as its pieces."""
    values = dict(pieces)
    for name in names:
        _evaluate(name, values)
    return values


def numbers(names: Iterable[str], values: Mapping[str, Any]) -> dict[str, float]:
    """Return what `evaluate` found of the named parameters as one flat dictionary, column: number."""
    return {
        column: float(number)
        for found in known(names)
        for column, number in zip(found.columns, np.ravel(values[found.name]), strict=True)
    }


def _evaluate(name: str, values: dict[str, Any]) -> Any:
    if name not in values:
        function = INGREDIENTS.get(name) or known([name])[0].function
        needs = inspect.signature(function).parameters
        values[name] = function(**{need: _evaluate(need, values) for need in needs})
    return values[name]
