"""Scan folders with something wrong: small scans in every layout, and what can happen to their files."""

import json
import shutil
import zlib
from collections.abc import Callable
from pathlib import Path

import numpy as np
import trimesh
from fuse import writers
from PIL import Image

from pipeline.errors import PipelineError
from pipeline.fuse import outputs
from pipeline.fuse.fusion import fused
from pipeline.geometry.sampling import uniform_points
from pipeline.scan import camera, recording
from pipeline.scan.shapes import shape

OPTIONS = {"voxel_m": 0.003, "truncation_m": 0.006, "n_points": 5000, "seed": 2}
OUTPUTS = ("mesh.ply", "cloud.parquet", "fusion.json")
STRIDE = 2  # of the images' pixels
MESHES = ("ply", "obj", "stl", "glb", "off")
CLOUDS = ("npz", "pcd", "xyz")


def sources(folder: Path) -> list[Path]:
    """Write a good scan in each layout, and return their folders."""
    body = shape("short_cup")
    T_world_object = recording.pose_on_table(recording.generator(1, "short_cup", 0))
    views = recording.views(body, T_world_object, 10, 0.6, 1.0, 1)
    recorded = [(depth[::STRIDE, ::STRIDE], T) for depth, T in views]
    for layout, write in writers.WRITERS.items():
        write(folder / layout, recorded)
        _rescale(folder / layout)
    for kind in MESHES:
        (folder / f"mesh_{kind}").mkdir()
        trimesh.Trimesh(body.vertices_m, body.triangles).export(folder / f"mesh_{kind}/cup.{kind}")
    points, _ = uniform_points(body.vertices_m, body.triangles, 6000, np.random.default_rng(1))
    for kind in CLOUDS:
        (folder / f"cloud_{kind}").mkdir()
        _write_cloud(folder / f"cloud_{kind}/cup.{kind}", points)
    return sorted(folder.iterdir())


def _write_cloud(path: Path, points: np.ndarray) -> None:
    import open3d as o3d

    if path.suffix == ".npz":
        np.savez(path, points=points)
    else:
        o3d.io.write_point_cloud(str(path), o3d.geometry.PointCloud(o3d.utility.Vector3dVector(points)))


def _rescale(folder: Path) -> None:
    """Make the intrinsics those of the thinned images."""
    K = camera.intrinsics()
    K[:2] /= STRIDE
    if (folder / "camera-intrinsics.txt").exists():
        np.savetxt(folder / "camera-intrinsics.txt", K)
    if (folder / "camera_intrinsic.json").exists():
        (folder / "camera_intrinsic.json").write_text(json.dumps({"intrinsic_matrix": K.T.ravel().tolist()}))
    if (folder / "scene_camera.json").exists():
        cameras = json.loads((folder / "scene_camera.json").read_text())
        for view in cameras.values():
            view["cam_K"] = K.ravel().tolist()
        (folder / "scene_camera.json").write_text(json.dumps(cameras))


def _any(folder: Path, rng: np.random.Generator, *suffixes: str) -> Path | None:
    found = sorted(p for p in folder.rglob("*") if p.is_file() and (not suffixes or p.suffix in suffixes))
    return found[rng.integers(len(found))] if found else None


def flip_bytes(path: Path, rng: np.random.Generator) -> None:
    """Change some bytes."""
    data = np.frombuffer(path.read_bytes(), np.uint8).copy()
    if len(data):
        places = rng.integers(len(data), size=int(rng.integers(1, 30)))
        data[places] = rng.integers(0, 256, len(places))
    path.write_bytes(data.tobytes())


def truncate(path: Path, rng: np.random.Generator) -> None:
    """Keep the beginning alone."""
    data = path.read_bytes()
    path.write_bytes(data[: int(rng.integers(len(data) + 1))])


def remove(path: Path, rng: np.random.Generator) -> None:
    """Take the file away."""
    path.unlink()


def replace_by_folder(path: Path, rng: np.random.Generator) -> None:
    """Put a folder in the file's place."""
    path.unlink()
    path.mkdir()


def replace_by_noise(path: Path, rng: np.random.Generator) -> None:
    """Put random bytes in the file's place."""
    path.write_bytes(rng.bytes(int(rng.integers(1, 5000))))


def swap_numbers(path: Path, rng: np.random.Generator) -> None:
    """Put something else in the place of a number of a text file."""
    words = path.read_text().split(" ")
    words[rng.integers(len(words))] = str(rng.choice(["nan", "inf", "-1e300", "0", "x", "", "1e9", "[]"]))
    path.write_text(" ".join(words))


def change_json(path: Path, rng: np.random.Generator) -> None:
    """Put a value of another type somewhere in a JSON file."""
    wrong = [None, "text", [], {}, -1, 1e300, True, [[1, 2], [3]], {"a": {}}, [None] * 9, float("nan")]
    content = json.loads(path.read_text())
    inner = content
    while isinstance(inner, dict) and inner:
        key = sorted(inner)[rng.integers(len(inner))]
        if rng.random() < 0.4 or not isinstance(inner[key], dict):
            inner[key] = wrong[rng.integers(len(wrong))]
            break
        inner = inner[key]
    path.write_text(json.dumps(content if rng.random() < 0.9 else wrong[rng.integers(len(wrong))]))


