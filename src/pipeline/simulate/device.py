"""A graphics card with a thread for each trial: the only importer of numba-cuda, which compiles the liquid's functions for it.

Those functions ask for no fast mathematics but that zeros have no sign: not a number stays not a number, as a failed trial
needs it.
"""

import math
import warnings
from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
from numba import cuda, types
from numba.cuda.extending import lower_builtin  # type: ignore[attr-defined]  # of numba-cuda

from pipeline.errors import PipelineError

THREADS = 64  # a block; each needs about 170 registers
SHARE_OF_MEMORY = 0.4  # of what is free, for one batch: two jobs at once, as of `snakemake -c2`, have room
ADVICE = "set simulate.device: cpu"


@lower_builtin(np.sqrt, types.float32)
@lower_builtin(np.sqrt, types.float64)
def _sqrt(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
    """Compile np.sqrt, which numba-cuda does not know of a single number, as math.sqrt."""
    return context.get_function(math.sqrt, signature)(builder, arguments)


class Card:
    """The graphics card, as `batches` uses a device; a `PipelineError` says that there is none."""

    def __init__(self) -> None:
        if not cuda.is_available():
            raise PipelineError(
                f"simulate.device: cuda: expected a graphics card with CUDA and its driver, found none; {ADVICE}"
            )

    def put(self, array: np.ndarray) -> Any:
        """Return a copy of an array in the card's memory."""
        return cuda.to_device(np.ascontiguousarray(array))

    def room(self, shape: tuple[int, ...], dtype: Any) -> Any:
        """Return a new array in the card's memory; what is in it is undefined."""
        return cuda.device_array(shape, dtype)

    def get(self, array: Any) -> np.ndarray:
        """Return a copy of an array of the card's memory."""
        return array.copy_to_host()

    def bytes_free(self) -> float:
        """Return how much memory a batch may take."""
        return SHARE_OF_MEMORY * cuda.current_context().get_memory_info().free

    def run(self, one: Callable[..., None], trials: int, *arguments: Any) -> None:
        """Call `one(t, *arguments)` for every t below `trials`, each in a thread of its own."""
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", message="Grid size")  # few trials are no mistake
            kernel(one)[math.ceil(trials / THREADS), THREADS](trials, arguments)


@cache
def kernel(one: Callable[..., None]) -> Any:
    """Return the kernel (trials, arguments) whose thread t calls `one(t, *arguments)`; compiled at its first launch."""
    in_a_thread = cuda.jit(device=True)(one)

    @cuda.jit
    def threads(trials, arguments):
        t = cuda.grid(1)
        if t < trials:
            in_a_thread(t, *arguments)

    return threads
