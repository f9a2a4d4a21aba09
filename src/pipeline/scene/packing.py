"""Arrays in a page: one compressed text that the browser unpacks without a network."""

import base64
import gzip
from collections.abc import Mapping
from typing import Any

import numpy as np

_TYPES = ("float32", "uint32", "uint16", "uint8", "int8")


def pack(arrays: Mapping[str, np.ndarray]) -> dict[str, Any]:
    """Return arrays of the types of JavaScript's typed arrays as JSON, flat; `unpack` in viewer.js undoes it."""
    content, where = b"", {}
    for name, array in arrays.items():
        if array.dtype.name not in _TYPES:
            raise ValueError(f"{name}: expected one of {' '.join(_TYPES)}, found {array.dtype}")
        content += b"\0" * (-len(content) % 4)
        where[name] = {"type": array.dtype.name, "count": int(array.size), "offset": len(content)}
        content += np.ascontiguousarray(array).astype(array.dtype.newbyteorder("<")).tobytes()
    # mtime 0: equal arrays are equal text
    return {"arrays": where, "data": base64.b64encode(gzip.compress(content, 9, mtime=0)).decode()}
