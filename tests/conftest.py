"""Noisy samples of the demonstration objects' true surfaces, for stages that work on clouds."""

import signal
import sys
from functools import cache

import numpy as np
import pandas as pd
import pytest
from browser import chromium

from pipeline.geometry.sampling import even_points, triangle_areas_and_normals
from pipeline.scan.shapes import shape

PARTS = ["container", "rim", "handle"]

# A shell's background job ignores Ctrl-C and so would each program that a test starts and stops by it.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)


@cache
def sampled(name: str, n: int = 6000, noise_m: float = 0.0001) -> pd.DataFrame:
    """Return points of a demonstration object in the columns of table `labels`, with its true parts."""
    body, rng = shape(name), np.random.default_rng(7)
    points, triangle = even_points(body.vertices_m, body.triangles, n, rng)
    areas, face_normals = triangle_areas_and_normals(body.vertices_m, body.triangles)
    normals = face_normals[triangle]
    noisy = points + normals * rng.normal(0.0, noise_m, (len(points), 1))
    frame = pd.DataFrame(np.hstack([noisy, normals]), columns=["x_m", "y_m", "z_m", "nx", "ny", "nz"])
    parts = body.parts(points, triangle)
    truth = {part: parts[part] for part in PARTS}
    probabilities = {f"p_{part}": parts[part].astype(float) for part in PARTS}
    return frame.assign(area_m2=areas.sum() / len(points), seen=True, **probabilities, **truth)


@pytest.fixture(scope="session")
def browser():
    """Headless Chromium."""
    with chromium() as started:
        yield started


@pytest.fixture(autouse=True)
def _no_figure_stays_open():
    """Close what a test drew: pyplot keeps its figures, and warns of too many."""
    yield
    if "matplotlib.pyplot" in sys.modules:
        sys.modules["matplotlib.pyplot"].close("all")
