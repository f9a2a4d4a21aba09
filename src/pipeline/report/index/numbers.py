"""The page's numbers, from the flat objects of reports/*.json; what is not there is left out."""

from collections.abc import Sequence
from typing import Any

from pipeline.report.style import COLOURS, WORDS

Numbers = dict[str, float]

EXPERIMENTS = {"pouring": "Pouring", "filling": "Filling"}
FEATURES = ("label_mapping", "point_mapping", "standard", "hydrostatic")


def headlines(numbers: Numbers) -> list[dict[str, str]]:
    """Return the few numbers that a reader should take away: value, what it is, what it is to be read against."""
    found = []
    for experiment, title in EXPERIMENTS.items():
        head = f"classify.{experiment}"
        of = {features: numbers.get(f"{head}.{features}.novel.auc") for features in FEATURES}
        if of["label_mapping"] is not None:
            beside = [f"{of[f]:.3f} {WORDS[f]}" for f in ("standard", "hydrostatic") if of[f] is not None]
            what = f"area under the curve, {title.lower()}, novel objects"
            found.append(_headline(f"{of['label_mapping']:.3f}", what, ", ".join(beside)))
    rate = numbers.get("classify.pouring.label_mapping.novel.tpr_at_fpr_01")
    if rate is not None:
        standard = numbers.get("classify.pouring.standard.novel.tpr_at_fpr_01")
        against = f"{standard:.0%} by standard features" if standard is not None else ""
        found.append(_headline(f"{rate:.0%}", "of the true pours found at 1\u00a0% false ones", against))
    trials = sum(numbers.get(f"simulate.{name}.trials", 0) for name in EXPERIMENTS)
    leaked = sum(numbers.get(f"simulate.{name}.leaked", 0) for name in EXPERIMENTS)
    if trials:
        found.append(
            _headline(f"{trials:,.0f}", "trials with liquid", f"{leaked:.0f} particles through a wall")
        )
    return found


def _headline(value: str, what: str, beside: str) -> dict[str, str]:
    return {"value": value, "what": what, "beside": beside}


def scores(numbers: Numbers) -> list[dict[str, Any]]:
    """Return a table an experiment: a row a feature set with its areas on the same and on novel objects."""
    tables = []
    for experiment, title in EXPERIMENTS.items():
        rows = []
        for features in FEATURES:
            head = f"{experiment}.{features}"
            if f"classify.{head}.novel.auc" in numbers:
                cells = {split: _cell(numbers, f"{head}.{split}.auc") for split in ("same", "novel")}
                rate = numbers.get(f"classify.{head}.novel.tpr_at_fpr_01")
                rows.append({"features": WORDS[features], "colour": COLOURS[features], "rate": rate, **cells})
        if rows:
            tables.append({"title": title, "rows": rows})
    return tables


def _cell(numbers: Numbers, name: str) -> dict[str, float | None]:
    """Return a score and, where the evaluation was made, the ends of its interval."""
    ends = {end: numbers.get(f"evaluation.{name}.{end}") for end in ("low", "high")}
    return {"value": numbers.get(f"classify.{name}"), **ends}


def claims(rows: Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
    """Return the rows of evaluation.json's `claims` with value and interval in words."""
    return [
        {
            **{key: row[key] for key in ("section", "words", "measure", "holds", "sure", "why")},
            "value": _said(row["value"]),
            "interval": f"{_said(row['low'])} to {_said(row['high'])}" if row["low"] != row["high"] else "",
        }
        for row in rows
    ]


def _said(value: float) -> str:
    decimals = 3 if value == 0 or abs(value) >= 0.0005 else 5
    return f"{value:.{decimals}f}".replace("-", "−")