def another_image(path: Path, rng: np.random.Generator) -> None:
    """Put an image of another size, depth or content in the place of one."""
    kind = rng.integers(6)
    if kind == 5:  # a header that promises more pixels than there are
        data = bytearray(path.read_bytes())
        data[16:24] = (60_000).to_bytes(4, "big") * 2
        data[29:33] = zlib.crc32(bytes(data[12:29])).to_bytes(4, "big")
        path.write_bytes(bytes(data))
        return
    values = (
        np.zeros((240, 320), np.uint16),
        np.full((240, 320), 65535, np.uint16),
        rng.integers(0, 65536, (240, 320)).astype(np.uint16),
        np.zeros((6000, 6000), np.uint16),
        rng.integers(0, 256, (240, 320, 3)).astype(np.uint8),
    )[kind]
    Image.fromarray(values).save(path, format="PNG", compress_level=1)


def spoil_pixels(path: Path, rng: np.random.Generator) -> None:
    """Put one depth, or noise, in a block of an image."""
    with Image.open(path) as image:
        values = np.array(image)
    v, u = (int(rng.integers(size)) for size in values.shape[:2])
    block = values[v : v + int(rng.integers(1, 200)), u : u + int(rng.integers(1, 200))]
    block[...] = rng.integers(0, 3000, block.shape if rng.random() < 0.5 else ())
    Image.fromarray(values).save(path, format="PNG", compress_level=1)


def nudge_number(path: Path, rng: np.random.Generator) -> None:
    """Change a number of a text file a little."""
    words = path.read_text().split(" ")
    k = int(rng.integers(len(words)))
    words[k] = repr(float(words[k]) * (1 + float(rng.normal(0, 0.2))))
    path.write_text(" ".join(words))


def few_views(folder: Path, rng: np.random.Generator) -> None:
    """Keep some of the views."""
    for path in sorted(folder.rglob("*.png")):
        if rng.random() < 0.8:
            path.unlink()


def other_depths(folder: Path, rng: np.random.Generator) -> None:
    """Multiply all depths."""
    factor = float(rng.choice([0.1, 0.5, 1.02, 1.2, 5.0]))
    for path in sorted(folder.rglob("*.png")):
        with Image.open(path) as image:
            values = np.array(image)
        Image.fromarray((values * factor).astype(values.dtype)).save(path, format="PNG", compress_level=1)


def all_images_zero(folder: Path, rng: np.random.Generator) -> None:
    """Leave no depth in any image."""
    for path in folder.rglob("*.png"):
        Image.fromarray(np.zeros((240, 320), np.uint16)).save(path)


def write_options(folder: Path, rng: np.random.Generator) -> None:
    """Write a scan.yaml with something odd in it."""
    texts = (
        "units: mm",
        "depth_scale: 0",
        "depth_scale: .nan",
        "up: [1]",
        "{",
        "- a\n- b",
        "on_table: 3",
        "units: 1",
    )
    texts += (
        "wall_mm: -2",
        "turntable_deg: [1, 2]",
        "turntable_deg: x",
        "up: -y",
        "depth_scale: 1e6",
        "a: &x [*x]",
        "\x00",
    )
    texts += ("wall_mm: 3\nunits: cm", "notes: {a: 1}", "on_table: true", "on_table: false", "? [a]\n: b")
    (folder / "scan.yaml").write_text(texts[rng.integers(len(texts))])


def add_something(folder: Path, rng: np.random.Generator) -> None:
    """Add a file that belongs to another layout, or a folder with the name of one."""
    name = str(
        rng.choice(
            [
                "depth.txt",
                "scene_camera.json",
                "a.ply",
                "b.npz",
                "frame-000099.depth.png",
                "notes.doc",
                "depth",
            ]
        )
    )
    if rng.random() < 0.5 or name == "depth":
        (folder / name).mkdir(exist_ok=True)
    elif not (folder / name).exists():
        (folder / name).write_bytes(rng.bytes(100))


OF_FILES: dict[Callable[[Path, np.random.Generator], None], tuple[str, ...]] = {
    flip_bytes: (),
    truncate: (),
    remove: (),
    replace_by_folder: (),
    replace_by_noise: (),
    swap_numbers: (".txt", ".log", ".obj", ".off"),
    change_json: (".json",),
    another_image: (".png",),
    spoil_pixels: (".png",),
    nudge_number: (".txt", ".log", ".obj", ".off"),
}
OF_FOLDERS = (all_images_zero, write_options, add_something, few_views, other_depths)


def spoil(folder: Path, rng: np.random.Generator) -> list[str]:
    """Do one to three things to a folder, and return their names."""
    done = []
    for _ in range(int(rng.choice([1, 1, 2, 3]))):
        if rng.random() < 0.3:
            change = OF_FOLDERS[rng.integers(len(OF_FOLDERS))]
            try:
                change(folder, rng)
            except (ValueError, OSError):  # spoilt already
                continue
            done.append(change.__name__)
            continue
        for _ in range(10):
            change = list(OF_FILES)[rng.integers(len(OF_FILES))]
            path = _any(folder, rng, *OF_FILES[change])
            if path is not None:
                try:
                    change(path, rng)
                    done.append(f"{change.__name__} {path.name}")
                except (ValueError, OSError):  # spoilt already
                    done.append("nothing")
                break
    return done


def spoiled(source: Path, target: Path, seed: int) -> list[str]:
    """Copy a good folder and spoil the copy."""
    shutil.copytree(source, target)
    return spoil(target, np.random.default_rng(seed))


def outcome(folder: Path, out: Path) -> str:
    """Fuse a folder and return "success", or the sentence; anything else than these two is raised."""
    try:
        outputs.write(fused(folder, **OPTIONS), *(out / name for name in OUTPUTS))
    except PipelineError as error:
        message = str(error)
        assert str(folder) in message, f"the sentence does not name the folder: {message}"
        assert "\n" not in message, f"more than one line: {message}"
        assert not out.exists() or not any(out.iterdir()), "partial output"
        return message
    assert sorted(p.name for p in out.iterdir()) == sorted(OUTPUTS)
    return "success"
