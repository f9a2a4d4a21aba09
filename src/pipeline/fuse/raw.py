"""What comes out of data/raw/<object>/, whatever its layout: depth images, a mesh or a point cloud, and scan.yaml."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from pipeline.errors import PipelineError

UNITS_M = {"m": 1.0, "cm": 0.01, "mm": 0.001}
UPS = ("x", "y", "z", "-x", "-y", "-z")
KEYS = ("units", "depth_scale", "up", "on_table", "wall_mm", "turntable_deg", "notes")
_FIELDS = {"units": "unit_m", "wall_mm": "wall_m"}  # of the keys that are named otherwise in `Options`


@dataclass(frozen=True)
class Options:
    """What scan.yaml says; None where it is silent.

    unit_m: of lengths in meshes, clouds and poses, in metres. depth_scale: depth units per metre. up: axis of the file's
    frame. on_table: whether the table is part of the data. wall_m: thickness of the wall. turntable_deg (N,): angle of
    the table in each view.
    """

    unit_m: float | None = None
    depth_scale: float | None = None
    up: str | None = None
    on_table: bool | None = None
    wall_m: float | None = None
    turntable_deg: tuple[float, ...] | None = None


@dataclass(frozen=True)
class Views:
    """Depth images (H, W) float32 in metres, 0 where unknown, by file name, with the camera of each.

    intrinsics (N, 3, 3). T_world_cameras: N poses (4, 4), or none where the folder has none. colours: for all views the
    intensity (H, W) from 0 to 1, or none. depth_scale: units of the images per metre. n_found: views in the folder, of
    which these are evenly chosen. colours_differ: there are colours that do not lie over the depths.
    """

    depths_m: list[np.ndarray]
    T_world_cameras: list[np.ndarray]
    intrinsics: np.ndarray
    names: list[str]
    layout: str
    options: Options
    colours: list[np.ndarray]
    depth_scale: float
    n_found: int
    colours_differ: bool = False


@dataclass(frozen=True)
class DroppedMesh:
    """A file with the whole surface or points of it, in its own units and axes."""

    path: Path
    options: Options


def refuse(options: Options, path: Path, scan: str, **reasons: str) -> None:
    """Refuse keys of the scan.yaml at `path` that have no effect on such a scan; each with the reason why."""
    for key, reason in reasons.items():
        if getattr(options, _FIELDS.get(key, key)) is not None:
            raise PipelineError(f"{path}: expected no `{key}` for {scan}, as {reason}; found it; remove it")


def options(path: Path) -> Options:
    """Read scan.yaml; nothing is said where there is none."""
    import yaml

    if not path.exists():
        return Options()
    try:
        content = yaml.safe_load(path.read_text())
    except (OSError, ValueError, RecursionError, yaml.YAMLError) as error:
        raise PipelineError(
            f"{path}: expected YAML, but it cannot be read: {' '.join(str(error).split())}"
        ) from error
    content = {} if content is None else content
    if not isinstance(content, dict):
        raise PipelineError(
            f"{path}: expected keys and values like `units: mm`, found {content!r:.60}; correct it"
        )
    unknown = sorted(str(key) for key in set(content) - set(KEYS))
    if unknown:
        raise PipelineError(
            f"{path}: expected the keys {', '.join(KEYS)}; found {', '.join(unknown):.60}; remove it"
        )
    wall_mm = _number(path, content, "wall_mm", "the wall's thickness in millimetres")
    return Options(
        UNITS_M[_choice(path, content, "units", tuple(UNITS_M))] if "units" in content else None,
        _number(path, content, "depth_scale", "depth units per metre (1000 for mm)"),
        _choice(path, content, "up", UPS) if "up" in content else None,
        _boolean(path, content, "on_table"),
        None if wall_mm is None else wall_mm / 1000,
        _angles(path, content.get("turntable_deg")),
    )


def _choice(path: Path, content: dict, key: str, allowed: tuple[str, ...]) -> str:
    if content[key] not in allowed:
        raise PipelineError(
            f"{path}: {key}: expected one of {' '.join(allowed)}, found {content[key]!r:.60}; correct it"
        )
    return content[key]


def _number(path: Path, content: dict, key: str, what: str) -> float | None:
    value = content.get(key)
    if key not in content:
        return None
    if isinstance(value, bool) or not isinstance(value, int | float) or not 0 < value < 1e9:
        raise PipelineError(f"{path}: {key}: expected {what}, found {value!r:.60}; correct it")
    return float(value)


def _boolean(path: Path, content: dict, key: str) -> bool | None:
    if key in content and not isinstance(content[key], bool):
        raise PipelineError(f"{path}: {key}: expected true or false, found {content[key]!r:.60}; correct it")
    return content.get(key)


def _angles(path: Path, values: object) -> tuple[float, ...] | None:
    if values is None:
        return None
    numbers = isinstance(values, list) and all(
        isinstance(v, int | float) and not isinstance(v, bool) and abs(v) < 1e6 for v in values
    )
    if not numbers or not values:
        raise PipelineError(
            f"{path}: turntable_deg: expected a list with the angle of the table in each view, found {values!r:.60}; correct it"
        )
    return tuple(float(v) for v in values)  # type: ignore[attr-defined]
