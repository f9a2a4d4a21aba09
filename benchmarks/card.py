"""How many trials a graphics card does in a second, and how many of them end as on a core: `benchmarks/liquid.py --device cuda`."""

import time
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from pipeline.simulate import batches, liquid

CORE_TRIALS = 400


def measure(pours: Sequence[batches.Call], fillings: Sequence[batches.Call]) -> dict[str, float]:
    """Return trials per second of all calls on the card and of the first on one core, settled starts included, and the
    share of equal labels; a `PipelineError` says that there is no card.
    """
    card = batches.card("cuda", "liquid")
    return {
        **_compare(card, "pours", pours, liquid.pour, batches.pour_many, lambda pour: pour.n_left > 0),
        **_compare(
            card, "fillings", fillings, liquid.fill, batches.fill_many,
            lambda filling: filling.n_spilled + filling.n_retained == 0,
        ),
    }  # fmt: skip


def _compare(
    card: Any,
    name: str,
    calls: Sequence[batches.Call],
    alone: Callable[..., Any],
    together: Callable[..., Sequence[Any]],
    label: Callable[[Any], bool],
) -> dict[str, float]:
    few = calls[:CORE_TRIALS]
    compiled_s, _ = _timed(lambda: together(card, few[:1]))
    card_s, many = _timed(lambda: together(card, calls))
    core_s, beside = _timed(lambda: [alone(*call) for call in few])
    rate, one = len(calls) / card_s, len(few) / core_s
    equal = [label(a) == label(b) for a, b in zip(many[: len(few)], beside, strict=True)]
    return {
        f"{name}_compiled_s": compiled_s,
        f"{name}_per_s_card": rate,
        f"{name}_per_s_one_core": one,
        f"{name}_ratio": rate / one,
        f"{name}_equal_labels": float(np.mean(equal)),
    }


def _timed(call: Callable[[], Any]) -> tuple[float, Any]:
    start = time.perf_counter()
    result = call()
    return time.perf_counter() - start, result
