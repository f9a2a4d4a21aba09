"""Reading the single files of a scan: numbers, JSON, cameras, poses, images. Each error names the file."""

import json
import re
from pathlib import Path
from typing import Any

import numpy as np

from pipeline.errors import PipelineError

RIGID_TOLERANCE = 1e-3  # of R Rᵀ = 1: poses are often written with few digits
MOST_PIXELS = 25_000_000
MOST_BYTES = 50_000_000  # of a text file
LARGEST_SIDE = 1300  # pixels; images are thinned to this
DEPTHS, A_DEPTH = ("I;16", "I;16B", "I;16L", "I"), "a 16-bit depth image of one channel"
INVALID = 65535  # 7-Scenes' mark of a pixel without depth
INTRINSICS = (
    "camera-intrinsics.txt",
    "camera_intrinsics.txt",
    "camera_intrinsic.json",
    "intrinsics.txt",
    "intrinsic.json",  # Open3D's recorders
    "intrinsic/intrinsic_depth.txt",  # ScanNet: 4×4
)


def in_order(name: str) -> tuple[list[str | int], str]:
    """Return what names sort by as their numbers do: 2.png is before 10.png, as Open3D's own tools have it."""
    return [int(part) if part.isdecimal() else part for part in re.split(r"(\d+)", name)], name


def text(path: Path, what: str, cure: str = "add it") -> str:
    """Return the content of a text file; `cure`: what to do where there is none."""
    if not path.is_file():
        raise PipelineError(f"{path}: expected {what}, found no such file; {cure}")
    try:
        if path.stat().st_size > MOST_BYTES:
            raise PipelineError(
                f"{path}: expected {what} of less than {MOST_BYTES // 1_000_000} MB, found more; check the file"
            )
        return path.read_text(encoding="utf-8-sig")  # Windows marks the beginning
    except (OSError, UnicodeDecodeError) as error:
        raise PipelineError(
            f"{path}: expected {what}, but it is no text: {error}; export it again"
        ) from error


def content(path: Path, what: str) -> Any:
    """Return what a JSON file says."""
    try:
        return json.loads(text(path, what))
    except (ValueError, RecursionError) as error:
        raise PipelineError(
            f"{path}: expected {what} as JSON, but it cannot be read: {error}; export it again"
        ) from error


def rows(path: Path, what: str, cure: str = "add it") -> list[list[str]]:
    """Return the words of each line that is neither empty nor a comment; `cure`: what to do where there is no file."""
    lines = (line.split("#")[0].replace(",", " ").split() for line in text(path, what, cure).splitlines())
    return [words for words in lines if words]


def numbers(values: Any, shape: tuple[int, ...], where: str, what: str) -> np.ndarray:
    """Return values (a list of words or numbers) as finite numbers of a shape; `where` names file and key."""
    size = "×".join(map(str, shape))
    try:
        array = np.array(values, dtype=float)
    except (ValueError, TypeError, OverflowError) as error:
        raise PipelineError(
            f"{where}: expected {what} ({size} numbers), found other text: {values!r:.60}; correct it"
        ) from error
    if array.size != np.prod(shape) or (len(shape) > 1 and array.ndim > 1 and array.shape != shape):
        raise PipelineError(
            f"{where}: expected {what} ({size} numbers), found shape {array.shape}; correct it"
        )
    if not np.isfinite(array).all() or np.abs(array).max() > 1e12:
        raise PipelineError(
            f"{where}: expected {what}, {size} finite numbers, found {int((~np.isfinite(array)).sum())} not finite; "
            "correct it or remove the frame"
        )
    return array.reshape(shape)


def matrix(path: Path, size: int, what: str, cure: str = "add it") -> np.ndarray:
    """Return the matrix (size, size) in a text file; `cure`: what to do where there is none."""
    return numbers(rows(path, f"{what} ({size}×{size} numbers)", cure), (size, size), str(path), what)


def intrinsics(folder: Path, image: Path) -> tuple[np.ndarray, Path]:
    """Return the camera's matrix (3, 3) and the file that holds it; `image`: one of its depth images."""
    path = next((folder / name for name in INTRINSICS if (folder / name).is_file()), folder / INTRINSICS[0])
    if path.suffix == ".json":
        found = content(path, "the camera's intrinsics")
        if not isinstance(found, dict) or "intrinsic_matrix" not in found:
            raise PipelineError(
                f"{path}: expected the key intrinsic_matrix (9 numbers by columns), found {found!r:.60}; export it again"
            )
        width_height: list[Any] = [found.get("width"), found.get("height")]
        # Open3D writes -1 where none was given.
        if all(isinstance(side, int) and side > 0 for side in width_height):
            _check_size(width_height, image, path)
        K = numbers(found["intrinsic_matrix"], (9,), f"{path}: intrinsic_matrix", "the camera's intrinsics")
        return camera(K.reshape(3, 3).T, str(path)), path
    size = 3 if path.parent == folder else 4
    K = matrix(path, size, "the depth camera's intrinsics", "add it: fx 0 cx / 0 fy cy / 0 0 1 in pixels")
    return camera(K[:3, :3], str(path)), path


