"""Paint container, rim and handle on a scanned object, in the browser.

Opens a page on which the fused scan is painted by brush or box, with undo, and writes
config/annotations/<object>.parquet when it is saved. An annotation that is there already is where it starts from. The
annotated object becomes the known one when objects.source in config/config.yaml names it.
"""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pipeline.errors import PipelineError
from pipeline.pour.project import Project
from pipeline.pour.view import page_options

if TYPE_CHECKING:
    import numpy as np

PARTS = ("container", "rim", "handle")
NEEDED = ("container", "rim")  # not every source has a handle
REACH_M = 0.005


def options(parser: argparse.ArgumentParser) -> None:
    """Add this subcommand's options."""
    parser.add_argument("object", help="name of the object")
    parser.add_argument("--points", type=int, default=6000, help="points to paint, at most")
    page_options(parser)


def call(options: argparse.Namespace) -> dict[str, Any]:
    """Serve the page until it is closed; return where the annotation is and how many points each part has."""
    project = Project(options.project)
    name = project.check(options.object)
    annotation = Annotation(project, name, options.points)

    from pipeline.pour.server import serve
    from pipeline.scene.pages import page
    from pipeline.scene.shape import surface

    scene = {"name": name, "title": name.replace("_", " ")} | surface(
        annotation.mesh, annotation.object_m, annotation.parts, neighbours=1
    )
    start = {"points": annotation.object_m.round(6).ravel().tolist(), "parts": annotation.parts.tolist()}
    serve(
        lambda token: page("pour/assets/annotate.html", object=scene, start=start, token=token),
        {"/save": annotation.save},
        port=options.port,
        opened=not options.no_browser,
        closes=True,
    )
    return {
        "object": name,
        "annotation": str(annotation.path) if annotation.saved else None,
        **annotation.saved,
    }


def text(result: dict[str, Any]) -> str:
    """Return where the annotation is."""
    if result["annotation"] is None:
        return f"{result['object']}: nothing was saved"
    counts = ", ".join(f"{result[part]} {part}" for part in PARTS)
    known = f"objects.source: {result['object']} in config/config.yaml makes it the known one"
    return f"{result['annotation']}: {result['points']} points ({counts}); {known}"


class Annotation:
    """An object's points with their parts, and where they are kept.

    object_m, world_m (N, 3): the points in the object's frame and in that of the scan; parts (N, 3 bool).
    """

    def __init__(self, project: Project, name: str, n_points: int) -> None:
        """Read the fused scan, and the annotation if there is one."""
        import numpy as np

        from pipeline.artefacts import points, read_json, read_mesh, read_table
        from pipeline.geometry import frames

        self.path = project.folder / f"config/annotations/{name}.parquet"
        self.mesh = read_mesh(project.made(f"fuse/{name}/mesh.ply"))
        cloud_m = points(read_table(project.made(f"fuse/{name}/cloud.parquet"), "cloud"))
        self.object_m = cloud_m[:: -(-len(cloud_m) // max(n_points, 1))]
        T_object_world = np.array(read_json(project.made(f"fuse/{name}/fusion.json"))["T_object_world"])
        self.world_m = frames.apply(frames.inverse(T_object_world), self.object_m)
        self.parts = known(self.path, self.world_m)
        self.saved: dict[str, int] = {}

    def save(self, painted: Any) -> dict[str, int]:
        """Write the parts of all points, a list (N, 3) of 0 and 1; return how many points each part has."""
        import numpy as np
        import pandas as pd

        from pipeline.artefacts import write_table

        parts = np.asarray(painted)
        if parts.shape != self.parts.shape or not np.isin(parts, (0, 1)).all():
            raise PipelineError(
                f"{self.path}: expected 0 or 1 for {len(self.parts)} points and 3 parts, found shape {parts.shape}; "
                "load the page again"
            )
        for part in NEEDED:
            if not parts[:, PARTS.index(part)].any():
                raise PipelineError(f"{self.path}: expected points of the {part}, found none; paint some")
        columns = dict(
            zip(
                (*("x_m", "y_m", "z_m"), *PARTS),
                (*self.world_m.round(5).T, *parts.astype(bool).T),
                strict=True,
            )
        )
        write_table(self.path, pd.DataFrame(columns), "annotation")
        self.saved = {"points": len(parts)} | {part: int(parts[:, k].sum()) for k, part in enumerate(PARTS)}
        return self.saved


def known(path: Path, world_m: "np.ndarray") -> "np.ndarray":
    """Return the parts (N, 3) that an annotation, if there is one, gives points (N, 3) within 5 mm of its own."""
    import numpy as np

    from pipeline.artefacts import points, read_table

    if not path.is_file():
        return np.zeros((len(world_m), len(PARTS)), dtype=bool)
    from scipy.spatial import cKDTree

    table = read_table(path, "annotation")
    distance, index = cKDTree(points(table)).query(world_m)
    return table[list(PARTS)].to_numpy(bool)[index] & (distance < REACH_M)[:, None]
