"""The DataLoader of a TouchstoneDataset; see touchstone.torch."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import torch
from torch.utils.data import DataLoader

from . import checks
from .connection import grpc_was_used
from .errors import InvalidRequest

if TYPE_CHECKING:
    from .torch import TouchstoneDataset

__all__ = ["TouchstoneLoader"]


class TouchstoneLoader:
    """A DataLoader that counts the batches it has returned. Made by TouchstoneDataset.loader().

    Each `for` goes through one epoch, or through the rest of one after load_state_dict(). A loop that was broken
    off begins its epoch again, unless a state is loaded.
    """

    def __init__(self, dataset: TouchstoneDataset, num_workers: int, options: dict[str, Any]):
        for name in ("batch_size", "shuffle", "sampler", "batch_sampler", "drop_last"):
            if name in options:
                raise InvalidRequest(f"{name} is the dataset's; leave it out here.")
        if not options.get("in_order", True):
            raise InvalidRequest("in_order=False gives up the order that a state refers to.")
        self.dataset = dataset
        self._num_workers = checks.whole_number("num_workers", num_workers, 0, 2**16)
        self._options = options
        self._loader: DataLoader | None = None
        # False from the begin of an epoch to its end: then it was broken off.
        self._fresh = True

    def __len__(self) -> int:
        """Batches of this rank in a whole epoch."""
        return self.dataset._rank_batches(self.dataset.start)

    @property
    def epoch(self) -> int:
        """The epoch that is under way or comes next, from 0."""
        return self.dataset.epoch

    def set_epoch(self, epoch: int) -> None:
        """Begins that epoch with the next `for`."""
        self.dataset.set_epoch(epoch)
        self._fresh = True

    def state_dict(self) -> dict[str, Any]:
        """Where the batches that were returned end: plain types, for load_state_dict() in any process and with any number of workers."""
        return self.dataset.state_dict()

    def load_state_dict(self, state: dict[str, Any]) -> None:
        """Goes on where a state ends, with the next `for`. InvalidRequest where it is of another dataset."""
        self.dataset.load_state_dict(state)
        self._fresh = True

    def _make(self) -> DataLoader:
        options = dict(self._options)
        if self._num_workers > 0 and options.get("multiprocessing_context") is None and grpc_was_used():
            options["multiprocessing_context"] = "forkserver"
        if options.get("multiprocessing_context") == "forkserver":
            # The imports are made once, by the process that all workers are forked from.
            torch.multiprocessing.get_context("forkserver").set_forkserver_preload(["__main__", "touchstone.torch"])
        batch_size = None if self.dataset.batched else self.dataset.batch_size
        return DataLoader(self.dataset, batch_size=batch_size, num_workers=self._num_workers, **options)

    def __iter__(self) -> Iterator[Any]:
        dataset = self.dataset
        if not self._fresh:
            dataset.set_epoch(dataset.epoch + dataset._all_delivered())
        self._fresh = False
        # Persistent workers belong to one DataLoader; others are started for each, by fork only while that is safe.
        if self._loader is None or not self._options.get("persistent_workers"):
            self._loader = self._make()
        dataset._delivered = dataset._skipped = 0
        dataset._loader_counts = True
        try:
            for batch in self._loader:
                dataset._delivered += 1
                yield batch
            dataset._end_epoch()
            self._fresh = True
        finally:
            dataset._loader_counts = False
