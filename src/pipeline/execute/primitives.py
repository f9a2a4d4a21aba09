"""A motor primitive at a pair: its distribution in the pair's metres and radians, and where it believes lip and opening to be."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from pipeline.artefacts import read_json
from pipeline.execute import pairs
from pipeline.execute.task import Task
from pipeline.motion import scaling
from pipeline.motion.conditioned import CONDITIONED, ConditionedProMP, log_parameters
from pipeline.motion.promp import ProMP

SLOWEST = 10.0  # times as long as the demonstrations: nobody waits for more
FLOW_DEPTH = 0.1  # of what comes over the lip, in radii of the opening that it goes into
Pair = tuple[str, str]
_PHASES = np.linspace(0.0, 1.0, 201)


@dataclass(frozen=True)
class Primitive:
    """promp: its own units, times factors (4,) metres and radians in the frame of `task`; pair: held object, second container.

    duration_s: of an execution. further: how much nearer to the opening's centre the lip is, in its radii. steeper: by which
    tilts are stretched beyond one, where what is poured begins to flow.
    """

    promp: ProMP
    factors: np.ndarray
    task: Task
    pair: Pair
    duration_s: float
    further: float = 0.0
    steeper: float = 1.0

    def samples(
        self, phase: np.ndarray, count: int, rng: np.random.Generator, higher: float = 0.0
    ) -> np.ndarray:
        """Return trajectories (count, T, 4) in metres and radians: the same random numbers are alike for all feature sets.

        higher: than drawn, in the primitive's own standard deviations of z.
        """
        drawn = self.promp.samples(phase, count, rng)
        drawn[..., 0] += self.further
        drawn[..., 2] += higher * self.promp.deviation(phase)[:, 2]
        drawn[..., 3] += (self.steeper - 1.0) * np.maximum(drawn[..., 3] - 1.0, 0.0)
        return self.factors * drawn


def read(path: Path, parameters: pd.DataFrame, features: str, pair: Pair, demonstrated: Pair) -> Primitive:
    """Read promp.json of a feature set, scaled to the pair; `conditioned`: given the pair's parameters by label mapping."""
    content = read_json(path)
    if features == CONDITIONED:
        learnt = ConditionedProMP.from_json(content, str(path))
        promp = learnt.given(log_parameters(parameters, "label_mapping", *pair))
        task = pairs.task(parameters, "label_mapping", *pair, demonstrated)
        return Primitive(promp, np.ones(4), task, pair, promp.duration_s)
    promp, factors = ProMP.from_json(content, str(path)), scaling.factors(parameters, features, *pair)
    task = pairs.task(parameters, features, *pair, demonstrated)
    if features == pairs.STANDARD:
        return Primitive(promp, factors, task, pair, promp.duration_s)
    known = parameters, features, pair, demonstrated
    duration_s = promp.duration_s * slower(*known)
    return Primitive(promp, factors, task, pair, duration_s, further(*known), steeper(promp, *known))


def slower(parameters: pd.DataFrame, features: str, pair: Pair, demonstrated: Pair) -> float:
    """Return by how much more slowly than shown to pour, so that the flow is as shown for the opening it goes into."""
    there, shown = (scaling.pouring_s(parameters, features, *each) for each in (pair, demonstrated))
    return float(np.clip(there / shown, 1.0, SLOWEST))


def further(parameters: pd.DataFrame, features: str, pair: Pair, demonstrated: Pair) -> float:
    """Return how much nearer to the opening's centre than shown the lip must be, in radii, as the flow's arc reaches back more.

    Liquid d deep over the lip of a rim that is tilted by a comes over an arc that ends d / sin a behind the lip.
    """
    there, shown = (scaling.factors(parameters, features, *each)[3] for each in (pair, demonstrated))
    return FLOW_DEPTH * max(1.0 / np.sin(there) - 1.0 / np.sin(shown), 0.0)


def steeper(promp: ProMP, parameters: pd.DataFrame, features: str, pair: Pair, demonstrated: Pair) -> float:
    """Return by how much tilts beyond one must be stretched for the held to be emptied as far as the demonstrated cup was."""
    largest = float(promp.mean(_PHASES)[:, 3].max())
    if largest <= 1.0:
        return 1.0
    emptied, shown = (
        scaling.emptied_rad(parameters, features, held)
        / scaling.factors(parameters, features, held, target)[3]
        for held, target in (pair, demonstrated)
    )
    return max((min(largest / shown, 1.0) * emptied - 1.0) / (largest - 1.0), 1.0)
