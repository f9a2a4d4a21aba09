"""Many trials at once on a device that has a thread for each: `liquid.pour` and `liquid.fill`, on slices of large arrays.

A batch has trials of the same vessels, with about as many particles. A trial is one serial piece of work, as on a core: its
answer does not depend on the others of its batch. Draws, settled states and Bullet's contacts stay on the core.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import partial
from itertools import groupby, islice
from typing import Any, Protocol

import numpy as np

from pipeline.errors import PipelineError
from pipeline.geometry.frames import apply
from pipeline.simulate.fields import Vessel, Walls
from pipeline.simulate.filling import Filling
from pipeline.simulate.particles import Particles, particles
from pipeline.simulate.pouring import TILT_S, WAIT_S, Pour
from pipeline.simulate.rest import HOLD_S, settle, time_step_s
from pipeline.simulate.threads import fill_one, pour_one
from pipeline.simulate.trials import Row, Trial

AT_ONCE = 16384  # trials of a batch at most, so that the core's memory suffices too

Call = tuple[Any, ...]  # the arguments of `liquid.pour` or `liquid.fill`


class Device(Protocol):
    """What batches need of a device; `device.Card` tells what each does."""

    def put(self, array: np.ndarray) -> Any: ...
    def room(self, shape: tuple[int, ...], dtype: Any) -> Any: ...
    def get(self, array: Any) -> np.ndarray: ...
    def bytes_free(self) -> float: ...
    def run(self, one: Callable[..., None], trials: int, *arguments: Any) -> None: ...


def card(device: str, engine: str) -> Device | None:
    """Return the graphics card, or None for a core, which needs no batches; a `PipelineError` says what is missing."""
    if device == "cpu":
        return None
    if engine != "liquid":
        raise PipelineError(
            f"simulate.device: {device}: expected simulate.engine liquid, found {engine}; set simulate.device: cpu"
        )
    try:
        import numba_cuda  # noqa: F401  # without it numba.cuda is another, which is no longer kept
    except ImportError as missing:
        raise PipelineError(
            f"simulate.device: {device}: expected the package numba-cuda, found none; install it by "
            'pip install -e ".[gpu]", or set simulate.device: cpu'
        ) from missing
    from pipeline.simulate.device import Card

    return Card()


def pourings(device: Device, trials: Iterable[Trial]) -> list[Row]:
    """Return the rows of pouring trials."""
    return _rows(trials, partial(pour_many, device))


def fillings(device: Device, trials: Iterable[Trial]) -> list[Row]:
    """Return the rows of filling trials."""
    return _rows(trials, partial(fill_many, device))


def pour_many(
    device: Device, calls: Sequence[Call], tilt_s: float = TILT_S, wait_s: float = WAIT_S
) -> list[Pour]:
    """Answer calls (vessel, n, lip_m, axis, tilt_rad, seed) of `liquid.pour`, in their order."""
    answers: dict[int, Pour] = {}
    for batch in _batches(device, [(call[:1], call[1:2]) for call in calls]):
        found = _pour_batch(device, [calls[k] for k in batch], tilt_s, wait_s)
        answers.update(zip(batch, found, strict=True))
    return [answers[k] for k in range(len(calls))]


def fill_many(device: Device, calls: Sequence[Call]) -> list[Filling]:
    """Answer calls of `liquid.fill`, their arguments in its order, in their order."""
    answers: dict[int, Filling] = {}
    for batch in _batches(device, [(call[:2], (call[7], call[7] + call[8])) for call in calls]):
        found = _fill_batch(device, [calls[k] for k in batch])
        answers.update(zip(batch, found, strict=True))
    return [answers[k] for k in range(len(calls))]


def _rows(trials: Iterable[Trial], simulate: Callable[[list[Call]], Sequence[Any]]) -> list[Row]:
    """Return the rows of trials: what many of them ask for is simulated at once, again for those that ask again."""
    waiting = iter(trials)
    chunks = iter(lambda: list(islice(waiting, AT_ONCE)), [])
    return [row for chunk in chunks for row in _together(chunk, simulate)]


def _together(trials: Sequence[Trial], simulate: Callable[[list[Call]], Sequence[Any]]) -> list[Row]:
    rows: dict[int, Row] = {}
    results: dict[int, Any] = dict.fromkeys(range(len(trials)))
    while results:
        calls = {}
        for k, result in results.items():
            try:
                calls[k] = trials[k].send(result)
            except StopIteration as end:
                rows[k] = end.value
        results = dict(zip(calls, simulate(list(calls.values())), strict=True))
    return [rows[k] for k in range(len(trials))]


def _batches(device: Device, needs: Sequence[tuple[Sequence[Vessel], Sequence[int]]]) -> Iterator[list[int]]:
    """Yield the numbers of trials that go together; each needs room for so many particles in each of its vessels."""

    def key(k: int) -> tuple[int, ...]:
        return tuple(id(vessel) for vessel in needs[k][0])

    order = sorted(range(len(needs)), key=lambda k: (key(k), sum(needs[k][1])))
    for _, group in groupby(order, key):
        members = list(group)
        vessels, most = needs[members[0]][0], np.max([needs[k][1] for k in members], axis=0)
        each = sum(_bytes(vessel, int(n)) for vessel, n in zip(vessels, most, strict=True))
        size = int(max(1, min(AT_ONCE, device.bytes_free() / each)))
        yield from (members[k : k + size] for k in range(0, len(members), size))


def _bytes(vessel: Vessel, n: int) -> int:
    history = 16 * (HOLD_S + TILT_S + WAIT_S) / time_step_s(vessel)
    return int(history) + sum(array.nbytes for array in particles(n, vessel.walls))


def _pour_batch(device: Device, calls: Sequence[Call], tilt_s: float, wait_s: float) -> list[Pour]:
    vessel, trials = calls[0][0], len(calls)
    starts = [settle(vessel, n, seed) for _, n, _, _, _, seed in calls]
    room = _room(device, vessel, starts, max(n for _, n, *_ in calls))
    dt = time_step_s(vessel)
    steps = int((HOLD_S + tilt_s + wait_s) / dt) + 1
    history, found = device.room((trials, steps, 2), np.float64), device.room((trials, 6), np.float64)
    lips, axes, tilts = (device.put(np.array([call[k] for call in calls], float)) for k in (2, 3, 4))
    device.run(
        pour_one, trials, room, _walls(device, vessel), lips, axes, tilts, device.put(vessel.cavity.rim_m),
        dt, steps, float(tilt_s), history, found,
    )  # fmt: skip
    return [
        _pour_of(call[1], len(start), *row)
        for call, start, *row in zip(calls, starts, device.get(found), device.get(history), strict=True)
    ]


def _pour_of(n: int, started: int, found: np.ndarray, history: np.ndarray) -> Pour:
    left, leaked, well, error, taken, retained = found.tolist()
    history = history[: int(taken)].copy()
    return Pour(
        n, int(left) + n - started, int(retained), int(leaked), error, not well,
        history[:, 1] / max(n, 1), history[:, 0],
    )  # fmt: skip


def _fill_batch(device: Device, calls: Sequence[Call]) -> list[Filling]:
    held, second, trials = calls[0][0], calls[0][1], len(calls)
    n_held, n_second = ([call[k] for call in calls] for k in (7, 8))
    starts = [
        [settle(vessel, call[7 + k], (call[9], k)) for call in calls]
        for k, vessel in enumerate((held, second))
    ]
    rooms = [
        _room(device, held, starts[0], max(n_held)),
        _room(device, second, starts[1], max(map(sum, zip(n_held, n_second, strict=True)))),
    ]
    short = [len(a) + len(b) < m + n for a, b, m, n in zip(*starts, n_held, n_second, strict=True)]
    T_held, T_second, lips, axes, tilts = (
        np.array([call[k] for call in calls], float) for k in (2, 3, 4, 5, 6)
    )
    lips_world = np.array([apply(T, lip) for T, lip in zip(T_held, lips, strict=True)])
    dt = min(time_step_s(held), time_step_s(second))
    flight = device.room((trials, 2, max(*n_held, 1), 3), np.float64)
    found = device.room((trials, 9), np.float64)
    device.run(
        fill_one, trials, *rooms, _walls(device, held), _walls(device, second), flight,
        *map(device.put, (T_held, lips_world, lips, T_second, axes, tilts, held.cavity.rim_m, np.array(short))),
        dt, found,
    )  # fmt: skip
    return [
        _filling_of(call[7] + call[8], *row)
        for call, *row in zip(calls, short, device.get(found), strict=True)
    ]


def _filling_of(n: int, short: bool, found: np.ndarray) -> Filling:
    over_held, fine_held, over_second, fine_second, retained, in_second, leaked, error, well = found.tolist()
    fine, spilled = fine_held and fine_second, bool(short or over_held or over_second)
    retained, in_second, leaked = int(retained), int(in_second), int(leaked)
    if spilled or not fine:
        return Filling(n, retained, in_second, 0, 0, 0.0, not fine, spilled)
    return Filling(n, retained, in_second, n - retained - in_second - leaked, leaked, error, not well, False)


def _room(device: Device, vessel: Vessel, starts: Sequence[np.ndarray], capacity: int) -> Particles:
    """Return particles as of `particles`, with the trial as the first axis; those of trial t start at starts[t] (n, 3)."""
    one, trials = particles(capacity, vessel.walls), len(starts)
    x, count = np.zeros((trials, *one.x.shape), one.x.dtype), np.zeros((trials, 2), one.count.dtype)
    for t, start in enumerate(starts):
        x[t, : len(start), :3], count[t, 0] = start, len(start)
    given = {"x": x, "count": count}
    return Particles(
        **{
            name: device.put(given[name])
            if name in given
            else device.room((trials, *array.shape), array.dtype)
            for name, array in one._asdict().items()
        }
    )


def _walls(device: Device, vessel: Vessel) -> Walls:
    put = {name: device.put(a) for name, a in vessel.walls._asdict().items() if isinstance(a, np.ndarray)}
    return vessel.walls._replace(**put)
