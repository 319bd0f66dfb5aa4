"""Columns of Parquet files as arrays, without pandas.

What pyarrow has to convert arrays of numpy loads pandas, a tenth of the time of a command that
needs nothing else of it. The memory of both is the same but for the bits of flags and of missing
values: https://arrow.apache.org/docs/format/Columnar.html.
"""

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from auvident.schema.trial import Columns

if TYPE_CHECKING:
    import pyarrow as pa

Array = npt.NDArray[Any]

# types by their names in Arrow
DTYPES = {"double": np.float64, "int64": np.int64}
FLAG, MAY_MISS = "bool", "double"
UNPAIRED = "backslashreplace"  # as in JSON: bytes of a name that are no UTF-8


def read_columns(path: Path) -> Columns:
    """Columns of a file, read-only; NaN where a number is missing.

    Raises
    ------
    FileNotFoundError, OSError
        It cannot be read.
    ValueError
        It is no Parquet file, or has a column of something else than numbers and flags.
    """
    from pyarrow.parquet import ParquetFile

    with ParquetFile(path) as file:
        table = file.read()
    return {name: _joined(name, table.column(name).chunks) for name in table.column_names}


def _joined(name: str, chunks: "list[pa.Array]") -> Array:
    """Values of a column, which comes in pieces."""
    pieces = [_values(name, chunk) for chunk in chunks] or [np.zeros(0)]
    values = pieces[0] if len(pieces) == 1 else np.concatenate(pieces)
    values.flags.writeable = False
    return values


def _values(name: str, piece: "pa.Array") -> Array:
    kind, rows = str(piece.type), slice(piece.offset, piece.offset + len(piece))
    if kind not in (FLAG, *DTYPES) or (piece.null_count and kind != MAY_MISS):
        missing = f", {piece.null_count} of them missing" if piece.null_count else ""
        raise ValueError(f"the values of {name} are of the type {kind}{missing}")
    present, content = piece.buffers()
    if kind == FLAG:
        return _bits(content, rows).view(np.bool_)
    values = np.frombuffer(content, DTYPES[kind])[rows]
    return np.where(_bits(present, rows), values, np.nan) if piece.null_count else values


def _bits(buffer: "pa.Buffer", rows: slice) -> npt.NDArray[np.uint8]:
    packed = np.frombuffer(buffer, np.uint8)
    return np.unpackbits(packed, count=rows.stop, bitorder="little")[rows]


def arrow_of(columns: Columns) -> "pa.Table":
    """Numbers, flags and texts as a table; a number that is NaN is a missing value."""
    import pyarrow as pa

    made = {name: _array(values) for name, values in columns.items()}
    return pa.Table.from_arrays(list(made.values()), names=list(made))


def _array(values: Array) -> "pa.Array":
    """An array as pandas would write it."""
    import pyarrow as pa

    if values.dtype.kind in "OU":
        return _texts(values)
    if values.dtype.kind == "b":
        return pa.Array.from_buffers(pa.bool_(), len(values), [None, _packed(values)])
    whole, missing = values.dtype.kind in "iu", np.isnan(values)
    kind, dtype = (pa.int64(), np.int64) if whole else (pa.float64(), np.float64)
    present = _packed(~missing) if missing.any() else None
    content = pa.py_buffer(np.ascontiguousarray(values, dtype))
    return pa.Array.from_buffers(kind, len(values), [present, content])


def _packed(flags: Array) -> "pa.Buffer":
    import pyarrow as pa

    return pa.py_buffer(np.packbits(flags, bitorder="little").tobytes())


def _texts(values: Array) -> "pa.Array":
    import pyarrow as pa

    values = values.astype(np.str_)
    texts, lengths = values.tolist(), np.char.str_len(values)
    content = "".join(texts).encode(errors=UNPAIRED)
    if len(content) != lengths.sum():  # not of one byte a letter
        lengths = np.array([len(text.encode(errors=UNPAIRED)) for text in texts])
    ends = np.concatenate([np.zeros(1, np.int64), np.cumsum(lengths, dtype=np.int64)])
    buffers = [None, pa.py_buffer(ends), pa.py_buffer(content)]
    return pa.Array.from_buffers(pa.large_string(), len(texts), buffers)
