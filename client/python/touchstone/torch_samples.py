"""Samples by index for PyTorch, and an order for them that needs no list; see touchstone.torch."""

from __future__ import annotations

from collections.abc import Iterator, Sequence, Sized
from typing import Any

import torch
from torch.utils.data import Dataset, Sampler

from . import arguments, checks
from .client import Client
from .connection import Connection, Targets
from .errors import InvalidRequest
from .images import ImageLike
from .models import ModelLike
from .permutation import Permutation
from .plans import PlanLike
from .posterior import PosteriorLike
from .retry import RETRY_FOR_S
from .samples import Samples
from .specification import specification
from .torch_support import ranks_of_this_job, rows, tensors

__all__ = ["KeyedShuffle", "TouchstoneSamples"]


@arguments.checked
class TouchstoneSamples(Dataset):
    """A map-style dataset: `dataset[i]` is sample i, a dict of tensors.

    Give it to any DataLoader, torchdata's StatefulDataLoader among them:

        dataset = TouchstoneSamples("127.0.0.1:50051", ["lat00", "lat20"], samples=100_000, seed=1)
        loader = DataLoader(dataset, batch_size=512, sampler=KeyedShuffle(dataset, seed=1), num_workers=2)

    It connects where it is used, so that workers may be forked as long as this process has not used gRPC itself. The
    indices of a batch are one request; TouchstoneDataset, a stream, needs fewer. Tensors as of TouchstoneDataset.
    """

    def __init__(self, target: Targets | Client, objects: str | Sequence[str], plan: PlanLike | None = None, *,
                 samples: int | None = None, seed: int = 0, model: ModelLike = None, speed_mm_s: float | None = None,
                 touch_interval_s: float = 0.0, columns: str | Sequence[str] | None = None,
                 image: ImageLike | None = None, max_draws: int = 0, uncertainty: PosteriorLike = None,
                 models_from: PosteriorLike = None, retry_for_s: float = RETRY_FOR_S):
        """Arguments as in Client.samples(), and:

        Args:
          target: "host:port", several of them, or a Client, whose lease then counts in this process.
          retry_for_s: how long a lost source is tried again.
        """
        given: dict[str, Any] = dict(samples=samples, seed=seed, model=model, speed_mm_s=speed_mm_s, touch_interval_s=touch_interval_s,
                     columns=columns, image=image, max_draws=max_draws, uncertainty=uncertainty, models_from=models_from)
        if isinstance(target, Client):
            self.samples = target.samples(objects, plan, **given)
        else:
            self.samples = Samples(Connection(target, retry_for_s), specification(objects, plan, **given))

    def __len__(self) -> int:
        return len(self.samples)

    def __getitem__(self, index: int) -> dict[str, Any]:
        return self.__getitems__([index])[0]

    def __getitems__(self, indices: Sequence[int]) -> list[dict[str, Any]]:
        return list(rows(tensors(self.samples[list(indices)])))


@arguments.checked
class KeyedShuffle(Sampler):
    """The indices of a dataset in an order that a seed and the epoch decide, whatever the number of workers.

    Place k of the order is computed from k (touchstone.Permutation): no list of all indices is made, and every rank
    takes its places, rank, rank + ranks, ..., of the one order. Ranks get equally many; up to ranks - 1 samples at the
    end of an epoch's order are left out.
    """

    def __init__(self, dataset: Sized | int, seed: int = 0, *, rank: int | None = None, ranks: int | None = None):
        """
        Args:
          dataset: what is shuffled, or its length.
          seed: of the order.
          rank, ranks: this process and how many there are; default: torch.distributed's, or those of torchrun's
            environment, or 0 of 1.
        """
        self.size = dataset if isinstance(dataset, int) else len(dataset)
        self.seed = checks.uint64("seed", seed)
        own_rank, own_ranks = ranks_of_this_job()
        self.ranks = own_ranks if ranks is None else checks.whole_number("ranks", ranks, 1, 2**20)
        self.rank = checks.whole_number("rank", own_rank if rank is None else rank, 0, self.ranks - 1)
        if self.size < self.ranks:
            raise InvalidRequest(f"{self.size} samples do not give each of {self.ranks} ranks one.")
        self.epoch = 0

    def set_epoch(self, epoch: int) -> None:
        """Every epoch has an order of its own; call this before each."""
        self.epoch = checks.whole_number("epoch", epoch, 0, 2**31)

    def __len__(self) -> int:
        return self.size // self.ranks

    def __iter__(self) -> Iterator[int]:
        order = Permutation(self.size, self.seed, self.epoch)
        for begin in range(0, len(self), 4096):
            places = torch.arange(begin, min(begin + 4096, len(self))).numpy() * self.ranks + self.rank
            yield from order[places].tolist()
