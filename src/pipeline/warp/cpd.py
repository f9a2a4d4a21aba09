"""Coherent point drift (Myronenko & Song 2010) from the coarse alignment on, by pycpd."""

from dataclasses import replace

import numpy as np

from pipeline.warp import nearest_neighbour
from pipeline.warp.clouds import Cloud, drawn, subset
from pipeline.warp.deformation import Chain, Kernels
from pipeline.warp.warp import Warp

SOURCE_POINTS, TARGET_POINTS = 500, 1200
# The paper's defaults for clouds of unit variance.
WIDTH, STIFFNESS = 2.0, 2.0
OUTLIERS = 0.05
ITERATIONS, TOLERANCE = 60, 1e-4


def fit(source: Cloud, target: Cloud, *, rng: np.random.Generator) -> Warp:
    """Return the coarse alignment bent by Gaussian kernels about some of the source's points.

    It sees points alone, no normals: hence what it does to the two sides of a wall is only mended by the mapping's check.
    """
    from pycpd import DeformableRegistration

    warp = nearest_neighbour.coarse(source, target)
    moving_m = drawn(subset(warp.aligned, warp.has_counterpart), SOURCE_POINTS, rng).points_m
    fixed_m = drawn(target, TARGET_POINTS, rng).points_m
    middle_m, size_m = fixed_m.mean(axis=0), float(fixed_m.std())
    drift = DeformableRegistration(
        X=(fixed_m - middle_m) / size_m,
        Y=(moving_m - middle_m) / size_m,
        alpha=STIFFNESS,
        beta=WIDTH,
        w=OUTLIERS,
        max_iterations=ITERATIONS,
        tolerance=TOLERANCE,
    )
    drift.register()
    bent = Kernels(np.eye(3), np.zeros(3), moving_m, size_m * drift.W, size_m * WIDTH)
    diagnostics = {"iterations": float(drift.iteration), "sigma_m": float(size_m * np.sqrt(drift.sigma2))}
    return replace(warp, method="cpd", deformation=Chain(warp.deformation, bent), diagnostics=diagnostics)
