"""A dataset as an iterable of batches that survives the loss of its source."""

from __future__ import annotations

import contextlib
import dataclasses
import hashlib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any, Callable

import grpc

from . import arguments, checks, errors, images, units
from .batch import Batch
from .connection import Connection
from .printable import printable
from .retry import Retry
from .specification import resolve_batch_size
from .v1 import source_pb2, source_pb2_grpc


@dataclasses.dataclass(frozen=True)
class Header:
    """What the dataset is, as its source resolved it.

    Attributes:
      samples: in the whole dataset, of which this stream may be a part.
      model_name, model_hash, model_yaml: the model; `model_yaml` is the whole file.
      mesh_hashes: SHA-256 of each object's mesh.
      fingers, spacing_mm: of the end effector.
      columns: {name: shape of one sample}; of an encoded image that of its pixels.
      renderer: "egl", "cpu", or "" without images.
      version: of the program that makes it.
    """

    samples: int
    model_name: str
    model_hash: str
    model_yaml: str
    mesh_hashes: Mapping[str, str]
    fingers: int
    spacing_mm: float
    columns: Mapping[str, tuple[int, ...]]
    renderer: str
    version: str

    @classmethod
    def from_proto(cls, m: source_pb2.DatasetHeader, objects: Iterable[str], si: bool) -> Header:
        name = (lambda n: n) if si else units.lab_name
        return cls(
            samples=m.samples, model_name=m.model_name, model_hash=m.model_hash, model_yaml=m.model_yaml,
            mesh_hashes=dict(zip(objects, m.mesh_hashes)), fingers=m.fingers,
            spacing_mm=units.lab_value("spacing_m", m.spacing_m),
            columns={name(c.name): tuple(c.shape) for c in m.columns},
            renderer=images.renderer_name(m.renderer), version=m.version,
        )


def identity(header: source_pb2.DatasetHeader) -> dict[str, str]:
    """What must be equal at two sources for their samples to be the same, in words."""
    return {
        "samples": str(header.samples),
        "model hash": header.model_hash,
        "mesh hashes": ", ".join(header.mesh_hashes),
        "columns": ", ".join(f"{c.name}{list(c.shape)}" for c in header.columns),
        "renderer": images.renderer_name(header.renderer),
    }


def fingerprint(header: source_pb2.DatasetHeader) -> str:
    """A digest of identity()."""
    return hashlib.sha256(repr(sorted(identity(header).items())).encode()).hexdigest()


