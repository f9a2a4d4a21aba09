"""How near fusion, labels and parameters come to the truth about the demonstration objects: the truth's only reader."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
import pandas as pd

from pipeline import command
from pipeline.artefacts import normals, points, read_json, read_mesh, read_table, write_json
from pipeline.geometry import frames, hulls
from pipeline.geometry.cavity import Cavity, cavity, pour_axis, retained_volume_m3
from pipeline.geometry.surface import Surface

PARTS = ("container", "rim", "handle")
SCALARS = {
    **{"radius": "radius_m", "height": "height_m", "capacity": "capacity_m3", "hull_volume": "volume_m3"},
    "wall": "wall_m",
}

WALL_START_M, WALL_SKIN_M = (
    0.003,
    0.0003,
)  # where rays through the wall start, and how they leave the surface they hit
# A true point counts as covered when a seen point is as near as the cloud's spacing lets expect, and the surface nearer.
SEEN_WITHIN_M, COVERED_WITHIN_MM = 0.004, 1.5


def main() -> None:
    """Compare what the stages found of one demonstration object with its truth; write the errors."""
    parser = command.parser(__doc__)
    parser.add_argument("--processed", type=Path, required=True, help="folder of the stages' artefacts")
    parser.add_argument("--source", required=True, help="name of the annotated object")
    parser.add_argument("--object", required=True, help="name of the demonstration object")
    parser.add_argument("--errors", type=Path, required=True, help="errors to write, JSON")
    options = parser.parse_args()
    with command.steps(f"comparing {options.object} with its truth", 3) as tell:
        found = errors(options.processed, options.source, options.object, tell)
    write_json(options.errors, found)


@dataclass(frozen=True)
class Truth:
    """A demonstration object as it is: facts, points on its surface, and where the fused object is in its frame."""

    facts: dict
    cloud: pd.DataFrame
    mesh: tuple[np.ndarray, np.ndarray]
    T_truth_object: np.ndarray

    @cached_property
    def cavity(self) -> Cavity:
        """The true object's room for liquid."""
        return cavity(*self.mesh, name="the true object")

    @cached_property
    def inside_m(self) -> np.ndarray:
        """Points (M, 3) that fill the true container's hull evenly."""
        return hulls.points_in_hull(points(self.cloud[self.cloud["container"]]), 20000)


def read_truth(processed: Path, name: str) -> Truth:
    """Read the truth of one demonstration object."""
    folder = processed / "scan" / name
    facts = read_json(folder / "truth.json")
    T_object_world = np.array(read_json(processed / "fuse" / name / "fusion.json")["T_object_world"])
    T_truth_object = frames.inverse(T_object_world @ np.array(facts["T_world_object"]))
    return Truth(
        facts, read_table(folder / "truth.parquet", "truth"), read_mesh(folder / "truth.ply"), T_truth_object
    )


def errors(
    processed: Path, source: str, name: str, tell: Callable[[str], None] = command.untold
) -> dict[str, float]:
    """Return all errors of one object as `<stage>.<what>`; of labels, where it is not the source."""
    tell("surface")
    truth = read_truth(processed, name)
    found = {f"fuse.{key}": value for key, value in fusion_errors(processed, name, truth).items()}
    tell("parameters")
    folder = processed / "parametrise" / source
    parameters = read_table(folder / f"{name}.parquet", "parameters").set_index("mapping")
    for mapping, row in parameters.iterrows():
        compared = parameter_errors(row, truth)
        found |= {f"parametrise.{mapping}.{key}": value for key, value in compared.items()}
    tell("labels")
    return found | (label_errors(processed, source, name, truth) if name != source else {})


def label_errors(processed: Path, source: str, name: str, truth: Truth) -> dict[str, float]:
    """Return the scores of initial labels (`label.`) and of mapped labels (`warp_label_mapping.`)."""
    initial = read_table(processed / "label" / name / "labels.parquet", "labels")
    mapped = read_table(processed / "warp" / source / name / "label_mapping.parquet", "mapping")
    parts = true_parts(initial, truth)
    return {
        f"{stage}.{key}": value
        for stage, table in (("label", initial), ("warp_label_mapping", mapped))
        for key, value in label_scores(table, parts).items()
    }


