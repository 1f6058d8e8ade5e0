"""A dataset by index: `samples[i]`, in any order, from any number of threads and processes."""

from __future__ import annotations

import contextlib
import operator
import threading
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Callable, overload

import numpy as np
from numpy.typing import NDArray

from .batch import Batch, Column, EncodedImages
from .connection import Connection
from .dataset import Dataset, Header
from .errors import InvalidRequest
from .printable import printable
from .v1 import source_pb2

# Samples of one request. A list that is longer is asked for in parts: few megabytes of indices, and what was received is
# not lost with the source.
_SAMPLES_PER_REQUEST = 50_000


class Samples(Sequence[Mapping[str, Any]]):
    """Samples of a dataset by their index. Made by Client.samples().

    `samples[i]` is one sample, {column: value}; `samples[[3, 1, 7]]`, `samples[10:20]` and `samples[array]` are Batches
    in that order, for one request to the source. The bytes are those of the stream: sample i depends on nothing but the
    specification and i. It has what a map-style dataset of PyTorch and a RandomAccessDataSource of Grain need, and can
    be pickled and used by several threads, each of which has a connection of its own.

    len() is the number of samples.
    """

    def __init__(self, connection: Connection, spec: source_pb2.DatasetSpec, *, si: bool = False,
                 hold_lease: Callable[[], contextlib.AbstractContextManager[str]] | None = None, session: str = ""):
        self.spec = spec
        self._si = si
        self._hold_lease = hold_lease
        self._session = session
        self._parent = connection
        self._own = threading.local()
        self._header: source_pb2.DatasetHeader | None = None

    @property
    def header(self) -> Header:
        """What the source resolved the specification to; asked for when it is not known yet."""
        if self._header is None:
            self._header = self._dataset(None).raw_header
        return Header.from_proto(self._header, self.spec.objects, self._si)

    def __len__(self) -> int:
        return self.spec.samples

    @overload  # type: ignore[override]  # a slice of a Sequence is a Sequence; here it is a Batch, one request
    def __getitem__(self, index: int | np.integer[Any]) -> Mapping[str, Any]: ...

    @overload
    def __getitem__(self, index: slice | Sequence[int] | NDArray[np.integer[Any]]) -> Batch: ...

    def __getitem__(self, index: int | np.integer[Any] | slice | Sequence[int] | NDArray[np.integer[Any]]) -> Mapping[str, Any] | Batch:
        if isinstance(index, slice):
            return self._batch(range(*index.indices(len(self))))
        if isinstance(index, (Sequence, np.ndarray)) and getattr(index, "ndim", 1) == 1:
            return self._batch(self._selected(index))
        return sample_of(self._batch([self._checked(index)]), 0)

    def __getitems__(self, indices: Sequence[int]) -> list[Mapping[str, Any]]:
        """A list of samples for one request: what PyTorch's DataLoader asks for if it is there."""
        batch = self._batch(self._selected(indices))
        return [sample_of(batch, row) for row in range(batch.rows)]

    def __iter__(self) -> Iterator[Mapping[str, Any]]:
        """All samples in their order, as a stream makes them: far faster than one by one."""
        for batch in self._dataset(None):
            for row in range(batch.rows):
                yield sample_of(batch, row)

    def close(self) -> None:
        """Closes this thread's connection; the next sample opens one again."""
        if getattr(self._own, "connection", None) is not None:
            self._own.connection.disconnect()
            self._own.connection = None

    def __repr__(self) -> str:
        return printable(f"Samples({len(self)} of {', '.join(self.spec.objects)})")

    def __getstate__(self) -> dict[str, Any]:
        """Without connections and leases: a lease belongs to the process that took it."""
        state = dict(self.__dict__, _own=None, _hold_lease=None)
        state["_parent"] = (self._parent.targets, self._parent.retry_for_s, 0, self._parent.credentials)
        state["spec"] = self.spec.SerializeToString()
        state["_header"] = self._header and self._header.SerializeToString()
        return state

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state, _own=threading.local(), _parent=Connection(*state["_parent"]),
                             spec=source_pb2.DatasetSpec.FromString(state["spec"]))
        if state["_header"]:
            self._header = source_pb2.DatasetHeader.FromString(state["_header"])

    def _selected(self, index: Sequence[int] | NDArray[Any]) -> list[int]:
        """A list of numbers, or as in NumPy a mask: True for each sample that is wanted."""
        masks = [isinstance(i, (bool, np.bool_)) for i in index]
        if not any(masks):
            return [self._checked(i) for i in index]
        if not all(masks) or len(masks) != len(self):
            raise InvalidRequest(f"a mask of {len(masks)} entries for {len(self)} samples; a bool for each was expected, and nothing else.")
        return [number for number, wanted in enumerate(index) if wanted]

    def _checked(self, index: Any) -> int:
        if isinstance(index, (bool, np.bool_)):
            raise InvalidRequest(f"index {index!r} is no whole number, no list of them and no slice.")
        try:
            number = operator.index(index)
        except TypeError:
            raise InvalidRequest(f"index {index!r} is no whole number, no list of them and no slice.") from None
        if not -len(self) <= number < len(self):
            raise IndexError(f"sample {number} of {len(self)}")
        return number % len(self)

    def _batch(self, indices: Sequence[int]) -> Batch:
        parts = []
        for begin in range(0, max(len(indices), 1), _SAMPLES_PER_REQUEST):
            dataset = self._dataset(list(indices[begin : begin + _SAMPLES_PER_REQUEST]))
            parts += list(dataset)
            self._header = dataset.known_header or self._header
        if not parts:
            raise InvalidRequest("The list of indices is empty; give at least one.")
        return joined(parts, indices)

    def _dataset(self, indices: list[int] | None) -> Dataset:
        more: dict[str, Any] = {} if self._hold_lease is None else {"hold_lease": self._hold_lease}
        return Dataset(self._connection(), self.spec, si=self._si, session=self._session, indices=indices,
                       known_header=self._header, **more)

    def _connection(self) -> Connection:
        connection: Connection | None = getattr(self._own, "connection", None)
        if connection is None:
            connection = self._own.connection = self._parent.another()
        return connection


def sample_of(batch: Mapping[str, Any], row: int) -> Mapping[str, Any]:
    """One row of a batch, {column: value}: arrays without their first axis, bytes of encoded images."""
    return {name: values[row] for name, values in batch.items()}


def joined(parts: Sequence[Batch], indices: Sequence[int]) -> Batch:
    """Batches one after the other as one."""
    if len(parts) == 1:
        whole = parts[0]
    else:
        columns: dict[str, Column] = {}
        for name, first in parts[0].items():
            values = [part[name] for part in parts]
            columns[name] = EncodedImages.joined(values) if isinstance(first, EncodedImages) else np.concatenate(values)
        # The names and units are those of the parts: nothing is converted again.
        whole = Batch(0, sum(part.rows for part in parts), columns, model_hash=parts[0].model_hash, si=True)
    whole.start_index = indices[0]
    whole.indices = np.array(indices, np.int64)
    return whole
