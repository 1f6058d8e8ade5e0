"""Touchstone datasets for PyTorch.

    from touchstone.torch import TouchstoneDataset

    dataset = TouchstoneDataset("127.0.0.1:50051", ["lat00", "lat20"], samples=100_000, seed=1, batch_size=512)
    loader = dataset.loader(num_workers=2)
    for batch in loader:
        batch["descriptor_us"], batch["object"]      # tensors (512, 3) and (512,)

Order. Batch k holds samples k * batch_size and following. With R ranks, rank r gets batches r, r + R, ...; its
DataLoader workers take them in turn, and the DataLoader takes from its workers in turn: so what a rank sees does
not depend on the number of workers, nothing is left out and nothing comes twice.

Resumption. `loader.state_dict()` counts the batches that were returned, not those prefetched, and stands for
the rest of the epoch and all later ones. After the last batch of an epoch but before the loop has ended it
stands for an empty rest; after that for the next epoch. torchdata's StatefulDataLoader(dataset, batch_size=None,
num_workers=...) resumes as exactly, with as many workers as it was saved with.

By index. TouchstoneSamples is a map-style dataset of the same samples: `dataset[i]`, any sampler, KeyedShuffle for an
order that needs no list of all indices. A whole batch is one request to the source.

Fork. gRPC does not survive a fork, so a TouchstoneDataset connects only where it is iterated. A process that has
used gRPC itself (touchstone.connect()) must not fork workers: loader() then starts them by "forkserver", which
like "spawn" needs the script's main part under `if __name__ == "__main__":`.
"""

from __future__ import annotations

import contextlib
import hashlib
from collections.abc import Iterator, Sequence
from typing import Any

import torch
from torch.utils.data import IterableDataset, get_worker_info

from . import arguments, checks
from .client import Client
from .connection import Connection, Targets, parse_targets
from .dataset import Dataset, fingerprint
from .errors import InvalidRequest, Refused, SourceChanged
from .images import ImageLike
from .loader import TouchstoneLoader
from .models import ModelLike
from .plans import PlanLike
from .posterior import PosteriorLike
from .retry import RETRY_FOR_S
from .shared_lease import LeaseSlot, SharedLease
from .specification import resolve_batch_size, specification
from .torch_samples import KeyedShuffle, TouchstoneSamples
from .torch_support import digest, ranks_of_this_job, rows, tensors
from .v1 import source_pb2, source_pb2_grpc

__all__ = ["KeyedShuffle", "TouchstoneDataset", "TouchstoneLoader", "TouchstoneSamples", "epoch_seed"]

# Workers that compare what their sources serve; further ones share places.
_FINGERPRINTS = 256
_MOST_RANKS = 2**20
_MOST_EPOCHS = 2**31


def epoch_seed(seed: int, epoch: int) -> int:
    """The seed of an epoch when every epoch has new samples: `seed` itself for epoch 0, then unrelated ones.

    They are not seed + epoch, which would make the second epoch of a training set with seed 1 equal to a test set
    with seed 2.
    """
    if epoch == 0:
        return seed
    digest = hashlib.sha256(f"touchstone epoch {seed} {epoch}".encode()).digest()
    return int.from_bytes(digest[:8], "little")


