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


@dataclass(frozen=True)
class Primitive:
    """promp: its own units, times factors (4,) metres and radians in the frame of `task`; pair: held object, second container."""

    promp: ProMP
    factors: np.ndarray
    task: Task
    pair: tuple[str, str]

    def samples(self, phase: np.ndarray, count: int, rng: np.random.Generator) -> np.ndarray:
        """Return trajectories (count, T, 4) in metres and radians: the same random numbers are alike for all feature sets."""
        return self.factors * self.promp.samples(phase, count, rng)


def read(
    path: Path, parameters: pd.DataFrame, features: str, pair: tuple[str, str], demonstrated: tuple[str, str]
) -> Primitive:
    """Read promp.json of a feature set, scaled to the pair; `conditioned`: given the pair's parameters by label mapping."""
    content = read_json(path)
    if features == CONDITIONED:
        learnt = ConditionedProMP.from_json(content, str(path))
        promp = learnt.given(log_parameters(parameters, "label_mapping", *pair))
        return Primitive(
            promp, np.ones(4), pairs.task(parameters, "label_mapping", *pair, demonstrated), pair
        )
    promp, factors = ProMP.from_json(content, str(path)), scaling.factors(parameters, features, *pair)
    return Primitive(promp, factors, pairs.task(parameters, features, *pair, demonstrated), pair)
