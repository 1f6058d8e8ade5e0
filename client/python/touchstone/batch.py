"""One batch of samples: arrays by name, viewed in the received bytes."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any, TypedDict, Union, cast, overload

import numpy as np
from numpy.typing import NDArray

from . import errors, units
from .errors import InvalidRequest
from .tabular import Tabular
from .v1 import types_pb2

_DTYPES: dict[int, np.dtype[Any]] = {
    types_pb2.DATA_TYPE_FLOAT32: np.dtype("<f4"),
    types_pb2.DATA_TYPE_FLOAT64: np.dtype("<f8"),
    types_pb2.DATA_TYPE_UINT8: np.dtype("u1"),
    types_pb2.DATA_TYPE_INT32: np.dtype("<i4"),
    types_pb2.DATA_TYPE_UINT64: np.dtype("<u8"),
}


class EncodedImages(Sequence[bytes]):
    """PNG or JPEG files of a batch; `images[i]` is a file as bytes, `images[a:b]` a list of them."""

    __slots__ = ("_data", "_offsets")

    def __init__(self, data: bytes, offsets: Sequence[int]):
        self._data = memoryview(data)
        self._offsets = offsets

    def __len__(self) -> int:
        return len(self._offsets) - 1

    @overload
    def __getitem__(self, index: int) -> bytes: ...

    @overload
    def __getitem__(self, index: slice) -> list[bytes]: ...

    def __getitem__(self, index: int | slice) -> bytes | list[bytes]:
        if isinstance(index, slice):
            return [self[i] for i in range(*index.indices(len(self)))]
        count = len(self)
        if not -count <= index < count:
            raise IndexError(f"image {index} of a batch of {count}")
        index %= count
        return bytes(self._data[self._offsets[index] : self._offsets[index + 1]])

    @classmethod
    def joined(cls, parts: Sequence[EncodedImages]) -> EncodedImages:
        """Those of several batches, one after the other."""
        offsets = [0]
        for part in parts:
            offsets += [offsets[-1] + offset for offset in part._offsets[1:]]
        return cls(b"".join(bytes(part._data[: part._offsets[-1]]) for part in parts), offsets)

    def __repr__(self) -> str:
        return f"EncodedImages({len(self)} images, {len(self._data)} bytes)"


Column = Union[NDArray[Any], EncodedImages]


def decode_column(column: types_pb2.Column, rows: int) -> Column:
    """The column as (rows, *shape): a read-only view of the message's bytes."""
    if column.type == types_pb2.DATA_TYPE_BYTES:
        offsets = list(column.offsets)
        if len(offsets) != rows + 1 or offsets[-1] > len(column.data) or offsets != sorted(offsets):
            raise errors.SourceFailed(f'Column "{column.name}" has wrong offsets for {rows} encoded images.')
        return EncodedImages(column.data, offsets)
    dtype = _DTYPES.get(column.type)
    if dtype is None:
        raise errors.SourceFailed(
            f'Column "{column.name}" has data type {column.type}, which this version of the package does not know.'
        )
    data = column.data
    shape = (rows, *column.shape)
    if len(data) != math.prod(shape) * dtype.itemsize:
        raise errors.SourceFailed(
            f'Column "{column.name}" has {len(data)} bytes; {shape} of {dtype.name} are '
            f"{math.prod(shape) * dtype.itemsize}."
        )
    return np.frombuffer(data, dtype).reshape(shape)


class Columns(TypedDict, total=False):
    """What a batch may hold, in the units of labs; which of them depends on the dataset's `columns` and `image`.

    Attributes:
      index: (rows,) number of the sample in the dataset.
      object: (rows,) position in the dataset's objects.
      descriptor_us: (rows, fingers) contact times less the first finger's.
      contact_time_us: (rows, fingers) since the approach began.
      travel_mm: (rows, fingers) until contact.
      target_mm: (rows, 3) that the middle finger aims at, object frame.
      approach: (rows, 3) unit direction of motion.
      lateral: (rows, 3) unit vector from the first finger to the last.
      standoff_mm: (rows,) from the start to the target.
      speed_mm_s: (rows,) commanded.
      contact_point_mm: (rows, fingers, 3) in the object frame.
      normal: (rows, fingers, 3) outward, of the surface there.
      complete: (rows,) whether every finger made contact; of Client.touch().
      image: (rows, height, width, channels), or EncodedImages.
      depth_mm: (rows, height, width) along the viewing axis, 0 where no object is.
      mask: (rows, height, width) 255 where the object is, else 0.
    """

    index: NDArray[np.uint64]
    object: NDArray[np.int64]
    descriptor_us: NDArray[np.float32]
    contact_time_us: NDArray[np.float32]
    travel_mm: NDArray[np.float32]
    target_mm: NDArray[np.float32]
    approach: NDArray[np.float32]
    lateral: NDArray[np.float32]
    standoff_mm: NDArray[np.float32]
    speed_mm_s: NDArray[np.float32]
    contact_point_mm: NDArray[np.float32]
    normal: NDArray[np.float32]
    complete: NDArray[np.bool_]
    image: NDArray[np.uint8] | EncodedImages
    depth_mm: NDArray[np.float32]
    mask: NDArray[np.uint8]


