"""The phase of each moment of a pour: from 0 to 1, with the same events at the same phase in all demonstrations."""

from collections.abc import Sequence

import numpy as np

# A hand at rest before and after the pour: slower than this share of its fastest, in tilt and in place.
AT_REST = 0.02
# The two events are when the tilt first rises above, and last falls below, this share of its range.
EVENT = 0.5


def moving(t_s: np.ndarray, trajectory: np.ndarray) -> slice:
    """Return the rows of a trajectory (T, D) from the first moment at which it moves to the last."""
    speed = np.abs(np.gradient(trajectory, t_s, axis=0))
    fastest = speed.max(axis=0)
    moves = np.flatnonzero((speed > AT_REST * np.where(fastest > 0.0, fastest, 1.0)).any(axis=1))
    return slice(int(moves[0]), int(moves[-1]) + 1) if len(moves) > 1 else slice(0, len(trajectory))


def aligned(times_s: Sequence[np.ndarray], tilts_rad: Sequence[np.ndarray]) -> list[np.ndarray]:
    """Return phases (T_i,) of pours: linear in time but for a smooth warp that puts two events at their mean phase.

    The events are the tilt's way up and its way down; pours that do not all come back share the first alone.
    """
    from scipy.interpolate import PchipInterpolator

    linear = [(t - t[0]) / (t[-1] - t[0]) for t in times_s]
    events = [_events(phase, tilt) for phase, tilt in zip(linear, tilts_rad, strict=True)]
    shared = min(len(one) for one in events)
    common = np.mean([one[:shared] for one in events], axis=0)
    ends = np.array([0.0, *common, 1.0])
    return [
        np.clip(PchipInterpolator(np.array([0.0, *one[:shared], 1.0]), ends)(phase), 0.0, 1.0)
        for phase, one in zip(linear, events, strict=True)
    ]


def _events(phase: np.ndarray, tilt: np.ndarray) -> list[float]:
    level = tilt[0] + EVENT * (tilt.max() - tilt[0])
    above = np.flatnonzero(tilt >= level)
    first, last = above[0], above[-1]
    events = [_crossing(phase, tilt, first - 1, level)] if first > 0 else []
    if events and last + 1 < len(tilt):
        events.append(_crossing(phase, tilt, last, level))
    return [event for event in events if 0.02 < event < 0.98]


def _crossing(phase: np.ndarray, tilt: np.ndarray, row: int, level: float) -> float:
    share = (level - tilt[row]) / (tilt[row + 1] - tilt[row])
    return float(phase[row] + share * (phase[row + 1] - phase[row]))
