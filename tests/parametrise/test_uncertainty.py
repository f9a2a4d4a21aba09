"""Uncertainties against the spread of parameters over clouds that are really drawn anew."""

import numpy as np
import pandas as pd
import pytest
from parametrise.clouds import cloud

from pipeline.artefacts import points
from pipeline.geometry.sampling import even_points, triangle_areas_and_normals
from pipeline.parametrise.cloud import evened, warped
from pipeline.parametrise.parameters import evaluate, numbers
from pipeline.parametrise.uncertainty import estimates, spread
from pipeline.scan import truth
from pipeline.scan.shapes import shape


def _scan(seed: int):
    """Return points spaced evenly on a short cup, with the noise of a fused scan."""
    body, rng = shape("short_cup"), np.random.default_rng(seed)
    points_m, triangle = even_points(body.vertices_m, body.triangles, 4000, rng)
    areas, facing = triangle_areas_and_normals(body.vertices_m, body.triangles)
    noisy_m = points_m + facing[triangle] * rng.normal(0.0, 0.00015, (len(points_m), 1))
    table = pd.DataFrame(
        np.hstack([noisy_m, facing[triangle]]), columns=["x_m", "y_m", "z_m", "nx", "ny", "nz"]
    )
    parts = {part: body.parts(points_m, triangle)[part] for part in ("container", "rim", "handle")}
    return warped(table.assign(area_m2=areas.sum() / len(points_m), valid=True, **parts), name="short_cup")


def test_uncertainties_are_the_spread_over_clouds_drawn_anew():
    names = ["radius_m", "opening_m", "volume_m3", "capacity_m3", "tilt_reference_cavity_rad", "wall_m"]
    drawn = [numbers(names, evaluate(names, _scan(seed).pieces(1500))) for seed in range(12)]
    said = spread(names, _scan(100), 20, np.random.default_rng(1))
    ratio = said / np.array([list(values.values()) for values in drawn]).std(axis=0, ddof=1)
    assert np.all((ratio > 0.3) & (ratio < 3.0)), dict(zip(drawn[0], ratio, strict=True))


def test_estimates_are_a_row_a_number_and_the_same_for_the_same_seed():
    one, two = (
        estimates(["radius_m", "retained_m3"], cloud("mug"), 2000, 4, np.random.default_rng(3))
        for _ in range(2)
    )
    assert one.equals(two)
    assert list(one["parameter"][:3]) == ["radius_m", "retained_000_deg_m3", "retained_015_deg_m3"]
    assert set(one["unit"]) == {"m", "m3"}


@pytest.mark.parametrize("name", ["mug", "wide_bowl"])
def test_evened_points_lie_nearer_to_the_surface_than_noisy_ones(name):
    body, rng = shape(name), np.random.default_rng(5)
    table = truth.cloud(body, 6000, rng)
    true_m, n = points(table), table[["nx", "ny", "nz"]].to_numpy()
    off_m = rng.normal(0.0, 0.0002, len(true_m))
    left_m = np.einsum("nc,nc->n", evened(true_m + n * off_m[:, None], n) - true_m, n)
    assert left_m.std() < 0.75 * off_m.std()
    assert abs(left_m.mean()) < 3e-5