def fusion_errors(processed: Path, name: str, truth: Truth) -> dict[str, float]:
    """Return how far a fused object is from the true one: surface, walls (mm), capacity, coverage, normals (shares).

    Surface: mean and 95 % distances from true points of each wall side to the fused one: what the scan lacks counts, too.
    """
    vertices_m, triangles = read_mesh(processed / "fuse" / name / "mesh.ply")
    fused = Surface(frames.apply(truth.T_truth_object, vertices_m), triangles)
    distance_mm = fused.distance(points(truth.cloud)) * 1e3
    inner = truth.cloud["inner"].to_numpy()
    found_m3 = cavity(vertices_m, triangles, name=name).capacity_m3
    cloud = read_table(processed / "fuse" / name / "cloud.parquet", "cloud")
    return {
        "inner_error_mm_mean": float(distance_mm[inner].mean()),
        "outer_error_mm_mean": float(distance_mm[~inner].mean()),
        "inner_error_mm_p95": float(np.quantile(distance_mm[inner], 0.95)),
        "outer_error_mm_p95": float(np.quantile(distance_mm[~inner], 0.95)),
        "wall_error_mm_mean": _wall_error_mm(fused, truth),
        "capacity_relative_error": found_m3 / truth.facts["capacity_m3"] - 1.0,
        "cavity_seen_share": _cavity_seen_share(cloud, distance_mm[inner], truth),
        **_normal_scores(cloud, truth),
    }


def _wall_error_mm(fused: Surface, truth: Truth) -> float:
    """Return the mean absolute error of the wall's thickness, measured along the normal from inside."""
    cloud = truth.cloud[truth.cloud["inner"] & ~truth.cloud["rim"]]
    into = -normals(cloud)
    start = points(cloud) - WALL_START_M * into
    found, true = (_thickness(surface, start, into) for surface in (fused, Surface(*truth.mesh)))
    comparable = np.isfinite(found) & (true < 2.0 * truth.facts["wall_m"])  # not through a handle
    return float(np.abs(found - true)[comparable].mean() * 1e3)


def _thickness(surface: Surface, start: np.ndarray, into: np.ndarray) -> np.ndarray:
    """Return how thick the wall is (N,) along unit directions (N, 3) from points in the open (N, 3)."""
    first = surface.hit(start, into)
    within = np.where(np.isfinite(first), first, 0.0) + WALL_SKIN_M
    return surface.hit(start + within[:, None] * into, into) + WALL_SKIN_M


def _cavity_seen_share(cloud: pd.DataFrame, inner_distance_mm: np.ndarray, truth: Truth) -> float:
    """Return the share of the true cavity's surface that the fused one covers with points that a camera saw."""
    from scipy.spatial import cKDTree

    seen_m = frames.apply(truth.T_truth_object, points(cloud[cloud["seen"]]))
    inner_m = points(truth.cloud[truth.cloud["inner"]])
    near = cKDTree(seen_m).query(inner_m)[0] < SEEN_WITHIN_M
    return float(np.mean(near & (inner_distance_mm < COVERED_WITHIN_MM)))


def _normal_scores(cloud: pd.DataFrame, truth: Truth) -> dict[str, float]:
    """Return the shares of points whose normal is within 10° of the true surface's, and of seen ones that face the wrong side."""
    from pipeline.geometry.open3d_core import open3d as o3d

    scene = o3d.t.geometry.RaycastingScene(nthreads=1)
    vertices_m, triangles = truth.mesh
    tensor = o3d.core.Tensor.from_numpy
    scene.add_triangles(
        tensor(vertices_m.astype(np.float32)), tensor(np.ascontiguousarray(triangles, np.uint32))
    )
    fused_m = frames.apply(truth.T_truth_object, points(cloud)).astype(np.float32)
    true = scene.compute_closest_points(tensor(fused_m), nthreads=1)["primitive_normals"].numpy()
    cosine = np.einsum("ij,ij->i", true, frames.rotate(truth.T_truth_object, normals(cloud)))
    seen, good = cloud["seen"].to_numpy(), cosine > np.cos(np.radians(10.0))
    return {
        "normals_within_10_deg_share": float(good.mean()),
        "seen_normals_within_10_deg_share": float(good[seen].mean()),
        "normals_flipped_share": float((cosine[seen] < 0.0).mean()),
    }


