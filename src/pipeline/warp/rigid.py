"""Rigid alignment alone: part frame onto part frame, at the source's own size."""

from dataclasses import replace

import numpy as np

from pipeline.warp import nearest_neighbour
from pipeline.warp.clouds import Cloud
from pipeline.warp.deformation import PartStretch
from pipeline.warp.stretch import linear
from pipeline.warp.warp import Warp


def fit(source: Cloud, target: Cloud, *, rng: np.random.Generator) -> Warp:
    """Return the source moved and turned onto the target, not scaled: what the other methods are measured against."""
    warp = nearest_neighbour.coarse(source, target)
    frames = warp.source_frame.T_object_part, warp.target_frame.T_object_part
    return replace(warp, method="rigid", deformation=PartStretch(*frames, linear(np.ones(3))))
