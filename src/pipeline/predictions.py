"""What the classifiers of the last run say of a pour that has not happened: probability, its spread, what is behind it."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from pipeline.artefacts import read_table
from pipeline.errors import PipelineError
from pipeline.models import Model, beyond, chosen, mean_probability, read_models

PARAMETERS = ("tilt_reference_rad", "volume_m3", "height_m", "radius_m", "capacity_m3")
MAPPINGS = ("label_mapping", "point_mapping")


@dataclass(frozen=True)
class Prediction:
    """Probability of pouring or filling: mean and standard deviation over the classifiers, and what they were asked.

    `features` are α/α_r by name, `variables` the α and `parameters` those of the containers `held` and `second`, in SI units.
    `beyond` has the features that are far from all that was learnt from, with its mean and standard deviation.
    """

    experiment: str
    probability: float
    spread: float
    n_classifiers: int
    training_object: str
    mapping: str
    features: dict[str, float]
    beyond: dict[str, tuple[float, float]]
    variables: dict[str, float]
    parameters: dict[str, dict[str, float]]


class Predictor:
    """Predicts from the files of one run, which are read once."""

    def __init__(
        self, processed: str | Path, source: str, *, mapping: str = "label_mapping", training_object: str
    ) -> None:
        """Take the folder data/processed, the annotated object, and whose 50 trials the classifiers learnt from."""
        self._processed, self._mapping, self._training_object = Path(processed), mapping, training_object
        table = read_table(self._processed / "parametrise" / source / "parameters.parquet", "parameters")
        self._table = table[table["mapping"] == mapping].set_index("object")
        self._models: dict[str, list[Model]] = {}

    def parameters(self, name: str) -> dict[str, float]:
        """Return an object's warped parameters, SI units."""
        if name not in self._table.index:
            raise PipelineError(
                f"{name}: expected an object with warped parameters ({' '.join(self._table.index)}), found none; "
                "run: snakemake -c2 reports/roc.pdf"
            )
        return {key: float(self._table.loc[name, key]) for key in PARAMETERS}

    def pouring(self, name: str, *, fill_m3: float, tilt_rad: float) -> Prediction:
        """Return how likely a cup with `fill_m3` of liquid that is tilted to `tilt_rad` about its lip pours."""
        return self._predict(
            "pouring", {"tilt_rad": tilt_rad, "fill_m3": fill_m3}, {"held": self.parameters(name)}
        )

    def filling(
        self,
        name: str,
        second: str,
        *,
        fill_m3: float,
        tilt_rad: float,
        second_fill_m3: float,
        along_m: float,
        across_m: float,
        height_m: float,
    ) -> Prediction:
        """Return how likely all liquid of a cup ends in a second container.

        The offset is that of the cup's lip from the centre of the second's opening before tilting: along the pour, across
        it, and up. The lip is that of the cup alone.
        """
        variables = {"tilt_rad": tilt_rad, "fill_m3": fill_m3, "second_fill_m3": second_fill_m3}
        variables |= {"dz_m": height_m, "abs_dx_m": abs(along_m), "abs_dy_m": abs(across_m)}
        containers = {"held": self.parameters(name), "second": self.parameters(second)}
        return self._predict("filling", variables, containers)

    def _predict(
        self,
        experiment: str,
        variables: dict[str, float],
        parameters: Mapping[str, dict[str, float]],
    ) -> Prediction:
        models = chosen(self._of(experiment), self._mapping, self._training_object)
        values = models[0].feature_values(variables, parameters)
        mean, spread = mean_probability(models, values)
        return Prediction(
            experiment=experiment,
            probability=float(mean[0]),
            spread=float(spread[0]),
            n_classifiers=len(models),
            training_object=self._training_object,
            mapping=self._mapping,
            features=dict(zip(models[0].feature_names, map(float, values[0]), strict=True)),
            beyond=beyond(models, values),
            variables=variables,
            parameters=dict(parameters),
        )

    def _of(self, experiment: str) -> list[Model]:
        if experiment not in self._models:
            self._models[experiment] = classifiers(self._processed, experiment)
        return self._models[experiment]


def classifiers(processed: str | Path, experiment: str) -> list[Model]:
    """Return all classifiers that the last run learnt of an experiment, from the folder data/processed."""
    path = Path(processed) / "classify" / experiment / "models.json"
    if not path.is_file():
        raise PipelineError(
            f"{path}: expected the classifiers of a run, found none; run: snakemake -c2 reports/roc.pdf"
        )
    return read_models(path)
