"""Record one demonstration object with a virtual depth camera: a folder in 7-Scenes layout, and the truth beside it."""

from pathlib import Path

from pipeline.command import parser, run


def main() -> None:
    """Parse the options, record, write."""
    options = parser(__doc__)
    options.add_argument("--object", required=True, help="demonstration object")
    options.add_argument("--raw", type=Path, required=True, help="folder for the frames")
    options.add_argument(
        "--truth", type=Path, required=True, help="folder for truth.ply, truth.parquet, truth.json"
    )
    options.add_argument("--views", type=int, default=36, help="number of views")
    options.add_argument("--distance-m", type=float, default=0.6, help="from the camera to the object")
    options.add_argument("--noise", type=float, default=1.0, help="factor on the sensor's noise")
    options.add_argument("--seed", type=int, default=1)
    o = options.parse_args()

    from pipeline.scan import recording, truth
    from pipeline.scan.shapes import shape

    body = shape(o.object)
    rng = recording.generator(o.seed, body.name, 0)
    T_world_object = recording.pose_on_table(rng)
    recorded = recording.views(body, T_world_object, o.views, o.distance_m, o.noise, o.seed)
    recording.write(o.raw, recorded)
    truth.write(o.truth, body, T_world_object, rng)


run(main)
