"""A learner fed by a stream or by shards: how fast it learns, and for what share of the time it waits for data."""

from __future__ import annotations

import contextlib
import dataclasses
import io
import json
import os
import pathlib
import tarfile
import time
from collections.abc import Iterable, Iterator, Sequence
from typing import Any, Callable

import numpy as np
import torch
from torch import nn

from . import usage

PARTS = 10  # equal parts of a run, over which intervals are


@dataclasses.dataclass
class Feeding:
    """What one run of the learner did, from its second batch on; the first waits for workers to start.

    Attributes:
      samples: learned from.
      seconds: in all.
      wait_share: of them in next(), waiting for data.
      handover_share: what the wait share would be if all batches were there as soon as the fastest tenth of them: the cost
        of taking a batch that is ready from another process.
      parts: (PARTS, 2) samples a second and wait share of equal parts of the run.
      start_s: until the first batch was there.
      memory_mb: sampled all along, of this process and all below it.
      cores: how many cores, by average, these processes kept busy.
      machine_cores: the same of all programs of the machine; more than `cores` where others ran.
      written_mb: that these processes sent to the disk.
      accuracy: (PARTS,) share recognised of each part's samples, each judged before it was learned from.
    """

    samples: int
    seconds: float
    wait_share: float
    handover_share: float
    parts: list[list[float]]
    start_s: float
    memory_mb: list[float]
    cores: float
    machine_cores: float
    written_mb: float
    accuracy: list[float]

    @property
    def rate(self) -> float:
        """Samples a second."""
        return self.samples / self.seconds


def learner(side_px: int, classes: int) -> nn.Module:
    """A small network for grey pictures; logits (N, classes)."""
    return nn.Sequential(
        nn.Conv2d(1, 16, 5, 2, 2), nn.ReLU(), nn.Conv2d(16, 32, 3, 2, 1), nn.ReLU(), nn.Conv2d(32, 32, 3, 2, 1), nn.ReLU(),
        nn.AvgPool2d(2), nn.Flatten(), nn.Linear(32 * (side_px // 16) ** 2, 64), nn.ReLU(), nn.Linear(64, classes))


def feed(batches: Iterable[dict[str, Any]], samples: int, side_px: int, classes: int, seed: int,
         progress: Callable[[float], None] = lambda share: None) -> Feeding:
    """Learns from `samples` samples of {"image": (N, 1, side, side) uint8, "object": (N,)}."""
    torch.manual_seed(seed)
    network = learner(side_px, classes)
    optimizer = torch.optim.Adam(network.parameters(), 1e-3)
    begin = time.monotonic()
    iterator = iter(batches)
    first = next(iterator)
    start_s = time.monotonic() - begin
    marks, right, memory, seen, waited = [], 0, [], 0, 0.0
    before, begin = usage.now(), time.monotonic()
    judged, waits = 0, []
    for batch in _timed(first, iterator):
        waits.append(batch.pop("_waited_s"))
        waited += waits[-1]
        right += _step(network, optimizer, batch)
        seen, judged = seen + len(batch["object"]), judged + len(batch["object"])
        if seen >= samples * (len(marks) + 1) / PARTS:
            marks.append((seen, time.monotonic() - begin, waited, right / judged))
            right = judged = 0
            memory.append(usage.now().memory_bytes / 1e6)
            progress(seen / samples)
    seconds, after = time.monotonic() - begin, usage.now()
    edges = [(0, 0.0, 0.0, 0.0), *marks]
    parts = [[(b[0] - a[0]) / (b[1] - a[1]), (b[2] - a[2]) / (b[1] - a[1])] for a, b in zip(edges, edges[1:])]
    busy = sum(after.core_busy_s) - sum(before.core_busy_s)
    return Feeding(seen, seconds, waited / seconds,
                   float(np.quantile(waits[1:] or [0.0], 0.1)) * len(waits) / seconds, parts, start_s, memory,
                    (after.cpu_s - before.cpu_s) / seconds, busy / seconds,
                   (after.written_bytes - before.written_bytes) / 1e6, [mark[3] for mark in marks])


def _timed(first: dict[str, Any], iterator: Iterator[dict[str, Any]]) -> Iterator[dict[str, Any]]:
    """The batches, each with the time that was waited for it; none for the first."""
    batch: dict[str, Any] | None = first
    waited = 0.0
    while batch is not None:
        yield {**batch, "_waited_s": waited}
        begin = time.monotonic()
        batch = next(iterator, None)
        waited = time.monotonic() - begin


def _step(network, optimizer, batch) -> int:
    """How many it recognised, before it learned from them."""
    image, objects = batch["image"].float() / 255 - 0.3, batch["object"].long()
    optimizer.zero_grad(set_to_none=True)
    logits = network(image)
    nn.functional.cross_entropy(logits, objects).backward()
    optimizer.step()
    return int((logits.detach().argmax(1) == objects).sum())


class Shards(torch.utils.data.IterableDataset):
    """Batches of the tar files that `touchstone stream --encoding raw` wrote, dealt out to the workers."""

    def __init__(self, paths: Sequence[pathlib.Path], objects: Sequence[str], batch_size: int):
        super().__init__()
        self._paths, self._objects, self._batch_size = list(paths), list(objects), batch_size

    def __iter__(self) -> Iterator[dict[str, Any]]:
        worker = torch.utils.data.get_worker_info()
        mine = self._paths[worker.id :: worker.num_workers] if worker else self._paths
        images, places = [], []
        for path in mine:
            with tarfile.open(path) as shard:
                for member in shard:
                    content = shard.extractfile(member).read()
                    if member.name.endswith(".image.npy"):
                        picture = np.load(io.BytesIO(content))
                        images.append(picture.reshape(1, *picture.shape[:2]))
                    elif member.name.endswith(".json"):
                        places.append(self._objects.index(json.loads(content)["object"]))
                    if len(images) == len(places) == self._batch_size:
                        yield _batch(images, places)
                        images, places = [], []
        if images:
            yield _batch(images, places)


def _batch(images, places):
    return {"image": torch.from_numpy(np.stack(images)), "object": torch.tensor(places)}


@contextlib.contextmanager
def on_cores(cores: Iterable[int]) -> Iterator[None]:
    """This thread, and processes that are started meanwhile, run on these cores only."""
    before = os.sched_getaffinity(0)
    os.sched_setaffinity(0, cores)
    try:
        yield
    finally:
        os.sched_setaffinity(0, before)


@contextlib.contextmanager
def one_torch_thread() -> Iterator[None]:
    before = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        yield
    finally:
        torch.set_num_threads(before)
