"""From the ten noisy scans to warped parameters by the real workflow, against the objects' known geometry."""

import subprocess
import sys

import numpy as np
import pandas as pd
import pytest
import yaml
from workflow.conftest import ROOT, new_project

from pipeline.report.accuracy import errors, label_scores
from pipeline.report.metrics import accuracy_metrics, warp_metrics

NAMES = yaml.safe_load((ROOT / "config/config.yaml").read_text())["scan"]["objects"]


@pytest.fixture(scope="module")
def metrics(tmp_path_factory) -> dict[str, float]:
    folder = tmp_path_factory.mktemp("accuracy")
    new_project(folder)
    targets = [f"data/processed/warp/mug/{name}/alignment.json" for name in NAMES]
    targets += ["data/processed/parametrise/mug/parameters.parquet"]
    call = [sys.executable, "-m", "snakemake", "-c2", *targets, "--config", "track={enabled: false}"]
    told = subprocess.run(call, cwd=folder, capture_output=True, text=True)
    assert told.returncode == 0, told.stderr
    processed = folder / "data/processed"
    found = {name: errors(processed, "mug", name) for name in NAMES}
    return accuracy_metrics(found) | warp_metrics(processed, "mug", NAMES)


def test_balanced_accuracy_is_the_mean_over_targets_of_the_mean_over_rim_and_handle():
    parts = np.array([[True, True, False]] * 4 + [[True, False, False]] * 4 + [[False, False, True]] * 2)
    found = pd.DataFrame(parts, columns=["container", "rim", "handle"])
    found.loc[0, "rim"], found.loc[8, "handle"] = False, False
    with_handle = label_scores(found, parts)
    assert with_handle["balanced_accuracy"] == pytest.approx((0.875 + 0.75) / 2)
    without = label_scores(found[:8], parts[:8])
    assert without["balanced_accuracy"] == without["rim.balanced_accuracy"] == pytest.approx(0.875)
    of_objects = {
        name: {"fuse.inner_error_mm_mean": 0.0, "fuse.outer_error_mm_mean": 0.0}
        | {f"warp_label_mapping.{key}": value for key, value in scores.items()}
        for name, scores in (("jug", with_handle), ("cup", without))
    }
    over_targets = accuracy_metrics(of_objects)["warp.label_mapping.balanced_accuracy"]
    assert over_targets == pytest.approx((0.8125 + 0.875) / 2)


@pytest.mark.long
def test_fused_surfaces_are_near_the_true_ones_on_both_sides_of_the_wall(metrics):
    for name in NAMES:
        assert metrics[f"fuse.{name}.inner_error_mm_mean"] < 0.6, name
        assert metrics[f"fuse.{name}.outer_error_mm_mean"] < 0.6, name
        assert metrics[f"fuse.{name}.inner_error_mm_p95"] < 1.5, name
        assert metrics[f"fuse.{name}.outer_error_mm_p95"] < 1.5, name
        assert metrics[f"fuse.{name}.wall_error_mm_mean"] < 0.5, name
    assert metrics["fuse.capacity.relative_error_max"] < 0.02


@pytest.mark.long
def test_the_cavity_is_seen_and_its_normals_are_true(metrics):
    assert metrics["fuse.cavity_seen_share_min"] > 0.98
    assert metrics["fuse.seen_normals_within_10_deg_share"] > 0.95
    assert metrics["fuse.seen_normals_within_10_deg_share_min"] > 0.95
    assert metrics["fuse.normals_flipped_share_max"] < 0.001


@pytest.mark.long
def test_labels_find_the_parts_that_the_baseline_misses(metrics):
    """The baseline calls every point container and nothing else."""
    assert metrics["label.balanced_accuracy"] >= 0.85
    assert metrics["warp.label_mapping.balanced_accuracy"] >= 0.97
    for stage in ("label", "warp.label_mapping"):
        assert metrics[f"{stage}.baseline_balanced_accuracy"] == 0.5, stage
    for part, least in {"rim": 0.75, "handle": 0.80}.items():
        assert metrics[f"warp.label_mapping.{part}.iou"] >= least, part
        assert metrics[f"warp.label_mapping.{part}.baseline_iou"] == 0.0, part


@pytest.mark.long
def test_no_wall_is_crossed_and_no_point_left_alone(metrics):
    for mapping in ("label_mapping", "point_mapping"):
        assert metrics[f"warp.{mapping}.wall_side_flips"] == 0.0, mapping
        assert metrics[f"warp.{mapping}.share_without_candidate"] < 0.01, mapping
        assert metrics[f"warp.{mapping}.residual_m"] <= 0.002, mapping


BARS = {
    **{"radius.relative_error_max": 0.01, "height.relative_error_max": 0.01},
    **{"hull_volume.relative_error_max": 0.02, "capacity.relative_error_max": 0.02},
    "opening.error_mm_max": 1.0,
    **{"tilt_reference.error_deg_max": 1.5, "tilt_reference_cavity.error_deg_max": 1.5},
}


@pytest.mark.long
@pytest.mark.parametrize("bar", BARS)
def test_parameters_are_near_the_true_ones(metrics, bar):
    assert metrics[f"parametrise.label_mapping.{bar}"] <= BARS[bar]
    assert f"parametrise.point_mapping.{bar}" in metrics  # reported beside it
