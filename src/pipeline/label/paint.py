"""Annotate a source: give its scanned points parts by boxes drawn on views of the scan."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

from pipeline import command
from pipeline.artefacts import points, read_json, read_table, write_table
from pipeline.errors import PipelineError

if TYPE_CHECKING:
    import numpy as np

PARTS = ("container", "rim", "handle")


def main() -> None:
    """Read a fused cloud and strokes; write the annotation, in the scan's world frame."""
    parser = command.parser(__doc__)
    parser.add_argument("--cloud", type=Path, required=True, help="the source's fused cloud")
    parser.add_argument("--fusion", type=Path, required=True, help="its fusion.json")
    parser.add_argument(
        "--strokes", type=Path, required=True, help="YAML: boxes and their parts, world frame, metres"
    )
    parser.add_argument("--annotation", type=Path, required=True)
    parser.add_argument("--points", type=int, default=6000, help="points kept, at most")
    options = parser.parse_args()

    import numpy as np
    import pandas as pd

    from pipeline.geometry import frames

    cloud_m = points(read_table(options.cloud, "cloud"))
    T_object_world = np.array(read_json(options.fusion)["T_object_world"])
    world_m = frames.apply(frames.inverse(T_object_world), cloud_m)
    world_m = world_m[:: -(-len(world_m) // options.points)].round(5)
    parts = paint(world_m, read_strokes(options.strokes))
    columns = dict(zip((*("x_m", "y_m", "z_m"), *PARTS), (*world_m.T, *parts.T), strict=True))
    write_table(options.annotation, pd.DataFrame(columns), "annotation")


def read_strokes(path: Path) -> list[dict[str, Any]]:
    """Read strokes: a list of {parts: [names], low_m: [x, y, z], high_m: [x, y, z]}."""
    import yaml

    try:
        strokes = yaml.safe_load(path.read_text())
        for stroke in strokes:
            if set(stroke) != {"parts", "low_m", "high_m"} or not set(stroke["parts"]) <= set(PARTS):
                raise ValueError(f"{stroke}")
    except (OSError, ValueError, TypeError, yaml.YAMLError) as error:
        raise PipelineError(
            f"{path}: expected a list of strokes, each with parts (of {' '.join(PARTS)}), low_m and high_m (3 numbers), "
            f"found: {error}"
        ) from error
    return strokes


def paint(points_m: "np.ndarray", strokes: list[dict[str, Any]]) -> "np.ndarray":
    """Return the parts (N, 3 bool) of points (N, 3): exactly those of the last stroke whose box holds the point."""
    import numpy as np

    parts = np.zeros((len(points_m), len(PARTS)), dtype=bool)
    for stroke in strokes:
        inside = ((points_m >= stroke["low_m"]) & (points_m <= stroke["high_m"])).all(axis=1)
        parts[inside] = [part in stroke["parts"] for part in PARTS]
    return parts


if __name__ == "__main__":
    command.run(main)
