"""Say of every listed parameter what it is and how sure: its spread when the cloud's points are drawn again (local bootstrap)."""

import zlib
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas as pd
from scipy.spatial import cKDTree

from pipeline import command
from pipeline.artefacts import read_table, write_table
from pipeline.parametrise import cloud
from pipeline.parametrise.parameters import evaluate, known, numbers

HULL_POINTS = 1500  # in the hull of a redrawn cloud: enough for a spread
NEAREST, TURN_M = 3, 0.01


def main() -> None:
    """Read both mappings; write a row a number with its value, its standard deviation and its unit."""
    parser = command.parser(__doc__)
    parser.add_argument("--object", required=True, help="name of the object")
    for option in ("--point-mapping", "--label-mapping", "--uncertainties"):
        parser.add_argument(option, type=Path, required=True)
    parser.add_argument("--parameters", nargs="+", required=True, help="names of registered parameters")
    parser.add_argument("--hull-points", type=int, default=8000, help="points that fill the hull")
    parser.add_argument("--redraws", type=int, default=20, help="clouds that are drawn again")
    parser.add_argument("--seed", type=int, default=6)
    options = parser.parse_args()

    known(options.parameters)
    paths = {"point_mapping": options.point_mapping, "label_mapping": options.label_mapping}
    tables = []
    for mapping, path in paths.items():
        warped = cloud.warped(read_table(path, "mapping"), name=options.object)
        rng = np.random.default_rng([options.seed, zlib.crc32(options.object.encode())])
        found = estimates(options.parameters, warped, options.hull_points, options.redraws, rng)
        tables.append(found.assign(object=options.object, mapping=mapping))
    write_table(options.uncertainties, pd.concat(tables), "uncertainties")


def estimates(
    names: Sequence[str], warped: cloud.Cloud, hull_points: int, redraws: int, rng: np.random.Generator
) -> pd.DataFrame:
    """Return the named parameters of a warped cloud, a row a number: parameter, value, std, unit."""
    value = numbers(names, evaluate(names, warped.pieces(hull_points)))
    units = [found.unit for found in known(names) for _ in found.columns]
    std = spread(names, warped, redraws, rng)
    return pd.DataFrame({"parameter": list(value), "value": list(value.values()), "std": std, "unit": units})


def spread(names: Sequence[str], warped: cloud.Cloud, redraws: int, rng: np.random.Generator) -> np.ndarray:
    """Return the standard deviation of every number of the named parameters over redrawn clouds.

    Clouds are spaced evenly: points drawn from all of one with replacement would have gaps that no scan has, and spreads three
    times too wide. So each point is replaced by one of its nearest (a local bootstrap). It is what noise and sampling make
    uncertain, with the labels as they are; a bias that all points share does not show.
    """
    near = _nearest(warped)
    rows = np.arange(len(near))
    drawn = [
        list(numbers(names, evaluate(names, warped.pieces(HULL_POINTS, near[rows, choice]))).values())
        for choice in rng.integers(NEAREST, size=(redraws, len(near)))
    ]
    return np.std(drawn, axis=0, ddof=1)


def _nearest(warped: cloud.Cloud) -> np.ndarray:
    """Return the rows (N, 3) of each point's nearest of the same side of the wall, itself among them."""
    # A turned normal counts as far as a wall is from its other side, and more.
    places = np.hstack([warped.points_m, TURN_M * warped.normals])
    return cKDTree(places).query(places, k=NEAREST)[1]


if __name__ == "__main__":
    command.run(main)
