import numpy as np
import pandas as pd

from pipeline.report.claims import claims
from pipeline.report.roc import draw, mean_curves
from pipeline.report.style import save


def curve(training_object: str, draw_number: int, tpr: list[float]) -> pd.DataFrame:
    head = {
        "experiment": "pouring",
        "features": "standard",
        "split": "novel",
        "training_object": training_object,
    }
    return pd.DataFrame({**head, "draw": draw_number, "fpr": [0.0, 0.5, 1.0], "tpr": tpr})


def test_draws_are_averaged_within_an_object_before_objects_are():
    # The cup has three draws and the bowl one; each object counts once.
    curves = pd.concat(
        [*(curve("cup", i, [0.0, 0.2, 1.0]) for i in range(3)), curve("bowl", 0, [0.4, 0.8, 1.0])]
    )
    np.testing.assert_allclose(mean_curves(curves)["mean"], [0.2, 0.5, 1.0])


def test_bands_are_over_draws_and_objects():
    curves = pd.concat(
        curve(cup, draw_number, [tpr, tpr, 1.0])
        for cup, every in {"cup": [0.0, 0.4], "bowl": [0.1, 0.2, 0.3]}.items()
        for draw_number, tpr in enumerate(every)
    )
    found = mean_curves(curves)
    np.testing.assert_allclose(found["low"], [0.1, 0.1, 1.0])
    np.testing.assert_allclose(found["high"], [0.3, 0.3, 1.0])


def test_the_figure_is_the_same_bytes_for_the_same_curves(tmp_path):
    curves = curve("cup", 0, [0.2, 0.8, 1.0])
    scores = pd.DataFrame({"experiment": ["pouring"], "features": "standard", "split": "novel", "auc": 0.8})
    for name in ("one.pdf", "two.pdf"):
        save(draw(curves, scores), tmp_path / name)
    assert (tmp_path / "one.pdf").read_bytes() == (tmp_path / "two.pdf").read_bytes()
    assert (tmp_path / "one.pdf").read_bytes().startswith(b"%PDF")


def metrics(**auc: float) -> dict[str, float]:
    values = {
        "classify.pouring.same_auc_difference_max": 0.0,
        "classify.pouring.label_mapping.novel.tpr_at_fpr_01": 0.4,
    }
    for experiment in ("pouring", "filling"):
        for features in ("label_mapping", "point_mapping", "standard"):
            for split in ("same", "novel"):
                key = f"{experiment}_{features}_{split}"
                values[f"classify.{experiment}.{features}.{split}.auc"] = auc.get(key, 0.9)
    return values


def test_claims_are_judged_by_the_numbers():
    held = claims(metrics(pouring_standard_novel=0.7, filling_standard_same=0.8, filling_standard_novel=0.6))
    assert held["claims.pouring_smaller_drop_when_warped"] == 0.9 - 0.7
    assert held["claims.pouring_smaller_drop_when_warped.holds"] == 1
    assert held["claims.filling_standard_behind_on_training_object.holds"] == 1
    assert held["claims.pouring_label_above_point_mapping.holds"] == 0
    assert held["claims.filling_label_like_point_mapping.holds"] == 1
    assert held["claims.pouring_true_positives_at_almost_no_false.holds"] == 0
