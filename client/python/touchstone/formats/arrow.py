"""Tables as Apache Arrow, for Parquet and LeRobot. Values are those of the columns, bit for bit."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Any

import numpy as np

from .table import Column, Values, file_of, need

# Of a picture, as the library `datasets` stores one.
IMAGE_FIELDS = ("bytes", "path")


def arrow_type(pa: Any, column: Column, *, fixed: bool = True) -> Any:
    """Lists of fixed length for shapes; plain lists from the second axis on if not `fixed`, as `datasets` stores arrays."""
    if column.is_image:
        return pa.struct([("bytes", pa.binary()), ("path", pa.string())])
    found = pa.string() if column.dtype == "text" else pa.from_numpy_dtype(np.dtype(column.dtype))
    for length in reversed(column.shape):
        found = pa.list_(found, length) if fixed or len(column.shape) == 1 else pa.list_(found)
    return found


def arrow_array(pa: Any, column: Column, values: Values, *, fixed: bool = True) -> Any:
    if column.is_image:
        files = [file_of(value) for value in values]
        return pa.StructArray.from_arrays([pa.array(files, pa.binary()), pa.nulls(len(files), pa.string())], list(IMAGE_FIELDS))
    if column.dtype == "text":
        return pa.array(list(values), pa.string())
    array = np.ascontiguousarray(values, np.dtype(column.dtype))
    found = pa.array(array.reshape(-1))
    count = array.size
    for length in reversed(column.shape):
        count //= length
        if fixed or len(column.shape) == 1:
            found = pa.FixedSizeListArray.from_arrays(found, length)
        else:
            found = pa.ListArray.from_arrays(pa.array(np.arange(count + 1, dtype=np.int32) * length), found)
    return found


def feature(column: Column) -> dict[str, Any]:
    """As the library `datasets` names the type."""
    if column.is_image:
        return {"_type": "Image"}
    found: dict[str, Any] = {"dtype": "string" if column.dtype == "text" else column.dtype, "_type": "Value"}
    for length in reversed(column.shape):
        found = {"feature": found, "length": length, "_type": "Sequence"}
    return found


def record_batches(pa: Any, schema: Any, columns: Iterable[Column], batches: Iterable[dict[str, Values]], *,
                   fixed: bool = True) -> Iterator[Any]:
    kept = list(columns)
    for batch in batches:
        arrays = [arrow_array(pa, column, batch[column.name], fixed=fixed) for column in kept]
        yield pa.RecordBatch.from_arrays(arrays, schema=schema)


def import_arrow(what: str) -> tuple[Any, Any]:
    """pyarrow and pyarrow.parquet."""
    return need("pyarrow", what), need("pyarrow.parquet", what)
