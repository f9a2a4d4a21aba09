"""What lies in data/raw/<object>/: depth images with poses in 7-Scenes layout, or one mesh; recognised by content."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from pipeline.errors import PipelineError

MESHES = (".ply", ".obj", ".stl", ".glb", ".off")
UNITS_M = {"m": 1.0, "cm": 0.01, "mm": 0.001}
UPS = ("x", "y", "z", "-x", "-y", "-z")
RIGID_TOLERANCE = 1e-3  # of R Rᵀ = 1: poses are often written with few digits
_EXPECTED = (
    "frame-NNNNNN.depth.png with frame-NNNNNN.pose.txt and camera-intrinsics.txt, or one mesh "
    + " ".join(MESHES)
)


@dataclass(frozen=True)
class Options:
    """What scan.yaml says: the mesh's unit in metres, its up axis, and depth units per metre."""

    unit_m: float = 1.0
    up: str = "z"
    depth_scale: float = 1000.0


@dataclass(frozen=True)
class Views:
    """Depth images (H, W) float32 in metres, 0 where unknown, their poses T_world_camera (4, 4), intrinsics (3, 3)."""

    depths_m: list[np.ndarray]
    T_world_cameras: list[np.ndarray]
    intrinsics: np.ndarray


@dataclass(frozen=True)
class DroppedMesh:
    """A file with the whole surface, in its own units and axes."""

    path: Path
    options: Options


def read(folder: Path) -> Views | DroppedMesh:
    """Read a raw folder; a `PipelineError` names the folder or file, what was found and what was expected."""
    names = sorted(p.name for p in folder.iterdir() if not p.name.startswith(".")) if folder.is_dir() else []
    if not names:
        raise PipelineError(
            f"{folder}: expected {_EXPECTED}; found nothing; add the scan or remove the folder"
        )
    options = _options(folder / "scan.yaml")
    depths = [name for name in names if name.endswith(".depth.png")]
    meshes = [name for name in names if Path(name).suffix.lower() in MESHES]
    if depths and not meshes:
        return _seven_scenes(folder, depths, options)
    if len(meshes) == 1 and not depths:
        return DroppedMesh(folder / meshes[0], options)
    shown = ", ".join(names[:5]) + (f" and {len(names) - 5} more" if len(names) > 5 else "")
    raise PipelineError(f"{folder}: expected {_EXPECTED}; found {shown}; keep one scan a folder")


def _options(path: Path) -> Options:
    import yaml

    if not path.exists():
        return Options()
    try:
        content = yaml.safe_load(path.read_text()) or {}
    except (OSError, UnicodeDecodeError, yaml.YAMLError) as error:
        raise PipelineError(
            f"{path}: expected YAML, but it cannot be read: {' '.join(str(error).split())}"
        ) from error
    if not isinstance(content, dict):
        raise PipelineError(
            f"{path}: expected keys and values like `units: mm`, found {content!r}; correct it"
        )
    unknown = sorted(str(key) for key in set(content) - {"units", "up", "depth_scale", "notes"})
    if unknown:
        raise PipelineError(
            f"{path}: expected the keys units, up, depth_scale, notes; found {', '.join(unknown)}; remove it"
        )
    units, up, scale = content.get("units", "m"), content.get("up", "z"), content.get("depth_scale", 1000.0)
    if units not in UNITS_M:
        raise PipelineError(
            f"{path}: units: expected one of {' '.join(UNITS_M)}, found {units!r}; correct it"
        )
    if up not in UPS:
        raise PipelineError(f"{path}: up: expected one of {' '.join(UPS)}, found {up!r}; correct it")
    if isinstance(scale, bool) or not isinstance(scale, int | float) or not 0 < scale < np.inf:
        raise PipelineError(
            f"{path}: depth_scale: expected depth units per metre (1000 for mm), found {scale!r}; correct it"
        )
    return Options(UNITS_M[units], up, float(scale))


def _seven_scenes(folder: Path, names: list[str], options: Options) -> Views:
    intrinsics = _intrinsics(folder / "camera-intrinsics.txt")
    depths, poses = [], []
    for name in names:
        poses.append(_pose(folder / name.replace(".depth.png", ".pose.txt")))
        depths.append(_depth(folder / name, options.depth_scale))
    if not any(depth.any() for depth in depths):
        raise PipelineError(
            f"{folder}: expected depth in the images, found zeros in all {len(names)}; record it again"
        )
    return Views(depths, poses, intrinsics)


def _matrix(path: Path, size: int, what: str) -> np.ndarray:
    if not path.is_file():
        raise PipelineError(f"{path}: expected {what} ({size}×{size} numbers), found no such file; add it")
    try:
        rows = [line.replace(",", " ").split() for line in path.read_text().splitlines() if line.strip()]
        matrix = np.array([[float(word) for word in row] for row in rows])
    except (OSError, ValueError) as error:
        raise PipelineError(
            f"{path}: expected {what} ({size}×{size} numbers), found other text; correct it"
        ) from error
    if matrix.shape != (size, size) or not np.isfinite(matrix).all():
        raise PipelineError(
            f"{path}: expected {what}, {size}×{size} finite numbers, found shape {matrix.shape} "
            f"with {int((~np.isfinite(matrix)).sum())} not finite; correct it or remove the frame"
        )
    return matrix


def _intrinsics(path: Path) -> np.ndarray:
    K = _matrix(path, 3, "the camera's intrinsics")
    if K[0, 0] <= 0 or K[1, 1] <= 0 or not np.allclose(K[2], [0, 0, 1]):
        raise PipelineError(
            f"{path}: expected fx 0 cx / 0 fy cy / 0 0 1 in pixels, found {K.tolist()}; correct it"
        )
    return K


def _pose(path: Path) -> np.ndarray:
    T = _matrix(path, 4, "the pose camera→world")
    R = T[:3, :3]
    off = np.abs(R @ R.T - np.eye(3)).max()
    if off > RIGID_TOLERANCE or np.linalg.det(R) < 0 or not np.allclose(T[3], [0, 0, 0, 1], atol=1e-6):
        raise PipelineError(
            f"{path}: expected a rigid pose camera→world (rotation, translation in metres, last row 0 0 0 1), found one "
            f"off by {off:.2g} with determinant {np.linalg.det(R):.3g}; correct it or remove the frame"
        )
    u, _, vt = np.linalg.svd(R)
    T[:3, :3] = u @ vt
    return T


def _depth(path: Path, depth_scale: float) -> np.ndarray:
    from PIL import Image

    try:
        with Image.open(path) as image:
            mode = image.mode
            values = np.asarray(image)
    except (OSError, ValueError, SyntaxError, Image.DecompressionBombError) as error:
        raise PipelineError(
            f"{path}: expected a 16-bit PNG, but it cannot be read ({error}); record it again"
        ) from error
    if mode not in ("I;16", "I;16B", "I") or values.ndim != 2:
        raise PipelineError(
            f"{path}: expected a 16-bit depth image of one channel, found mode {mode}; export it again"
        )
    return np.ascontiguousarray(values, np.float32) / np.float32(depth_scale)
