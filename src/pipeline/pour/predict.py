"""Say how likely a cup pours, or (--into) fills a second container.

With the classifiers that the last run learnt from trials of one object; what is asked is made dimensionless by the object's
warped parameters. In Python: pipeline.predictions.Predictor. Over HTTP: the model of a run in MLflow, asked for the `features`
that --json writes.
"""

import argparse
import math
from dataclasses import asdict

from pipeline.errors import PipelineError
from pipeline.pour.project import Project
from pipeline.pour.quantities import angle_rad, length_m, volume_m3
from pipeline.predictions import MAPPINGS, Prediction, Predictor


def options(parser: argparse.ArgumentParser) -> None:
    """Add this subcommand's options."""
    parser.add_argument("object", help="the cup that is held")
    parser.add_argument("--fill", required=True, help="liquid in it: 60%% of its capacity, or 150ml")
    parser.add_argument(
        "--tilt", required=True, help="how far it is tilted about its lip: 45 (degrees), 0.8rad"
    )
    parser.add_argument("--into", metavar="OBJECT", help="the container that is to be filled")
    parser.add_argument("--into-fill", metavar="FILL", help="liquid in that container; 0%% when not given")
    parser.add_argument(
        "--along", help="lip from the centre of its opening, along the pour; one radius of it when not given"
    )
    parser.add_argument("--across", help="and across the pour; 0mm when not given")
    parser.add_argument("--height", help="lip above the centre of its opening; 50mm when not given")
    parser.add_argument("--mapping", choices=MAPPINGS, default=MAPPINGS[0], help="whose parameters are used")
    parser.add_argument(
        "--learnt-from", metavar="OBJECT", help="the object of the trials; without it the source"
    )


def call(options: argparse.Namespace) -> dict:
    """Return the probability and what is behind it."""
    project = Project(options.project)
    source = project.source()
    name, learnt = project.check(options.object), project.check(options.learnt_from or source)
    project.made(f"parametrise/{source}/parameters.parquet")
    predictor = Predictor(project.processed, source, mapping=options.mapping, training_object=learnt)
    second = project.check(options.into) if options.into else None
    if second is None:
        _check_alone(options)
    found = _asked(predictor, name, second, options)
    return {"object": name, "into": second, **asdict(found)}


def _check_alone(options: argparse.Namespace) -> None:
    """Refuse what is said of a second container when there is none: it would change nothing."""
    of_second = ("into_fill", "along", "across", "height")
    for name in of_second:
        if (value := getattr(options, name)) is not None:
            raise PipelineError(
                f"--{name.replace('_', '-')} {value}: expected a second container, found none; name it with --into"
            )


def _asked(predictor: Predictor, name: str, second: str | None, options: argparse.Namespace) -> Prediction:
    pour = {
        "fill_m3": volume_m3(options.fill, "--fill", predictor.parameters(name)["capacity_m3"]),
        "tilt_rad": angle_rad(options.tilt, "--tilt"),
    }
    if second is None:
        return predictor.pouring(name, **pour)
    if second == name:
        raise PipelineError(
            f"--into {second}: expected another object than the cup that is held, found the same; name another"
        )
    return predictor.filling(
        name,
        second,
        **pour,
        second_fill_m3=volume_m3(
            options.into_fill or "0%", "--into-fill", predictor.parameters(second)["capacity_m3"]
        ),
        along_m=length_m(options.along, "--along")
        if options.along
        else predictor.parameters(second)["radius_m"],
        across_m=length_m(options.across or "0mm", "--across"),
        height_m=length_m(options.height or "50mm", "--height"),
    )


def text(result: dict) -> str:
    """Return the result in words."""
    held, what = result["parameters"]["held"], result["variables"]
    share = what["fill_m3"] / held["capacity_m3"]
    verb = f"fills {result['into']}" if result["into"] else "pours"
    return "\n".join(
        [
            f"{result['object']}, {share:.0%} full, tilted by {math.degrees(what['tilt_rad']):.0f}°, {verb} with probability "
            f"{result['probability']:.2f} (± {result['spread']:.2f} over {result['n_classifiers']} classifiers "
            f"learnt from {result['training_object']})",
            *(f"  {line}" for line in _behind(result)),
            *(f"  {line}" for line in _beyond(result)),
        ]
    )


def _behind(result: dict) -> list[str]:
    """Return one line a feature: what was asked, by what it is divided."""
    held, second = result["parameters"]["held"], result["parameters"].get("second", {})
    asked = result["variables"]
    rows = {
        "tilt": ("tilt", f"{math.degrees(asked['tilt_rad']):.1f}°", "tilt reference", _degrees(held)),
        "fill": ("fill", _ml(asked["fill_m3"]), "hull volume", _ml(held["volume_m3"])),
    }
    if second:
        rows |= {
            "second_fill": (
                "its fill",
                _ml(asked["second_fill_m3"]),
                "its hull volume",
                _ml(second["volume_m3"]),
            ),
            "height": ("height", _mm(asked["dz_m"]), "height of the cup", _mm(held["height_m"])),
            "along": ("along", _mm(asked["abs_dx_m"]), "its radius", _mm(second["radius_m"])),
            "across": ("across", _mm(asked["abs_dy_m"]), "its radius", _mm(second["radius_m"])),
        }
    return [
        f"{what:<9}{value:>9} / {by + ' ' + reference:<28} = {result['features'][name]:.2f}"
        for name, (what, value, by, reference) in rows.items()
    ]


def _beyond(result: dict) -> list[str]:
    """Return a line for each feature that the classifiers have seen nothing like."""
    return [
        f"beyond what was learnt: {name.replace('_', ' ')} of {result['features'][name]:.2f}, trials had {mean:.2f} ± {std:.2f}"
        for name, (mean, std) in result["beyond"].items()
    ]


def _degrees(held: dict) -> str:
    return f"{math.degrees(held['tilt_reference_rad']):.1f}°"


def _ml(value_m3: float) -> str:
    return f"{value_m3 * 1e6:.0f} ml"


def _mm(value_m: float) -> str:
    return f"{value_m * 1e3:.0f} mm"
