"""When an execution has succeeded, and what it failed of."""

import pandas as pd
import pytest

from pipeline.execute import verdict

NAMES = {"held_object": "cup", "target_object": "bowl", "features": "standard"}
WELL = {
    **{"n_balls": 105, "n_poured": 105, "n_in_target": 105, "n_spilled": 0, "n_overflowed": 0, "n_early": 0},
    **{"n_leaked": 0, "first_drop_s": 3.0, "first_spill_s": float("nan"), "failed": False},
}


def judged(refusals, liquid=False, **outcome):
    """The verdict on one draw with these refusals, in order ('' is the one that the arm followed)."""
    attempts = pd.DataFrame(
        {**NAMES, "draw": 0, "attempt": k, "refused": why, "duration_s": 6.0, "off_plan_m": 0.001}
        for k, why in enumerate(refusals)
    )
    rows = [{**NAMES, "draw": 0, **WELL, **outcome}] if refusals[-1] == "" else []
    carried = pd.DataFrame(rows, columns=[*NAMES, "draw", *WELL])
    return verdict.executions(attempts, carried, liquid).iloc[0]


@pytest.mark.parametrize(
    ("outcome", "cause"),
    [
        ({}, ""),
        ({"n_spilled": 2, "n_early": 2}, ""),
        ({"n_spilled": 3, "n_early": 3}, "early_pour"),
        ({"n_spilled": 9, "n_overflowed": 6, "n_early": 1}, "overflow"),
        ({"n_spilled": 9, "n_overflowed": 2, "n_early": 2}, "aim"),
        ({"n_poured": 83}, "lip"),
        ({"n_poured": 84}, ""),
        ({"n_balls": 99, "n_poured": 99}, "leak"),
        ({"failed": True}, "leak"),
    ],
)
def test_the_cause_is_what_went_wrong_most(outcome, cause):
    row = judged([""], **outcome)
    assert row.cause == cause
    assert row.success == (cause == "")


def test_a_liquid_may_lose_two_in_a_hundred_of_what_is_poured_and_may_be_few_particles():
    assert judged([""], liquid=True, n_balls=50, n_poured=50, n_spilled=1).cause == ""
    assert judged([""], liquid=True, n_balls=49, n_poured=49, n_spilled=1).cause == "aim"


def test_refused_samples_are_counted_and_the_arm_is_the_cause_when_all_were():
    assert judged(["it touches", "too fast", ""]).n_refused == 2
    never = judged(["it touches", "too fast"])
    assert (never.cause, never.n_refused, never.n_poured) == ("arm", 2, 0)
    assert never.refused == "too fast"
