"""The only reader and writer of the project's tables, meshes, arrays, films and JSON files: one schema a table, atomic writes."""

import json
import os
import zipfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, Union

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from pipeline import columns as plain
from pipeline.columns import Columns
from pipeline.errors import PipelineError
from pipeline.schemas import TABLES

if TYPE_CHECKING:
    import pandas as pd

Frame = Union["pd.DataFrame", Columns]
Mesh = tuple[np.ndarray, np.ndarray]
Arrays = dict[str, np.ndarray]


@contextmanager
def replacing(path: str | Path) -> Iterator[Path]:
    """Yield a temporary name beside `path` with the same suffix; it takes the place of `path` when all went well."""
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    temporary = path.with_name(f".{path.stem}.{os.getpid()}{path.suffix}")
    try:
        yield temporary
        os.replace(temporary, path)
    finally:
        temporary.unlink(missing_ok=True)


def write_table(path: str | Path, frame: Frame, table: str) -> None:
    """Write `frame` as zstd Parquet; its columns must be those of `TABLES[table]`, in any order."""
    schema = TABLES[table]
    _check_columns(path, table, list(frame))
    try:
        if isinstance(frame, dict):
            arrow = plain.to_arrow(frame, schema)
        else:
            arrow = pa.Table.from_pandas(frame[schema.names], schema=schema, preserve_index=False)
    except (pa.ArrowInvalid, TypeError) as error:
        raise PipelineError(
            f"{path}: a column does not fit the schema of table '{table}': {error}"
        ) from error
    with replacing(path) as temporary:
        pq.write_table(arrow.replace_schema_metadata(None), temporary, compression="zstd")


def read_table(path: str | Path, table: str, columns: list[str] | None = None) -> "pd.DataFrame":
    """Read a Parquet file as table `table` (all columns, or the named ones)."""
    return _read(path, table, columns).to_pandas()


def read_columns(path: str | Path, table: str) -> Columns:
    """Read a Parquet file as table `table`, without pandas; for the stages that every object goes through."""
    return plain.to_numpy(_read(path, table))


def _read(path: str | Path, table: str, columns: list[str] | None = None) -> pa.Table:
    try:
        with pq.ParquetFile(path) as file:
            _check_columns(path, table, file.schema_arrow.names)
            return file.read(columns)
    except (OSError, pa.ArrowInvalid) as error:
        raise PipelineError(
            f"{path}: expected a Parquet table '{table}', but it cannot be read: {error}"
        ) from error


def _check_columns(path: str | Path, table: str, found: list[str]) -> None:
    expected = TABLES[table].names
    missing = [name for name in expected if name not in found]
    extra = [name for name in found if name not in expected]
    if missing or extra:
        raise PipelineError(
            f"{path}: table '{table}' should have the columns {' '.join(expected)}; "
            f"missing: {' '.join(missing) or 'none'}, unexpected: {' '.join(extra) or 'none'}"
        )


def write_json(path: str | Path, content: Any) -> None:
    """Write `content` as indented JSON with sorted keys; NaN is refused."""
    with replacing(path) as temporary:
        temporary.write_text(json.dumps(content, indent=2, sort_keys=True, allow_nan=False) + "\n")


def read_json(path: str | Path) -> Any:
    """Read a JSON file."""
    try:
        return json.loads(Path(path).read_text())
    except (OSError, ValueError) as error:
        raise PipelineError(f"{path}: expected a JSON file, but it cannot be read: {error}") from error


def write_mesh(path: str | Path, mesh: Mesh) -> None:
    """Write (vertices (V, 3) in metres, triangles (F, 3)) as binary PLY; Trimesh, which does it, too, takes longer to load."""
    vertices, triangles = mesh
    faces = np.empty(len(triangles), [("count", "u1"), ("corners", "<i4", 3)])
    faces["count"], faces["corners"] = 3, triangles
    header = (
        "ply\nformat binary_little_endian 1.0\n"
        f"element vertex {len(vertices)}\nproperty float x\nproperty float y\nproperty float z\n"
        f"element face {len(triangles)}\nproperty list uchar int vertex_indices\nend_header\n"
    )
    with replacing(path) as temporary:
        temporary.write_bytes(header.encode() + np.asarray(vertices, "<f4").tobytes() + faces.tobytes())


def read_mesh(path: str | Path) -> Mesh:
    """Read a mesh written by `write_mesh`: vertices (V, 3) in metres, triangles (F, 3)."""
    import trimesh

    try:
        mesh = trimesh.load_mesh(path, process=False)
    except (OSError, ValueError) as error:
        raise PipelineError(f"{path}: expected a mesh, but it cannot be read: {error}") from error
    return np.asarray(mesh.vertices, dtype=float), np.asarray(mesh.faces, dtype=np.int64)


def write_arrays(path: str | Path, arrays: Mapping[str, np.ndarray]) -> None:
    """Write named arrays as NPZ; equal arrays are equal bytes."""
    with replacing(path) as temporary:
        np.savez_compressed(temporary, allow_pickle=False, **arrays)


def read_arrays(path: str | Path) -> dict[str, np.ndarray]:
    """Read arrays written by `write_arrays`."""
    try:
        with np.load(path, allow_pickle=False) as file:
            return dict(file)
    except (OSError, ValueError, zipfile.BadZipFile) as error:
        raise PipelineError(f"{path}: expected arrays (NPZ), but it cannot be read: {error}") from error


def write_film(path: str | Path, pictures: Sequence[np.ndarray], every_s: float) -> None:
    """Write pictures (H, W, 3) of uint8, `every_s` apart, as an animated GIF that begins again at its end."""
    from PIL import Image

    frames = [Image.fromarray(picture) for picture in pictures]
    # One palette for all frames: no flicker, and a smaller file.
    palette = frames[len(frames) // 2].quantize(128)
    indexed = [frame.quantize(palette=palette, dither=Image.Dither.NONE) for frame in frames]
    with replacing(path) as temporary:
        indexed[0].save(
            temporary, save_all=True, append_images=indexed[1:], duration=round(1000.0 * every_s), loop=0
        )


def points(frame: Frame) -> np.ndarray:
    """Return the columns x_m, y_m, z_m as an array (N, 3) in metres."""
    return np.array([frame["x_m"], frame["y_m"], frame["z_m"]], float).T


def normals(frame: Frame) -> np.ndarray:
    """Return the columns nx, ny, nz as an array (N, 3) of unit vectors."""
    return np.array([frame["nx"], frame["ny"], frame["nz"]], float).T


def poses(frame: "pd.DataFrame") -> np.ndarray:
    """Return the columns x_m, y_m, z_m, qx, qy, qz, qw as poses (N, 4, 4)."""
    from scipy.spatial.transform import Rotation

    T = np.tile(np.eye(4), (len(frame), 1, 1))
    T[:, :3, :3] = Rotation.from_quat(frame[["qx", "qy", "qz", "qw"]].to_numpy(float)).as_matrix()
    T[:, :3, 3] = points(frame)
    return T


def T_world_second(trajectory: "pd.DataFrame") -> np.ndarray:
    """Return where the second container of a trajectory stands (4, 4): upright on the table."""
    T = np.eye(4)
    T[:2, 3] = trajectory[["second_x_m", "second_y_m"]].iloc[0]
    return T
