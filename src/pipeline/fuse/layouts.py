"""Which layout lies in data/raw/<object>/, recognised by content, and its reading."""

import re
from pathlib import Path

import numpy as np

from pipeline.errors import PipelineError
from pipeline.fuse import files, raw
from pipeline.fuse.raw import DroppedMesh, Options, Views
from pipeline.fuse.recordings import bop, open3d_folders, seven_scenes, tum
from pipeline.fuse.recordings.frame import Frame

__all__ = ["DroppedMesh", "Options", "Views", "read"]

MESHES = (".ply", ".obj", ".stl", ".glb", ".gltf", ".off")
CLOUDS = (".pcd", ".xyz", ".npz")
RECORDINGS = {"7-scenes": seven_scenes, "open3d": open3d_folders, "tum": tum, "bop": bop}
# Of a long sequence so many views are taken, or as many as have so many pixels together, but not fewer than suffice.
MOST_VIEWS, MOST_PIXELS, ENOUGH_VIEWS = 200, 200 * 640 * 480, 48
# Names of what holds poses in other layouts: views beside it were not meant to be without.
_POSES = re.compile(
    r"(?!cameras\.txt$)((.*[^a-z])?poses?([^a-z.][^.]*)?|.*(traj(ectory)?|odom(etry)?|ground_?truth|transforms)|cameras)"
    r"(\.(txt|json|csv|log|npy|npz|ya?ml|tum))?",
    re.IGNORECASE,
)
_OF_OTHERS = {"up": "up comes from the table", "wall_mm": "both sides of the wall are measured"}
_EXPECTED = (
    "depth images (frame-NNNNNN.depth.png with frame-NNNNNN.pose.txt and camera-intrinsics.txt, or a folder of Open3D, TUM "
    f"or BOP), one mesh {' '.join(MESHES)}, or one point cloud .ply {' '.join(CLOUDS)}"
)


def read(folder: Path) -> Views | DroppedMesh:
    """Read a raw folder; a `PipelineError` names the folder or file, what was found and what was expected."""
    names = _names(folder)
    if not names:
        raise PipelineError(
            f"{folder}: expected {_EXPECTED}; found nothing; add the scan or remove the folder"
        )
    options = raw.options(folder / "scan.yaml")
    layouts, dropped = _recognised(folder, names)
    if len(layouts) == 1 and not dropped:
        raw.refuse(options, folder / "scan.yaml", "depth images", **_OF_OTHERS)
        return _views(folder, layouts[0], names, options)
    if len(dropped) == 1 and not layouts:
        return DroppedMesh(folder / dropped[0], options)
    shown = ", ".join(names[:5]) + (f" and {len(names) - 5} more" if len(names) > 5 else "")
    cure = "keep one scan a folder, in one of these formats"
    if layouts or dropped:
        both = [f"images ({layout})" for layout in layouts] + dropped
        shown = f"{' and '.join(both[:4])}: more than one scan"
    elif inner := [name for name in names if _holds_a_scan(folder / name)]:
        cure = f"move what is in {inner[0]}/ one folder up"
    raise PipelineError(f"{folder}: expected {_EXPECTED}; found {shown}; {cure}")


def _recognised(folder: Path, names: list[str]) -> tuple[list[str], list[str]]:
    """Return the layouts of recordings and the meshes and clouds that are in a folder."""
    layouts = [layout for layout, module in RECORDINGS.items() if module.recognised(folder, names)]
    return layouts, [name for name in names if Path(name).suffix.lower() in MESHES + CLOUDS]


def _holds_a_scan(folder: Path) -> bool:
    try:
        return any(_recognised(folder, _names(folder)))
    except PipelineError:  # not what is wrong here
        return False


def _names(folder: Path) -> list[str]:
    try:
        return (
            sorted((p.name for p in folder.iterdir() if not p.name.startswith(".")), key=files.in_order)
            if folder.is_dir()
            else []
        )
    except OSError as error:
        raise PipelineError(
            f"{folder}: expected a folder that can be read, found: {error}; mend it"
        ) from error


def _views(folder: Path, layout: str, names: list[str], options: Options) -> Views:
    frames = RECORDINGS[layout].frames(folder, names, options)
    kept = np.unique(np.linspace(0, len(frames) - 1, _most_views(frames)).round().astype(int))
    chosen = [frames[i] for i in kept]
    poses = [frame.T_world_camera for frame in chosen if frame.T_world_camera is not None]
    if not poses and (unread := [name for name in names if _POSES.fullmatch(name)]):
        raise PipelineError(
            f"{folder}: expected poses in {RECORDINGS[layout].POSES}, found {unread[0]}, which is not read; write them there, or "
            "remove it to have the views registered"
        )
    images = [files.depth(frame.depth, frame.depth_scale, frame.K, frame.where_K) for frame in chosen]
    if not any(depth.any() for depth, _ in images):
        raise PipelineError(
            f"{folder}: expected depth in the images, found zeros in all {len(images)}; record it again"
        )
    if poses:
        raw.refuse(
            options, folder / "scan.yaml", "views with poses", turntable_deg="their poses say how they turn"
        )
    colours, colours_differ = ([], False) if poses else _colours(chosen, images)
    return Views(
        depths_m=[depth for depth, _ in images],
        T_world_cameras=poses,
        intrinsics=np.stack([K for _, K in images]),
        names=[str(frame.depth.relative_to(folder)) for frame in chosen],
        layout=layout,
        options=_for(options, kept, len(frames), folder),
        colours=colours,
        depth_scale=chosen[0].depth_scale,
        n_found=len(frames),
        colours_differ=colours_differ,
    )


def _most_views(frames: list[Frame]) -> int:
    """Return how many of the frames are taken: fewer of large images, which take memory and time."""
    if len(frames) <= ENOUGH_VIEWS:
        return len(frames)
    first = frames[0]
    size = files.depth(first.depth, first.depth_scale, first.K, first.where_K)[0].size
    return min(len(frames), MOST_VIEWS, max(ENOUGH_VIEWS, MOST_PIXELS // size))


def _for(options: Options, kept: np.ndarray, n: int, folder: Path) -> Options:
    """Return the options with the table's angles of the views that were kept."""
    from dataclasses import replace

    angles = options.turntable_deg
    if angles is None:
        return options
    if len(angles) != n:
        raise PipelineError(
            f"{folder / 'scan.yaml'}: turntable_deg: expected an angle for each of the {n} views, found {len(angles)}; correct it"
        )
    return replace(options, turntable_deg=tuple(angles[i] for i in kept))


def _colours(
    frames: list[Frame], images: list[tuple[np.ndarray, np.ndarray]]
) -> tuple[list[np.ndarray], bool]:
    """Return the colours when every view has one that lies over its depth, and whether one does not."""
    found = []
    for frame, (depth, _) in zip(frames, images, strict=True):
        colour = files.intensity(frame.colour, depth.shape) if frame.colour else None
        if colour is None:
            return [], frame.colour is not None
        found.append(colour)
    return found, False
