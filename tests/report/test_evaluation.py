from itertools import pairwise

import numpy as np
import pandas as pd
import pytest

from pipeline.report import evaluation_numbers as by
from pipeline.report.ablations import ablation_numbers, draw
from pipeline.report.claims import CLAIMS, claims
from pipeline.report.claims_page import claims_page
from pipeline.report.evaluation_pages import matrices_page, scores_page
from pipeline.report.learning_page import learning_page
from pipeline.report.style import save
from pipeline.statistics.resampling import COLUMNS, object_weights

NAMES = ["cup", "bowl", "mug"]
WEIGHTS = object_weights(3, 40, 0)
SETS = ("label_mapping", "point_mapping", "standard", "hydrostatic")


def replicates(shift: float = 0.0, seed: int = 0) -> pd.DataFrame:
    """Return a table of 41 replicates: novel areas 0.9, of standard 0.7, and 0.05 more on the training object."""
    rng, rows = np.random.default_rng(seed), []
    for experiment in ("pouring", "filling"):
        common = rng.normal(0, 0.01, 41)
        for features in SETS:
            for split in ("same", "novel"):
                value = (0.7 if features == "standard" else 0.9) + 0.05 * (split == "same") + shift
                frame = pd.DataFrame(dict.fromkeys(COLUMNS, value + common)).assign(replicate=range(41))
                frame.loc[0, list(COLUMNS)] = value
                rows.append(frame.assign(experiment=experiment, features=features, split=split, samples=50))
    return pd.concat(rows, ignore_index=True)


def test_paired_differences_lose_what_both_have_in_common():
    numbers = by.score_numbers(by.by_name(replicates()))
    head = "evaluation.pouring.label_mapping_minus_standard.novel.auc"
    assert numbers[head] == pytest.approx(0.2)
    assert numbers[f"{head}.high"] - numbers[f"{head}.low"] < 1e-12
    assert numbers["evaluation.pouring.standard.novel.auc.high"] > 0.71
    assert numbers[f"{head}.p"] == pytest.approx(2 / 41)


def predictions(n: int = 4000, seed: int = 0) -> pd.DataFrame:
    """Return predictions on novel objects that are right on average, but for those on the bowl, which are 0.2 too high."""
    rng = np.random.default_rng(seed)
    pairs = [(a, b) for a in NAMES for b in NAMES if a != b]
    trainer, test = np.array(pairs)[rng.integers(len(pairs), size=n)].T
    truth = rng.uniform(0.0, 0.8, n)
    return pd.DataFrame(
        {
            **{"features": "label_mapping", "split": "novel", "draw": 0, "trial": rng.integers(500, size=n)},
            **{"training_object": trainer, "test_object": test, "label": rng.random(n) < truth},
            "probability": truth + 0.2 * (test == "bowl"),
        }
    )


def test_reliability_is_that_of_the_objects_that_were_drawn():
    curve = by.calibration(predictions(40000), NAMES, np.vstack([WEIGHTS, [1, 0, 1], [1, 1, 0]]))
    assert curve["error"][0] == pytest.approx(0.2 / 3, abs=0.02)
    assert curve["error"][-2] < 0.02  # cup and mug alone
    assert curve["error"][-1] == pytest.approx(0.1, abs=0.02)
    well = np.isfinite(curve["predicted"][-2])
    np.testing.assert_allclose(curve["predicted"][-2][well], curve["observed"][-2][well], atol=0.05)


def test_delong_stands_beside_the_bootstrap():
    numbers = by.delong_numbers("pouring", predictions(), NAMES, WEIGHTS)
    head = "evaluation.pouring.label_mapping.novel.auc_half_width"
    assert 0.0 < numbers[f"{head}.delong"] < 0.05
    assert numbers[f"{head}.ratio"] == pytest.approx(1.0, rel=2.0)


def test_halves_are_scored_apart():
    table = predictions()
    half = pd.Series(np.where(np.arange(500) % 2, "free_room", "relative"))
    index = pd.MultiIndex.from_product([NAMES, range(500)])
    found = by.halves(table, pd.Series(np.tile(half, 3), index), NAMES, WEIGHTS)
    assert set(found) == {
        f"classify.filling.label_mapping.novel.{name}.auc" for name in ("free_room", "relative")
    }