def true_parts(cloud: pd.DataFrame, truth: Truth) -> np.ndarray:
    """Return the parts (N, 3 bool) of fused points: those of the nearest of a few true points on the same side of the wall."""
    from scipy.spatial import cKDTree

    fused_m = frames.apply(truth.T_truth_object, points(cloud))
    facing = frames.rotate(truth.T_truth_object, normals(cloud))
    _, near = cKDTree(points(truth.cloud)).query(fused_m, k=8)
    agrees = np.einsum("nkc,nc->nk", normals(truth.cloud)[near], facing) > 0.0
    first = np.take_along_axis(near, np.argmax(agrees, axis=1)[:, None], axis=1)[:, 0]
    return truth.cloud[list(PARTS)].to_numpy(bool)[first]


def label_scores(labels: pd.DataFrame, parts: np.ndarray) -> dict[str, float]:
    """Return IoU and balanced accuracy of each part that has two classes on this object, and the baseline's.

    The baseline calls every point container and nothing else. The object's own balanced accuracy is the mean of rim and handle:
    what is container is what is no handle, and would count twice.
    """
    scores: dict[str, float] = {}
    for column, part in enumerate(PARTS):
        true, found = parts[:, column], labels[part].to_numpy(bool)
        if true.all() or not true.any():
            continue
        baseline = np.full(len(true), part == "container")
        scores[f"{part}.iou"], scores[f"{part}.baseline_iou"] = _iou(found, true), _iou(baseline, true)
        scores[f"{part}.balanced_accuracy"] = _balanced_accuracy(found, true)
        scores[f"{part}.baseline_balanced_accuracy"] = _balanced_accuracy(baseline, true)
    for kind in ("balanced_accuracy", "baseline_balanced_accuracy"):
        of_parts = [scores[key] for part in ("rim", "handle") if (key := f"{part}.{kind}") in scores]
        scores[kind] = sum(of_parts) / len(of_parts)
    return scores


def _iou(found: np.ndarray, true: np.ndarray) -> float:
    return float((found & true).sum() / (found | true).sum())


def _balanced_accuracy(found: np.ndarray, true: np.ndarray) -> float:
    return float((found[true].mean() + (~found[~true]).mean()) / 2.0)


def parameter_errors(row: pd.Series, truth: Truth) -> dict[str, float]:
    """Return relative errors of the scalars, the opening's error (mm) and those of the tilt references (degrees).

    `row` is of table `parameters`; a scalar that it could not tell is left out. The tilt reference's truth is the same
    functional of the true hull, at the true rim point nearest to the warped lip; that on the cavity is what hydrostatics
    says there.
    """
    true_value = {**truth.facts, "volume_m3": truth.facts["hull_volume_m3"]}
    errors = {
        name: float(row[key] / true_value[key] - 1.0)
        for name, key in SCALARS.items()
        if np.isfinite(row[key])
    }
    rim_m = points(truth.cloud[truth.cloud["rim"]])
    opening_m = rim_m.mean(axis=0)
    found_m, lip_m = (
        frames.apply(truth.T_truth_object, row[[f"{what}_{axis}_m" for axis in "xyz"]].to_numpy(float))
        for what in ("opening", "lip")
    )
    errors["opening_mm"] = float(np.linalg.norm(found_m - opening_m) * 1e3)
    true_lip_m = rim_m[np.argmin(np.linalg.norm(rim_m - lip_m, axis=1))]
    true_tilt_rad = hulls.tilt_reference_rad(truth.inside_m, true_lip_m, opening_m)
    errors["tilt_reference_deg"] = float(np.degrees(row["tilt_reference_rad"] - true_tilt_rad))
    half_rad = half_emptied_rad(truth.cavity, lip_m)
    errors["tilt_reference_cavity_deg"] = float(np.degrees(row["tilt_reference_cavity_rad"] - half_rad))
    return errors


def half_emptied_rad(cup: Cavity, lip_m: np.ndarray) -> float:
    """Return the tilt at which hydrostatics leaves half of a brimful cup, about its rim point nearest to a lip (3,)."""
    own_lip_m = cup.rim_m[np.argmin(np.linalg.norm(cup.rim_m - lip_m, axis=1))]
    tilts = np.radians(np.arange(0.0, 150.0, 0.5))
    kept = retained_volume_m3(cup, own_lip_m, pour_axis(cup.opening_m, own_lip_m), tilts)
    return float(np.interp(-cup.capacity_m3 / 2.0, -kept, tilts))


if __name__ == "__main__":
    command.run(main)