def _check_size(size: list[int], image: Path, where: Path) -> None:
    """Refuse a camera whose images have another size (width, height) than the depth `image`."""
    height, width = pixels(image, DEPTHS, A_DEPTH).shape
    if size != [width, height]:
        found = f"{size[0]}×{size[1]}"
        raise PipelineError(
            f"{where}: expected the camera of images like {image.name}, {width}×{height} pixels, found one of {found}; write the "
            "depth camera's own, or export depth aligned to colour"
        )


def camera(K: np.ndarray, where: str) -> np.ndarray:
    """Return the camera's matrix K (3, 3) when it is one."""
    if K[0, 0] <= 0 or K[1, 1] <= 0 or not np.allclose(K[2], [0, 0, 1]) or not np.allclose(K[1, 0], 0):
        raise PipelineError(
            f"{where}: expected fx 0 cx / 0 fy cy / 0 0 1 in pixels, found {K.tolist()}; correct it"
        )
    return K


def pose(T: np.ndarray, unit_m: float, where: str, direction: str = "camera→world") -> np.ndarray:
    """Return the rigid transform T (4, 4), its translation turned from `unit_m` to metres and its rotation made exact."""
    R = T[:3, :3]
    off = np.abs(R @ R.T - np.eye(3)).max()
    if off > RIGID_TOLERANCE or np.linalg.det(R) < 0 or not np.allclose(T[3], [0, 0, 0, 1], atol=1e-6):
        raise PipelineError(
            f"{where}: expected a rigid pose {direction} (rotation, translation, last row 0 0 0 1), found one "
            f"off by {off:.2g} with determinant {np.linalg.det(R):.3g}; correct it or remove the frame"
        )
    u, _, vt = np.linalg.svd(R)
    exact = np.eye(4)
    exact[:3, :3], exact[:3, 3] = u @ vt, T[:3, 3] * unit_m
    return exact


def depth(path: Path, depth_scale: float, K: np.ndarray, where_K: str) -> tuple[np.ndarray, np.ndarray]:
    """Return a depth image (H, W) float32 in metres, 0 where unknown, and its camera; large images are thinned."""
    values = pixels(path, DEPTHS, A_DEPTH)
    height, width = values.shape
    if not (0 < K[0, 2] < width and 0 < K[1, 2] < height):
        raise PipelineError(
            f"{where_K}: expected the principal point inside the {width}×{height} image {path.name}, found "
            f"({K[0, 2]:.1f}, {K[1, 2]:.1f}); it belongs to images of another size; correct it"
        )
    step = -(-max(values.shape) // LARGEST_SIDE)
    values = values[::step, ::step]
    metres = np.where((values < 0) | (values == INVALID), 0, values).astype(np.float32) / np.float32(
        depth_scale
    )
    return np.ascontiguousarray(metres), K * np.array([[1 / step], [1 / step], [1.0]])


def intensity(path: Path, shape: tuple[int, ...]) -> np.ndarray | None:
    """Return a colour image as intensity (H, W) from 0 to 1, or None when it does not lie over a depth image of `shape`."""
    values = pixels(path, ("L", "RGB", "RGBA", "P"), "a colour image of 8 bit", convert="L")
    step = -(-max(values.shape) // LARGEST_SIDE)
    values = values[::step, ::step]
    return values.astype(np.float32) / 255 if values.shape == shape else None


def pixels(path: Path, modes: tuple[str, ...], what: str, convert: str | None = None) -> np.ndarray:
    """Return the pixels (H, W) of an image file in one of Pillow's `modes`."""
    from PIL import Image

    if not path.is_file():
        raise PipelineError(f"{path}: expected {what}, found no such file; add it or remove the frame")
    try:
        with Image.open(path) as image:
            mode, size = image.mode, image.size
            if size[0] * size[1] > MOST_PIXELS:
                raise PipelineError(
                    f"{path}: expected at most {MOST_PIXELS:.1e} pixels, found {size[0]}×{size[1]}; make the images smaller"
                )
            values = np.asarray(image.convert(convert) if convert and mode in modes else image)
    except (OSError, ValueError, SyntaxError, MemoryError, Image.DecompressionBombError) as error:
        raise PipelineError(
            f"{path}: expected {what}, but it cannot be read ({error}); record it again"
        ) from error
    if mode not in modes or values.ndim != 2:
        raise PipelineError(f"{path}: expected {what}, found mode {mode}; export it again")
    return values