@arguments.checked
class TouchstoneDataset(IterableDataset):
    """An IterableDataset of batches (dicts of tensors), or of samples with batched=False.

    Give it to `loader()`, or to DataLoader(dataset, batch_size=None, num_workers=...); with batched=False to
    DataLoader(dataset, batch_size=N) with the N given here as batch_size, or the order would depend on the number
    of workers. Only `loader()` can count what was delivered when there are workers.

    Tensors: "descriptor_us" float32 (N, fingers), "object" int64 (N,), "index" int64 (N,), "image" uint8
    (N, channels, height, width), and so on; encoded images are a list of bytes.
    """

    def __init__(self, target: Targets | Client, objects: str | Sequence[str], plan: PlanLike | None = None, *,
                 samples: int | None = None, seed: int = 0, model: ModelLike = None, speed_mm_s: float | None = None,
                 touch_interval_s: float = 0.0, columns: str | Sequence[str] | None = None,
                 image: ImageLike | None = None, max_draws: int = 0, uncertainty: PosteriorLike = None,
                 models_from: PosteriorLike = None, batch_size: int | None = None,
                 start: int = 0, stop: int | None = None, batched: bool = True, rank: int | None = None,
                 ranks: int | None = None, whole_rounds: bool = False, new_samples_each_epoch: bool = False,
                 retry_for_s: float = RETRY_FOR_S):
        """Arguments as in Client.dataset(), and:

        Args:
          target: "host:port", several of them (workers spread over them), or a Client.
          batched: yield batches, not samples.
          rank, ranks: this process and how many there are; default: torch.distributed's, or those of torchrun's
            environment, or 0 of 1.
          whole_rounds: leave out the last round of batches if it is not whole, so that every rank gets the same
            number of batches of the same size.
          new_samples_each_epoch: epoch e is drawn with epoch_seed(seed, e), not with seed.
          retry_for_s: how long a lost source is tried again.
        """
        super().__init__()
        self._targets = target.targets if isinstance(target, Client) else parse_targets(target)
        self._retry_for_s = target.retry_for_s if isinstance(target, Client) else retry_for_s
        self._credentials = target.credentials if isinstance(target, Client) else None
        spec = specification(
            objects, plan, samples=samples, seed=seed, model=model, speed_mm_s=speed_mm_s,
            touch_interval_s=touch_interval_s, columns=columns, image=image, max_draws=max_draws,
            uncertainty=uncertainty, models_from=models_from,
        )
        # Bytes travel to spawned workers whatever the protobuf version.
        self._spec = spec.SerializeToString()
        self._spec_digest = digest(spec)
        self._seed = spec.seed
        self.batch_size = resolve_batch_size(spec, batch_size)
        self.start, self.stop = checks.part(start, stop, spec.samples)
        self.batched = batched
        default_rank, default_ranks = ranks_of_this_job()
        self.ranks = default_ranks if ranks is None else checks.whole_number("ranks", ranks, 1, _MOST_RANKS)
        self.rank = checks.whole_number("rank", default_rank if rank is None else rank, 0, self.ranks - 1)
        self.whole_rounds = whole_rounds
        self.new_samples_each_epoch = new_samples_each_epoch
        # Where an iteration begins: epoch, sample index of its first round, samples of its first batch to skip. In
        # shared memory, so that workers which live for several epochs see it move.
        self._shared_begin = torch.tensor([0, self.start, 0], dtype=torch.int64).share_memory_()
        # Of a worker that counts for itself, as StatefulDataLoader has them do; and whether a state put it there.
        self._worker_begin: torch.Tensor | None = None
        self._worker_loaded = False
        # What the sources serve, as digests: row 0 what a loaded state expects, then a row a worker.
        self._fingerprints = torch.zeros((1 + _FINGERPRINTS, 32), dtype=torch.uint8).share_memory_()
        self._lease_slot = LeaseSlot(target.held_token if isinstance(target, Client) else "")
        # Progress of the iteration in this process: batches that this rank was given, samples of the next one.
        self._delivered = 0
        self._skipped = 0
        self._workers = 1  # that share the batches of this rank, as seen by this process
        self._loader_counts = False

    @property
    def epoch(self) -> int:
        """The epoch under way, from 0."""
        return int(self._begin[0])

    def set_epoch(self, epoch: int) -> None:
        """Begins that epoch at the next iteration. Needed only for a DataLoader with workers made without loader()."""
        self._begin_at(checks.whole_number("epoch", epoch, 0, _MOST_EPOCHS), self.start, 0)

    def __len__(self) -> int:
        """Batches, or samples with batched=False, that this rank sees in a whole epoch."""
        batches = self._rank_batches(self.start)
        if self.batched or batches == 0:
            return batches
        last = self.start + (self.rank + self.ranks * (batches - 1)) * self.batch_size
        return (batches - 1) * self.batch_size + min(self.batch_size, self._stop(self.start) - last)

    def __iter__(self) -> Iterator[dict[str, Any]]:
        info = get_worker_info()
        worker, workers = (info.id, info.num_workers) if info is not None else (0, 1)
        if self._loader_counts:
            for batch in self._batches(worker, workers):
                yield from [batch] if self.batched else rows(batch)
            return
        # Nobody else counts: here, before a batch is returned, by every process for itself.
        if info is not None:
            self._begin_as_worker()
        elif self._all_delivered():
            self._end_epoch()
        self._delivered, self._skipped, self._workers = 0, 0, workers
        for batch in self._batches(worker, workers):
            if self.batched:
                self._delivered += 1
                yield batch
                continue
            samples = list(rows(batch))
            already = int(self._begin[2]) if self._delivered == 0 else 0
            for k, sample in enumerate(samples):
                last = k + 1 == len(samples)
                self._delivered, self._skipped = self._delivered + last, 0 if last else already + k + 1
                yield sample
        if info is None:
            self._end_epoch()

    def loader(self, num_workers: int = 0, **options: Any) -> TouchstoneLoader:
        """A DataLoader over this dataset that can be saved and resumed.

        Args:
          num_workers: processes; 0: none but this one.
          options: further ones of DataLoader, for instance pin_memory, prefetch_factor, persistent_workers,
            multiprocessing_context.
        """
        return TouchstoneLoader(self, num_workers, options)

    def state_dict(self) -> dict[str, Any]:
        """The position of the next batch; plain numbers and text.

        In a worker it is that of its own share: torchdata's StatefulDataLoader puts those together. With workers of
        loader(), use the loader's.
        """
        known = [row for row in self._fingerprints.numpy() if row.any()]
        return {
            "version": 1,
            "specification": self._spec_digest,
            "served": known[0].tobytes().hex() if known else "",
            "epoch": self.epoch,
            "next_index": int(self._begin[1]) + self._delivered * self.ranks * self._workers * self.batch_size,
            "skip_samples": self._skipped if self._delivered or self._skipped else int(self._begin[2]),
            "worker": _worker_in_words(),
        }

    def load_state_dict(self, state: dict[str, Any]) -> None:
        """Goes on there at the next iteration. The number of workers may differ, and, if all ranks had been given
        equally many batches, the number of ranks too."""
        if not isinstance(state, dict) or state.get("version") != 1:
            said = f"The state has version {state.get('version')!r}" if isinstance(state, dict) else f"The state is {arguments.shown(state)}"
            raise InvalidRequest(f"{said}; what state_dict() gave was expected, version 1.")
        epoch, index, skip, served = self._place_in(state)
        if state.get("specification") != self._spec_digest:
            raise InvalidRequest(
                "The state was saved with another specification (objects, plan, seed, model, columns, ...); make the "
                "dataset with the same arguments."
            )
        saved_by, here = state.get("worker", ""), _worker_in_words()
        if saved_by != here:
            raise InvalidRequest(
                f"The state is of {saved_by or 'a process without workers'}, and this is {here or 'none'}; resume with as "
                "many workers as it was saved with, or use TouchstoneDataset.loader(), whose states fit any number."
            )
        self._worker_loaded = bool(here)
        if here:
            self._worker_begin = self._shared_begin.clone()
            self._begin_at(epoch, index, skip)
            return
        self._fingerprints.zero_()
        if served:
            self._fingerprints[0] = torch.tensor(list(served), dtype=torch.uint8)
        self._begin_at(epoch, index, skip)

    def _place_in(self, state: dict[str, Any]) -> tuple[int, int, int, bytes]:
        """Epoch, next index, samples to skip and what was served, of a state; InvalidRequest names the entry that cannot be."""
        missing = [name for name in ("epoch", "next_index", "skip_samples", "served") if name not in state]
        if missing:
            raise InvalidRequest(f"The state has no {', '.join(missing)}; what state_dict() gave was expected, as it was.")
        # The state of an epoch's end lies behind its last sample, by up to a batch of each rank and worker.
        behind = _MOST_RANKS * self.batch_size
        try:
            served = bytes.fromhex(state["served"])
        except (TypeError, ValueError):
            served = b"?"
        if len(served) not in (0, self._fingerprints.shape[1]):
            raise InvalidRequest(f"The state's served is {arguments.shown(state['served'])}; 64 hexadecimal digits or none were expected.")
        return (checks.whole_number("The state's epoch", state["epoch"], 0, _MOST_EPOCHS),
                checks.whole_number("The state's next_index", state["next_index"], self.start, self.stop + behind),
                checks.whole_number("The state's skip_samples", state["skip_samples"], 0, self.batch_size - 1), served)

    def _begin_at(self, epoch: int, index: int, skip: int) -> None:
        self._begin.copy_(torch.tensor([epoch, index, skip], dtype=torch.int64))
        self._delivered = self._skipped = 0

    @property
    def _begin(self) -> torch.Tensor:
        return self._shared_begin if self._worker_begin is None else self._worker_begin

    def _begin_as_worker(self) -> None:
        """Where the loaded state says, else where the process that started the workers says now."""
        if not self._worker_loaded:
            self._worker_begin = self._shared_begin.clone()
        self._worker_loaded = False

    def _all_delivered(self) -> bool:
        """True if the last batch was returned but no further one was requested, as with zip() and islice()."""
        return 0 < self._delivered == self._rank_batches(int(self._begin[1]))

    def _end_epoch(self) -> None:
        self._begin_at(self.epoch + 1, self.start, 0)

    def _stop(self, base: int) -> int:
        """The sample after the last one that is delivered, with rounds counted from sample `base`."""
        a_round = self.ranks * self.batch_size
        return base + (self.stop - base) // a_round * a_round if self.whole_rounds else self.stop

    def _rank_batches(self, base: int) -> int:
        """Batches that this rank gets of samples base .. stop."""
        batches = max(0, -(-(self._stop(base) - base) // self.batch_size))
        return max(0, -(-(batches - self.rank) // self.ranks))

    def _batches(self, worker: int, workers: int) -> Iterator[dict[str, Any]]:
        """The share of one worker, from where the iteration begins."""
        epoch, base, skip = self._begin.tolist()
        if skip and workers > 1 and self._worker_begin is None:
            raise Refused("The state was saved within a batch; resume with at most one worker.")
        stop = self._stop(base)
        start = base + (self.rank + self.ranks * worker) * self.batch_size
        if start >= stop:
            return
        spec = source_pb2.DatasetSpec.FromString(self._spec)
        if self.new_samples_each_epoch:
            spec.seed = epoch_seed(self._seed, epoch)
        connection = Connection(self._targets, self._retry_for_s, self.rank * workers + worker, self._credentials)
        dataset = Dataset(
            connection, spec, batch_size=self.batch_size, start=start, stop=stop, stride=self.ranks * workers,
            hold_lease=lambda: self._lease(connection, worker),
        )
        try:
            for k, batch in enumerate(dataset):
                if k == 0:
                    self._compare(worker, bytes.fromhex(fingerprint(dataset.raw_header)), connection.target)
                yield tensors(batch, skip if k == 0 else 0)
        finally:
            connection.close()

    @contextlib.contextmanager
    def _lease(self, connection: Connection, worker: int) -> Iterator[str]:
        """The token of what the source wants to be held while it makes samples; "" where it wants nothing."""
        source = connection.call(source_pb2_grpc.SourceStub, "Describe", source_pb2.DescribeRequest())
        with SharedLease(connection, source.lease_required, self._lease_slot, worker) as lease:
            yield lease.token

    def _compare(self, worker: int, served: bytes, target: str) -> None:
        """All workers, and the one who saved a state, must have been served the same dataset."""
        self._fingerprints[1 + worker % _FINGERPRINTS] = torch.tensor(list(served), dtype=torch.uint8)
        for row in self._fingerprints.numpy():
            if row.any() and row.tobytes() != served:
                raise SourceChanged(
                    f"{target} serves another dataset than the other workers got, or than the loaded state was saved "
                    "with: the model, a mesh, the columns or the renderer differ. Serve the same everywhere, send the "
                    "model as a file, and name the renderer.",
                    "FAILED_PRECONDITION", target,
                )


def _worker_in_words() -> str:
    """"worker 1 of 4"; "" in a process that is no worker."""
    info = get_worker_info()
    return "" if info is None else f"worker {info.id} of {info.num_workers}"
