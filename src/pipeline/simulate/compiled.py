"""Decorators of the compiled code: the cache lasts across processes and notices every edit, and bits do not depend on it.

Numba's own cache looks at the file of the compiled function alone: after an edit to a callee in another file it would go on
running the old one. Here the cache lives in a folder named after the contents of all files with compiled code,
and of those whose constants they read.

A function that is called by another can exist twice, on its own and optimised again within its caller, and which one runs
depends on whether the process compiled it or loaded it. So only those called from Python are functions to the machine
(`compiled`); what they call becomes part of them (`part`, `inlined`), and is written without numpy's own functions on arrays.
"""

import hashlib
import os
from pathlib import Path

import numba
from numba import njit

# Sums keep their order and products their rounding, so the bits are those of every other processor; with "reassoc" and "contract",
# which are 3 % faster, a few particles run over elsewhere. NaN must stay NaN: it marks a failed trial.
_FAST = {"nsz"}


def _cache_folder() -> str:
    here = Path(__file__).parent
    digest = hashlib.sha256()
    for file in sorted(here.glob("*.py")):
        content = file.read_bytes()
        if b"simulate.compiled" in content or file.name in ("fields.py", "particles.py"):
            digest.update(content)
    base = Path(os.environ.get("NUMBA_CACHE_DIR") or here / "__pycache__")
    return str(base / f"numba-{digest.hexdigest()[:16]}")


# Off in numba since LLVM 11, which made wrong code with it (numba 8852); with LLVM 20 our tests pass. It saves a sixth.
numba.config.SLP_VECTORIZE = 1  # type: ignore[attr-defined]
numba.config.CACHE_DIR = _cache_folder()  # type: ignore[attr-defined]

compiled = njit(cache=True, nogil=True, fastmath=_FAST, error_model="numpy")
part = njit(cache=True, nogil=True, fastmath=_FAST, error_model="numpy", forceinline=True)
inlined = njit(
    cache=True, nogil=True, fastmath=_FAST, error_model="numpy", inline="always"
)  # also spares counting references