class Dataset:
    """Iterating yields Batch objects in order; each iteration starts from the beginning. Made by Client.dataset().

    A source that is lost is replaced, by itself when it is back or by the next of the client's targets, and the
    stream resumes at the next index, without a gap or a repeat: sample i depends on nothing but the
    specification and i. What the new source would do differently is found out first (SourceChanged).

    len() is the number of batches.

    Attributes:
      spec: the specification, as sent.
      start: first sample.
      stop: the one after the last.
      batch_size: samples a batch; the last one may be shorter.
      stride: of every `stride` batches the first is delivered, the others are left out.
    """

    def __init__(self, connection: Connection, spec: source_pb2.DatasetSpec, *, batch_size: int | None = None,
                 start: int = 0, stop: int | None = None, stride: int = 1, si: bool = False,
                 hold_lease: Callable[[], contextlib.AbstractContextManager[str]] = lambda: contextlib.nullcontext(""),
                 session: str = "", indices: Sequence[int] | None = None,
                 known_header: source_pb2.DatasetHeader | None = None):
        """
        Args:
          hold_lease: a context that holds the lease while the source makes samples, and gives its token.
          indices: these samples in this order, instead of all in theirs; start and stop then count places in it.
          known_header: what the source must still serve.
        """
        self.spec = spec
        self.batch_size = resolve_batch_size(spec, batch_size)
        self._indices = indices
        end = spec.samples if indices is None else len(indices)
        self.start, self.stop = checks.part(start, stop, end)
        self.stride = checks.whole_number("stride", stride, 1, 2**32 - 1)
        self._connection = connection
        self._si = si
        self._hold_lease = hold_lease
        self._session = session
        self._header = known_header

    def __repr__(self) -> str:
        part = "" if (self.start, self.stop) == (0, self.spec.samples) else f", {self.start} to {self.stop}"
        return printable(f"Dataset({self.spec.samples} samples of {', '.join(self.spec.objects)}{part}; "
                         f"{', '.join(self.spec.columns)}; {len(self)} batches of {self.batch_size})")

    def __len__(self) -> int:
        step = self.batch_size * self.stride
        return max(0, -(-(self.stop - self.start) // step))

    @property
    def header(self) -> Header:
        """What the source resolved the specification to; asked for when it is not known yet."""
        return Header.from_proto(self.raw_header, self.spec.objects, self._si)

    @property
    def known_header(self) -> source_pb2.DatasetHeader | None:
        """The header as a message, if the source has sent one."""
        return self._header

    @property
    def raw_header(self) -> source_pb2.DatasetHeader:
        """The header as a message, SI."""
        retry = self._retry()
        if self._header is not None:
            return self._header
        with self._hold_lease() as token:
            while self._header is None:
                call = self._open(0, token)
                try:
                    self._accept(next(call).header)
                except grpc.RpcError as error:
                    self._lost(error, retry)
                finally:
                    call.cancel()
        return self._header

    def __iter__(self) -> Iterator[Batch]:
        with self._hold_lease() as token:
            yield from self._batches(token)

    def _batches(self, token: str) -> Iterator[Batch]:
        next_index, step = self.start, self.batch_size * self.stride
        retry = self._retry()
        call = None
        try:
            while next_index < self.stop:
                try:
                    if call is None:
                        call = self._open(next_index, token)
                        self._accept(next(call).header)
                    message = next(call).batch
                except grpc.RpcError as error:
                    call = None
                    self._lost(error, retry)
                    continue
                except StopIteration:
                    raise errors.SourceFailed(
                        f"The stream ended before sample {next_index}; {self.stop} were asked for.",
                        target=self._connection.target,
                    ) from None
                retry.succeeded()
                rows = min(self.batch_size, self.stop - next_index)
                if message.start_index != next_index or message.rows != rows:
                    raise errors.SourceFailed(
                        f"The source sent {message.rows} samples from {message.start_index} on; {rows} from "
                        f"{next_index} on were due.",
                        target=self._connection.target,
                    )
                next_index += step
                yield Batch.from_columns(
                    message.start_index, rows, message.columns, model_hash=self.raw_header.model_hash, si=self._si
                )
        finally:
            # Also on the way out of a broken loop, a closed generator or an interrupt: the source's threads are freed.
            if call is not None:
                call.cancel()

    def _retry(self) -> Retry:
        return Retry(len(self._connection.targets), self._connection.retry_for_s)

    def _open(self, index: int, token: str) -> Any:
        """gRPC's call, an iterator of StreamDatasetResponse."""
        request = source_pb2.StreamDatasetRequest(
            spec=self.spec, start_index=index, stop_index=self.stop, batch_size=self.batch_size,
            batch_stride=self.stride, lease_token=token, session=self._session, indices=self._indices or (),
        )
        # The source's own choice of a renderer must not change in mid-stream.
        if self._header is not None and request.spec.HasField("image"):
            request.spec.image.renderer = self._header.renderer
        return source_pb2_grpc.SourceStub(self._connection.channel()).StreamDataset(request)

    def _lost(self, error: grpc.RpcError, retry: Retry) -> None:
        """Returns when the stream may be opened again; otherwise raises the error for the user."""
        failure = errors.from_rpc(error, self._connection.target, self.spec)
        if not errors.is_lost(error):
            raise failure from None
        self._connection.move_on()
        retry.lost(failure)

    def _accept(self, header: source_pb2.DatasetHeader) -> None:
        """Keeps the first header; a later one must stand for the same samples."""
        if header.samples != self.spec.samples:
            raise errors.SourceFailed(
                f"The source counts {header.samples} samples where the request has {self.spec.samples}.",
                target=self._connection.target,
            )
        if self._header is None:
            self._header = header
            return
        before, now = identity(self._header), identity(header)
        for what, value in before.items():
            if now[what] != value:
                raise errors.SourceChanged(
                    f"{self._connection.target} would resume with another dataset: its {what} is {now[what]}, not "
                    f"{value}. Serve the same model and meshes there, or send the model as a file.",
                    "FAILED_PRECONDITION", self._connection.target,
                )
        if header.version != self._header.version:
            arguments.warn(
                f"{self._connection.target} runs version {header.version}, the dataset began with "
                f"{self._header.version}; its samples may differ.")