def areas(names: list[str] = NAMES) -> pd.DataFrame:
    """Return areas of each object on each: 0.99 on itself, 0.9 on the next, 0.8 on the one after, and so on."""
    return pd.DataFrame(
        [
            {"experiment": "pouring", "features": name, "training_object": a, "test_object": b}
            | {"auc": (0.99, 0.9, 0.8)[(place - row) % 3]}
            for name in SETS
            for row, a in enumerate(names)
            for place, b in enumerate(names)
        ]
    )


def test_each_object_has_its_mean_over_the_others_as_trainer_and_as_test():
    pairs = areas()
    pairs.loc[pairs["test_object"] == "mug", "auc"] = 0.6
    numbers = by.object_numbers(pairs, WEIGHTS)
    head = "evaluation.pouring.standard"
    assert numbers[f"{head}.trained_on.cup.auc"] == pytest.approx((0.9 + 0.6) / 2)
    assert numbers[f"{head}.trained_on.cup.auc.low"] == pytest.approx(0.6)  # a replicate without the bowl
    assert numbers[f"{head}.trained_on.cup.auc.high"] == pytest.approx(0.9)
    assert numbers[f"{head}.tested_on.mug.auc"] == pytest.approx(0.6)
    assert len(numbers) == 3 * 2 * 3 * len(SETS)


def texts(figure) -> list[str]:
    """Return all texts of a figure's axes and margins."""
    return [text.get_text() for text in written(figure)]


def written(figure) -> list:
    """Return all texts that a figure shows: its own, and of its axes also titles, labels of ticks and legends."""
    every = [*figure.texts]
    for axis in figure.axes:
        ticks = [*axis.get_xticklabels(), *axis.get_yticklabels()] if axis.axison else []
        legend = axis.get_legend()
        every += [*axis.texts, axis.title, *ticks, *(legend.get_texts() if legend else [])]
    return [text for text in every if text.get_text() and text.get_visible()]


def test_both_warped_sets_are_tested_against_the_standard_one_on_the_page():
    table = replicates()
    table.loc[table["features"] == "point_mapping", "auc"] -= 0.05
    page = scores_page(by.score_numbers(by.by_name(table)), ["pouring"], {})
    said = [text for text in texts(page) if text.startswith("Δ")]
    assert [text.split()[1] for text in said[:2]] == ["+0.200", "+0.150"]


def test_the_learning_page_draws_what_its_legend_shows_and_tells_how_fits_went():
    numbers = by.score_numbers(by.by_name(replicates()))
    numbers |= {f"evaluation.pouring.{name}": n for name, n in
                {"fits": 600, "converged_share": 0.995, "iterations_max": 9, "redrawn": 3}.items()}  # fmt: skip
    learning = pd.concat([replicates().assign(samples=n, separable_share=0.5) for n in (10, 50)])
    page = learning_page(learning, ["pouring"], numbers)
    ceiling = page.legends[0].legend_handles[-1]
    assert (ceiling.get_label(), ceiling.get_linestyle()) == ("hydrostatic ceiling", ":")
    assert any("600 fits: 99.5% converged, after 9 iterations" in text for text in texts(page))
    assert any("3 training sets of one outcome" in text for text in texts(page))
    assert page.axes[0].get_title() == "Pouring, novel objects (hydrostatics 0.900)"


def test_numbers_of_forty_objects_stay_in_their_cells():
    pairs = areas([f"cup_{number}" for number in range(40)])
    figure = matrices_page(pairs, ["pouring", "filling"], by.object_numbers(pairs, object_weights(40, 20, 0)))
    figure.canvas.draw()
    axis = figure.axes[0]
    cell = axis.get_window_extent().width / 40
    numbers = [text for text in axis.texts if text.get_ha() == "center"]
    assert len(numbers) == 41 * 40
    assert max(text.get_window_extent().width for text in numbers) < cell
    beside = [text.get_window_extent() for text in axis.texts if text.get_ha() != "center"]
    assert all(above.y0 > below.y1 - 1 for above, below in pairwise(beside))


