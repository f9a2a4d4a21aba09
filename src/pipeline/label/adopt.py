"""Take the labels that a warp gave an object for its annotation, so that it can be a source, too."""

from pathlib import Path

from pipeline import command
from pipeline.artefacts import points, read_json, read_table, write_table

PARTS = ["container", "rim", "handle"]


def main() -> None:
    """Read the label mapping of an object and its fusion; write an annotation, in the scan's world frame."""
    parser = command.parser(__doc__)
    parser.add_argument("--mapping", type=Path, required=True, help="the object's label mapping")
    parser.add_argument("--fusion", type=Path, required=True, help="its fusion.json")
    parser.add_argument("--annotation", type=Path, required=True)
    options = parser.parse_args()

    import numpy as np
    import pandas as pd

    from pipeline.geometry import frames

    mapped = read_table(options.mapping, "mapping")
    T_object_world = np.array(read_json(options.fusion)["T_object_world"])
    world_m = frames.apply(frames.inverse(T_object_world), points(mapped))
    annotation = pd.DataFrame(world_m, columns=["x_m", "y_m", "z_m"])
    annotation[PARTS] = mapped[PARTS].to_numpy(bool)
    write_table(options.annotation, annotation, "annotation")


if __name__ == "__main__":
    command.run(main)
