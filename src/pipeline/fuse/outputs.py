"""Where fuse's result goes: mesh, cloud and report, each whole or not at all."""

from pathlib import Path

from pipeline import artefacts
from pipeline.fuse.fusion import Fused


def write(result: Fused, mesh: Path, cloud: Path, report: Path) -> None:
    """Write the surface as PLY, the points as Parquet, what was found as JSON."""
    artefacts.write_mesh(mesh, result.mesh)
    artefacts.write_table(cloud, result.cloud, "cloud")
    artefacts.write_json(report, result.report)