@pytest.mark.parametrize("page", ["scores", "matrices", "claims"])
def test_nothing_leaves_the_paper(page):
    numbers = by.score_numbers(by.by_name(replicates())) | by.object_numbers(areas(), WEIGHTS)
    figure = {
        "scores": lambda: scores_page(numbers, ["pouring", "filling"], {}),
        "matrices": lambda: matrices_page(areas(), ["pouring", "filling"], numbers),
        "claims": lambda: claims_page(by.claim_rows(all_values())),
    }[page]()
    figure.canvas.draw()
    every = written(figure)
    assert max(text.get_window_extent().x1 for text in every) < 0.985 * figure.bbox.width
    assert min(text.get_window_extent().y0 for text in every) > 0.005 * figure.bbox.height


def all_values() -> dict[str, np.ndarray]:
    values = by.by_name(replicates())
    values |= {f"classify.{name}.same_auc_difference_max": 0.0 for name in ("pouring", "filling")}
    for half in ("relative", "free_room"):
        values[f"classify.filling.label_mapping.novel.{half}.auc"] = np.full(41, 0.8)
    return values


def test_every_claim_is_told_with_its_interval():
    rows = by.claim_rows(all_values()).set_index("name")
    assert list(rows.index) == [claim.name for claim in CLAIMS]
    assert rows.loc["filling_standard_behind_on_training_object", "holds"]
    assert not rows.loc["pouring_label_above_point_mapping", "holds"]
    assert rows.loc["pouring_label_above_point_mapping", "why"]
    assert rows["sure"].all()
    numbers = claims({name: np.atleast_1d(value)[0] for name, value in all_values().items()})
    for name, row in rows.iterrows():
        assert numbers[f"claims.{name}"] == pytest.approx(row["value"])
        assert numbers[f"claims.{name}.holds"] == row["holds"]


def test_ablations_are_compared_with_the_default_replicate_by_replicate():
    tables = {("default", "pouring"): replicates(), ("k_5", "pouring"): replicates(0.01)}
    numbers = ablation_numbers(tables)
    head = "ablations.k_5.pouring.label_mapping.novel.auc.minus_default"
    assert numbers[head] == pytest.approx(0.01)
    assert numbers[f"{head}.high"] == pytest.approx(0.01)
    assert "ablations.default.pouring.label_mapping.novel.auc.minus_default" not in numbers


def test_the_pages_are_the_same_bytes_for_the_same_numbers(tmp_path):
    numbers = by.score_numbers(by.by_name(replicates()))
    numbers |= {"evaluation.pouring.label_mapping.novel.calibration_error": 0.1}
    numbers |= by.object_numbers(areas(), WEIGHTS)
    learning = pd.concat([replicates().assign(samples=n, separable_share=0.5) for n in (10, 50)])
    curves = {("pouring", "label_mapping"): by.calibration(predictions(), NAMES, WEIGHTS)}
    ablated = {("default", "pouring"): replicates(), ("k_5", "pouring"): replicates(0.01)}
    for name in ("one.pdf", "two.pdf"):
        pages = [
            scores_page(numbers, ["pouring", "filling"], curves),
            matrices_page(areas(), ["pouring"], numbers),
            learning_page(learning, ["pouring"], numbers),
            claims_page(by.claim_rows(all_values())),
            draw(ablation_numbers(ablated), {"default": ":None", "k_5": "warp.k:5"}, list(ablated), 300, 5),
        ]
        save(pages, tmp_path / name)
    written = (tmp_path / "one.pdf").read_bytes()
    assert (tmp_path / "two.pdf").read_bytes() == written
    assert written.count(b"/Type /Page ") == 5


def test_an_area_that_nothing_tells_is_left_out():
    """Where every filling of a half is spilled there is none to rank: JSON has no word for it."""
    assert by.with_interval("area", np.full(5, np.nan)) == {}
    assert by.with_interval("area", np.array([0.5])) == {"area": 0.5}
