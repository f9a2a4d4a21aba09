"""What is recorded is read off files correctly."""

import os

import pandas as pd
import pytest

from pipeline.artefacts import write_table
from pipeline.track import facts


def _scores(aucs: dict[tuple[str, str, int], float]) -> pd.DataFrame:
    rows = [
        {
            **{
                "experiment": "pouring",
                "features": "standard",
                "split": split,
                "training_object": name,
                "draw": draw,
            },
            **dict.fromkeys(("tpr_at_fpr_00", "tpr_at_fpr_01", "tpr_at_fpr_05", "brier"), 0.0),
            **{
                "n_test": 5,
                "n_positive": 2,
                "n_iterations": 3,
                "n_redrawn": 0,
                "separable": True,
                "converged": True,
            },
            "auc": auc,
        }
        for (split, name, draw), auc in aucs.items()
    ]
    return pd.DataFrame(rows)


def test_means_weigh_objects_not_draws(tmp_path):
    aucs = {
        ("novel", "mug", 0): 0.5,
        ("novel", "mug", 1): 0.7,
        ("novel", "jug", 0): 1.0,
        ("same", "mug", 0): float("nan"),
    }
    write_table(tmp_path / "scores.parquet", _scores(aucs), "scores")
    means = facts.score_means(tmp_path / "scores.parquet")
    assert means["standard"]["novel.auc"] == pytest.approx((0.6 + 1.0) / 2)
    assert "same.auc" not in means["standard"]


def test_flatten_dots_keys_and_joins_lists():
    assert facts.flatten({"a": {"b": {"c": 1}, "d": ["x", "y"]}, "e": 2.5}) == {
        "a.b.c": 1,
        "a.d": "x y",
        "e": 2.5,
    }


def test_digest_sees_contents_and_names_but_not_times_or_hidden_files(tmp_path):
    (tmp_path / "a").mkdir()
    (tmp_path / "a/one").write_text("1")
    before = facts.digest(tmp_path)
    os.utime(tmp_path / "a/one", (1, 1))
    (tmp_path / ".hidden").write_text("x")
    assert facts.digest(tmp_path) == before
    (tmp_path / "a/one").write_text("2")
    changed = facts.digest(tmp_path)
    (tmp_path / "a/one").rename(tmp_path / "a/two")
    assert len({before, changed, facts.digest(tmp_path)}) == 3


def test_seconds_counts_this_call_alone(tmp_path):
    for name, written_s in (("fuse/mug", 200), ("fuse/jug", 200), ("scan/mug", 50)):
        path = tmp_path / f"{name}.tsv"
        path.parent.mkdir(exist_ok=True)
        path.write_text("s\th:m:s\tmax_rss\n1.5\t0:00:01\t10\n")
        os.utime(path, (written_s, written_s))
    assert facts.seconds(tmp_path, since_s=100.0) == {"fuse": 3.0}


def test_scores_of_an_earlier_call_are_left_out_unless_the_report_was_made_from_them(tmp_path):
    for experiment, written_s in (("pouring", 200), ("filling", 50)):
        path = tmp_path / "classify" / experiment / "scores.parquet"
        path.parent.mkdir(parents=True)
        path.touch()
        os.utime(path, (written_s, written_s))
    assert set(facts.experiments(tmp_path, tmp_path, since_s=100.0)) == {"pouring"}
    (tmp_path / "roc.pdf").touch()
    assert set(facts.experiments(tmp_path, tmp_path, since_s=100.0)) == {"pouring", "filling"}
