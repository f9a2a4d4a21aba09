"""Columns of a table between Arrow and NumPy without pandas, which takes longer to load than most stages' tables to read.

Arrow's own conversions, `pa.array` of a list too, load pandas wherever it is installed: 0.17 s of processor time in each of a run's
jobs that read or write a table (those of `label` take 0.42 s, those of `warp` 0.69 s). Buffers do not.
Numbers, truths and words, no lists.
"""

from collections.abc import Mapping, Sequence

import numpy as np
import pyarrow as pa

Columns = dict[str, np.ndarray]


def to_arrow(columns: Mapping[str, np.ndarray | Sequence], schema: pa.Schema) -> pa.Table:
    """Return the columns as a table of a schema; NaN is null, as pandas has it. Raises TypeError where a type does not fit."""
    arrays = [_to_array(columns[field.name], field.type) for field in schema]
    return pa.Table.from_arrays(arrays, schema=schema)


def to_numpy(table: pa.Table) -> Columns:
    """Return the columns of a table as arrays (N,), which may be read-only; null is NaN."""
    return {name: _to_numpy(table.column(name).combine_chunks()) for name in table.column_names}


def _to_array(values: np.ndarray | Sequence, kind: pa.DataType) -> pa.Array:
    missing = None
    if kind == pa.string():
        words = [word.encode() for word in values]
        ends = np.cumsum([0, *map(len, words)], dtype=np.int32)
        data = [ends, b"".join(words)]
    elif kind == pa.bool_():
        data = [_bits(np.asarray(values).astype(bool, casting="safe"))]
    else:
        numbers: np.ndarray = np.asarray(values).astype(_dtype(kind), casting="same_kind")
        missing, data = np.isnan(numbers), [np.ascontiguousarray(numbers)]
    valid = pa.py_buffer(_bits(~missing)) if missing is not None and missing.any() else None
    return pa.Array.from_buffers(kind, len(values), [valid, *map(pa.py_buffer, data)])


def _to_numpy(array: pa.Array) -> np.ndarray:
    valid, data = array.buffers()[:2]
    here = slice(array.offset, array.offset + len(array))
    if array.type == pa.string():
        return np.array(array.to_pylist(), object)
    if array.type == pa.bool_():
        return _truths(data)[here]
    numbers: np.ndarray = np.frombuffer(data, _dtype(array.type))[here]
    return np.where(_truths(valid)[here], numbers, np.nan) if array.null_count else numbers


def _dtype(kind: pa.DataType) -> type:
    return {pa.float64(): np.float64, pa.int64(): np.int64}[kind]


def _bits(truths: np.ndarray) -> np.ndarray:
    return np.packbits(truths, bitorder="little")


def _truths(bits: pa.Buffer) -> np.ndarray:
    return np.unpackbits(np.frombuffer(bits, np.uint8), bitorder="little").view(bool)