class Batch(Mapping[str, Any], Tabular):
    """Samples start_index .. start_index + rows - 1, or those of a list; `batch["descriptor_us"]` is an array of `rows` entries.

    Columns that need no conversion are read-only views of the received bytes; the others are converted when
    they are first asked for. `batch["image"]` is uint8 (rows, height, width, channels), or EncodedImages. columns() has them
    with their types, to_torch() as tensors.

    Attributes:
      start_index: index of the first sample.
      rows: number of samples.
      indices: of the samples, (rows,) int64.
      model_hash: of the model that made them; "" if unknown.
      measured: what a physical source measured of each touch of Client.touch(); empty otherwise.
    """

    __slots__ = ("_columns", "_indices", "_wire_names", "measured", "model_hash", "rows", "start_index")

    def __init__(self, start_index: int, rows: int, columns: Mapping[str, Column], *, model_hash: str = "",
                 si: bool = False):
        self.start_index = start_index
        self.rows = rows
        self.model_hash = model_hash
        self.measured: Sequence[types_pb2.Measured] = ()
        self._indices: NDArray[np.int64] | None = None
        # Public name -> name on the wire, as long as the column is not converted yet.
        self._wire_names = {} if si else {units.lab_name(name): name for name in columns}
        self._columns = {name if si else units.lab_name(name): values for name, values in columns.items()}

    @classmethod
    def from_columns(cls, start_index: int, rows: int, columns: Iterable[types_pb2.Column], *, model_hash: str = "",
                     si: bool = False) -> Batch:
        """A batch of a message's columns, by the names of labs or (`si`) those on the wire. SourceFailed where a column's bytes are not
        those of its shape."""
        return cls(start_index, rows, {c.name: decode_column(c, rows) for c in columns}, model_hash=model_hash, si=si)

    @property
    def indices(self) -> NDArray[np.int64]:
        """Of the samples, (rows,)."""
        if self._indices is None:
            self._indices = np.arange(self.start_index, self.start_index + self.rows, dtype=np.int64)
        return self._indices

    @indices.setter
    def indices(self, values: NDArray[np.int64]) -> None:
        self._indices = values

    def __getitem__(self, name: str) -> Any:
        try:
            values = self._columns[name]
        except KeyError:
            raise KeyError(f"{name!r}; the columns are {', '.join(self._columns)}") from None
        wire_name = self._wire_names.pop(name, None)
        if wire_name is not None and isinstance(values, np.ndarray):
            values = self._columns[name] = units.lab_array(wire_name, values)
            if name == "object":  # what indexing and PyTorch's losses want
                values = self._columns[name] = values.astype(np.int64)
        return values

    def columns(self) -> Columns:
        """All of them, converted, by name."""
        return cast(Columns, dict(self))

    def to_torch(self) -> dict[str, Any]:
        """Tensors of all columns without a copy: they share the memory of the arrays, also of those that are read-only here.
        Images have the channels first; encoded ones stay a list of bytes. Needs PyTorch."""
        from . import torch_support

        return torch_support.tensors(self)

    def _table(self) -> Mapping[str, Any]:
        return self

    def _draw(self, axes: Any) -> None:
        name = next((name for name in self if name.startswith(("descriptor", "contact_time"))), None)
        if name is None:
            raise InvalidRequest(f"there is nothing to draw in {', '.join(self)}; ask for the column descriptor")
        axes.plot(self.indices, self[name], marker=".", linestyle="")
        axes.set(xlabel="sample", ylabel=name)
        axes.legend([f"finger {k}" for k in range(self[name].shape[1])])

    def __iter__(self) -> Iterator[str]:
        return iter(self._columns)

    def __len__(self) -> int:
        """Number of columns, as for every mapping; `rows` is the number of samples."""
        return len(self._columns)

    def __repr__(self) -> str:
        return f"Batch(start_index={self.start_index}, rows={self.rows}, columns={list(self._columns)})"
