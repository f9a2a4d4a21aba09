"""What an object costs from its fused cloud to its parameters: `python benchmarks/parameters.py` after `snakemake -c2`.

Processor seconds of the commands label, warp and parametrise as the workflow calls them, one thread, start-up and all; of the
start-up alone (python with the modules that all three import); the least of some rounds.
"""

import argparse
import os
import resource
import subprocess
import sys
from pathlib import Path

import numpy as np
import yaml

ROOT = Path(__file__).parents[1]
ONE_THREAD = {f"{name}_NUM_THREADS": "1" for name in ("OMP", "OPENBLAS", "MKL", "NUMBA")}


def commands(processed: Path, config: dict, source: str, name: str, out: Path) -> dict[str, list[str]]:
    """Return the stages' calls for an object, which write below `out`."""
    fuse, label = processed / "fuse", processed / "label"
    warp = {key: out / f"{key}.parquet" for key in ("point_mapping", "label_mapping")}
    maps = [word for key, path in warp.items() for word in (f"--{key.replace('_', '-')}", str(path))]
    label_call = ["--source-cloud", fuse / source / "cloud.parquet", "--cloud", fuse / name / "cloud.parquet"]
    label_call += [
        "--source-fusion",
        fuse / source / "fusion.json",
        "--classifier",
        label / "classifier.json",
    ]
    label_call += [
        "--annotation",
        ROOT / f"config/annotations/{source}.parquet",
        "--labels",
        out / "l.parquet",
    ]
    warp_call = ["--source-labels", label / source / "labels.parquet", *maps, "--warp", out / "w.npz"]
    warp_call += ["--target-labels", label / name / "labels.parquet", "--alignment", out / "a.json"]
    warp_call += [word for key, value in config["warp"].items() for word in (f"--{key}", value)]
    read_off = ["--object", name, *maps, "--parameters", out / "p.parquet"]
    read_off += [
        "--tilt-references",
        out / "t.parquet",
        "--hull-points",
        config["parametrise"]["hull_points"],
    ]
    start = "import numpy, scipy.spatial, pipeline.artefacts"
    return {
        "start-up": [sys.executable, "-c", start],
        "label": [sys.executable, "-m", "pipeline.label", *map(str, label_call)],
        "warp": [sys.executable, "-m", "pipeline.warp", *map(str, warp_call)],
        "parametrise": [sys.executable, "-m", "pipeline.parametrise", *map(str, read_off)],
    }


def cpu_s(call: list[str]) -> float:
    """Return the processor seconds of a command, its system time included."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    environment = {**os.environ, **ONE_THREAD, "PYTHONPATH": str(ROOT / "src")}
    subprocess.run(call, check=True, env=environment)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime - before.ru_utime + after.ru_stime - before.ru_stime


def main() -> None:
    """Print a row an object, and the means."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--processed", type=Path, default=Path("data/processed"))
    parser.add_argument("--rounds", type=int, default=3)
    options = parser.parse_args()

    from tempfile import TemporaryDirectory

    config = yaml.safe_load((ROOT / "config/config.yaml").read_text())
    source, found = config["objects"]["source"], []
    with TemporaryDirectory() as folder:
        for path in sorted(options.processed.glob("warp/" + source + "/*/alignment.json")):
            calls = commands(options.processed, config, source, path.parent.name, Path(folder))
            rows = [[cpu_s(call) for call in calls.values()] for _ in range(options.rounds)]
            found.append(np.min(rows, axis=0))
            _say(path.parent.name, calls, found[-1])
    _say("mean", calls, np.mean(found, axis=0))


def _say(name: str, calls: dict[str, list[str]], seconds: np.ndarray) -> None:
    told = "".join(f"{stage} {value:5.2f}   " for stage, value in zip(calls, seconds, strict=True))
    sys.stdout.write(f"{name:15s}{told}all three {seconds[1:].sum():5.2f} s\n")


if __name__ == "__main__":
    main()
