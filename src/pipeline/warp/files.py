"""Warps as files: what a method found, to be joined with the clouds that it was found for."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from pipeline.artefacts import read_arrays, write_arrays
from pipeline.errors import PipelineError
from pipeline.warp.alignment import PartFrame
from pipeline.warp.clouds import Cloud
from pipeline.warp.deformation import Chain, Deformation, Kernels, PartStretch
from pipeline.warp.shape_space import example
from pipeline.warp.stretch import Stretch
from pipeline.warp.warp import Warp

FRAME = ("T_object_part", "spread_m", "roll_symmetry", "handles", "rim_low_m")
KERNELS = ("affine", "offset_m", "centres_m", "weights", "width_m")
STRETCH = ("knots_m", "scale", "offset_m")


def save(path: str | Path, warp: Warp) -> None:
    """Write a warp's method, frames, deformation and diagnostics as NPZ; the clouds stay in their own files."""
    arrays = {
        "method": np.array(warp.method),
        "points": np.array([len(warp.source.points_m), len(warp.target.points_m)]),
        "diagnostics": np.array(list(warp.diagnostics.values()), float),
        "diagnostics_names": np.array(list(warp.diagnostics), str),
        **_deformation_arrays(warp.deformation),
    }
    for side, frame in (("source", warp.source_frame), ("target", warp.target_frame)):
        arrays |= {f"{side}_{name}": np.asarray(getattr(frame, name)) for name in FRAME}
    write_arrays(path, arrays)


def load(path: str | Path, source: Cloud, target: Cloud) -> Warp:
    """Read a warp that was fitted to these two clouds.

    Raises PipelineError where the file holds no warp, or one of clouds of another size.
    """
    saved = _read(path)
    expected = [len(source.points_m), len(target.points_m)]
    if saved.points != expected:
        raise PipelineError(
            f"{path}: expected the warp of clouds of {expected[0]} and {expected[1]} points ({source.name}, {target.name}), "
            f"found one of {saved.points[0]} and {saved.points[1]}; make it again with python -m pipeline.warp"
        )
    own = saved.source_frame, saved.target_frame, saved.deformation, saved.diagnostics
    return Warp(saved.method, source, target, *own)


def load_example(path: str | Path, source: Cloud) -> np.ndarray:
    """Read where a source's points are on another object, as `shape_space` takes it (N, 3), from the warp onto that.

    Raises PipelineError where the file holds no warp, or one of a source of another size.
    """
    saved = _read(path)
    if saved.points[0] != len(source.points_m):
        raise PipelineError(
            f"{path}: expected a warp of {source.name} with its {len(source.points_m)} points, found one of a source of "
            f"{saved.points[0]}; make it again with python -m pipeline.warp"
        )
    return example(source, saved.deformation, saved.source_frame, saved.target_frame)


@dataclass(frozen=True)
class _Saved:
    """What a file says of a warp: all but the clouds, of which it knows how many points they had."""

    method: str
    points: list[int]
    source_frame: PartFrame
    target_frame: PartFrame
    deformation: Deformation
    diagnostics: dict[str, float]


def _read(path: str | Path) -> _Saved:
    arrays = read_arrays(path)
    try:
        names, values = arrays["diagnostics_names"].tolist(), arrays["diagnostics"].tolist()
        return _Saved(
            str(arrays["method"]),
            arrays["points"].tolist(),
            _frame(arrays, "source"),
            _frame(arrays, "target"),
            _deformation(arrays),
            dict(zip(names, values, strict=True)),
        )
    except KeyError as error:
        raise PipelineError(
            f"{path}: expected a warp, found arrays without {error}; make it again with python -m pipeline.warp"
        ) from error


def _frame(arrays: dict[str, np.ndarray], side: str) -> PartFrame:
    return PartFrame(**{name: _plain(arrays[f"{side}_{name}"]) for name in FRAME})


def _deformation_arrays(deformation: Deformation, head: str = "d") -> dict[str, np.ndarray]:
    """Return a deformation's arrays; those of the links of a chain have longer and longer heads."""
    if isinstance(deformation, Chain):
        return _deformation_arrays(deformation.first, f"{head}1") | _deformation_arrays(
            deformation.then, f"{head}2"
        )
    if isinstance(deformation, Kernels):
        return {f"{head}.kernels.{name}": np.asarray(getattr(deformation, name)) for name in KERNELS}
    assert isinstance(deformation, PartStretch)
    return {
        f"{head}.frames": np.stack([deformation.T_source_part, deformation.T_target_part]),
        **{f"{head}.stretch.{name}": getattr(deformation.stretch, name) for name in STRETCH},
    }


def _deformation(arrays: dict[str, np.ndarray], head: str = "d") -> Deformation:
    if f"{head}.kernels.affine" in arrays:
        return Kernels(**{name: _plain(arrays[f"{head}.kernels.{name}"]) for name in KERNELS})
    if any(name.startswith(f"{head}1") for name in arrays):
        return Chain(_deformation(arrays, f"{head}1"), _deformation(arrays, f"{head}2"))
    stretch = Stretch(*(arrays[f"{head}.stretch.{name}"] for name in STRETCH))
    T_source_part, T_target_part = arrays[f"{head}.frames"]
    return PartStretch(T_source_part, T_target_part, stretch)


def _plain(array: np.ndarray) -> Any:
    return array.item() if array.ndim == 0 else array
