"""What the PyTorch datasets share: tensors of a batch, digests of a specification, ranks of a job."""

from __future__ import annotations

import ctypes
import hashlib
import json
import os
from collections.abc import Iterator
from typing import Any

import numpy as np
import torch
from google.protobuf import json_format
from numpy.typing import NDArray

from .batch import Batch, EncodedImages
from .v1 import source_pb2

_IMAGE_COLUMNS = ("image", "depth_mm", "mask")


def tensors(batch: Batch, skip: int = 0) -> dict[str, Any]:
    """The batch as tensors that share its memory, without its first `skip` samples; images with the channels first."""
    result: dict[str, Any] = {}
    for name, values in batch.items():
        if isinstance(values, EncodedImages):
            result[name] = values[skip:]
            continue
        if values.dtype == np.uint64:
            values = values.astype(np.int64)
        elif not values.flags.writeable:
            values = _writable(values)
        tensor = torch.from_numpy(values)[skip:]
        result[name] = tensor.permute(0, 3, 1, 2) if name in _IMAGE_COLUMNS and tensor.dim() == 4 else tensor
    return result


def _writable(values: NDArray[Any]) -> NDArray[Any]:
    """The same memory, writable, since PyTorch has no read-only tensors: bytes of a message that nothing but this batch holds.
    Those of up to one byte are Python's own, shared by everybody, and are copied."""
    if values.nbytes < 2 or not values.flags.c_contiguous:
        return values.copy()
    memory: Any = (ctypes.c_char * values.nbytes).from_address(values.ctypes.data)
    memory.owner = values  # which lives as long as the tensor
    shared: NDArray[Any] = np.frombuffer(memory, values.dtype).reshape(values.shape)
    return shared


def rows(batch: dict[str, Any]) -> Iterator[dict[str, Any]]:
    for k in range(len(next(iter(batch.values())))):
        yield {name: values[k] for name, values in batch.items()}


def digest(spec: source_pb2.DatasetSpec) -> str:
    """Equal for equal specifications, whatever the version of protobuf."""
    return hashlib.sha256(json.dumps(json_format.MessageToDict(spec), sort_keys=True).encode()).hexdigest()


def ranks_of_this_job() -> tuple[int, int]:
    """(rank, ranks)."""
    if torch.distributed.is_available() and torch.distributed.is_initialized():
        return torch.distributed.get_rank(), torch.distributed.get_world_size()
    if "RANK" in os.environ and "WORLD_SIZE" in os.environ:
        return int(os.environ["RANK"]), int(os.environ["WORLD_SIZE"])
    return 0, 1
