"""Map-style access in real DataLoaders: order, shuffling, ranks; StatefulDataLoader resumes exactly."""

import itertools
from typing import Any

import numpy as np
import pytest

import touchstone

torch = pytest.importorskip("torch", reason="PyTorch is not installed; the tests of touchstone.torch need it.")

from torch.utils.data import DataLoader  # noqa: E402

from touchstone.torch import KeyedShuffle, TouchstoneDataset, TouchstoneSamples  # noqa: E402

pytestmark = pytest.mark.filterwarnings("ignore:This DataLoader will create")

OPTIONS: dict[str, Any] = dict(objects=["lat00", "lat20"], plan=touchstone.sphere(step_angle_deg=5), samples=1000, seed=5,
               columns=("index", "object", "descriptor"))
WORKERS = [0, 1, 2, 4]


def samples(server, **changes):
    return TouchstoneSamples(server.target, **{**OPTIONS, **changes})


def loaded(dataset, workers, **options):
    """As this process has used gRPC, workers are not forked from it."""
    context = "forkserver" if workers else None
    return DataLoader(dataset, batch_size=64, num_workers=workers, multiprocessing_context=context, **options)


@pytest.fixture(scope="module")
def values(server):
    return np.concatenate([b["descriptor_us"] for b in touchstone.connect(server.target).dataset(**OPTIONS)])


def test_a_sample_is_a_dict_of_tensors(server, values):
    dataset = samples(server, columns=("index", "descriptor", "image"), image=touchstone.image(20, 10, "rgb"))
    sample = dataset[7]
    assert sample["index"] == 7 and sample["index"].dtype == torch.int64
    np.testing.assert_array_equal(sample["descriptor_us"].numpy(), values[7])
    assert sample["image"].dtype == torch.uint8 and sample["image"].shape == (3, 10, 20)
    assert len(dataset) == 1000


@pytest.mark.parametrize("workers", WORKERS)
def test_the_shuffled_order_does_not_depend_on_the_workers(server, values, workers):
    dataset = samples(server)
    batches = list(loaded(dataset, workers, sampler=KeyedShuffle(dataset, seed=3)))
    order = torch.cat([batch["index"] for batch in batches]).numpy()
    np.testing.assert_array_equal(order, touchstone.Permutation(1000, seed=3)[np.arange(1000)])
    np.testing.assert_array_equal(torch.cat([b["descriptor_us"] for b in batches]).numpy(), values[order])


def test_pytorchs_own_shuffling_works(server):
    batches = list(loaded(samples(server), 2, shuffle=True, generator=torch.Generator().manual_seed(4)))
    assert sorted(torch.cat([batch["index"] for batch in batches]).tolist()) == list(range(1000))


def test_ranks_share_one_order_evenly(server):
    shares = [list(KeyedShuffle(1000, seed=8, rank=rank, ranks=3)) for rank in range(3)]
    assert {len(share) for share in shares} == {333}
    together = list(itertools.chain(*zip(*shares)))
    assert together == touchstone.Permutation(1000, 8)[np.arange(999)].tolist()


def test_every_epoch_has_its_order():
    sampler = KeyedShuffle(1000, seed=8)
    first = list(sampler)
    assert first == list(sampler)
    sampler.set_epoch(1)
    assert sorted(sampler) == sorted(first) and list(sampler) != first


def test_more_ranks_than_samples_are_refused():
    with pytest.raises(touchstone.InvalidRequest, match="3 samples do not give each of 4 ranks one"):
        KeyedShuffle(3, rank=0, ranks=4)


@pytest.fixture(scope="module")
def stateful():
    return pytest.importorskip("torchdata.stateful_dataloader", reason="torchdata is not installed "
                               "(deploy/python-packages.txt)").StatefulDataLoader


def resumed(make, after):
    """What a loader gives before its state is saved after some batches, and what a new one gives from there on."""
    loader = make()
    iterator = iter(loader)
    before = [next(iterator)["index"].tolist() for _ in range(after)]
    state = loader.state_dict()
    del iterator
    again = make()
    again.load_state_dict(state)
    return before, [batch["index"].tolist() for batch in again]


def in_batches(order):
    return [order[begin:begin + 64] for begin in range(0, len(order), 64)]


@pytest.mark.parametrize("after", [1, 15])
@pytest.mark.parametrize("workers", WORKERS)
def test_stateful_dataloader_resumes_a_stream(server, stateful, workers, after):
    def make():
        return stateful(TouchstoneDataset(server.target, **OPTIONS, batch_size=64, rank=0, ranks=1), batch_size=None,
                        num_workers=workers, multiprocessing_context="forkserver" if workers else None)

    before, rest = resumed(make, after)
    assert before + rest == in_batches(list(range(1000)))


@pytest.mark.parametrize("workers", WORKERS)
def test_stateful_dataloader_resumes_within_a_batch_of_the_stream(server, stateful, workers):
    def make():
        dataset = TouchstoneDataset(server.target, **OPTIONS, batch_size=64, rank=0, ranks=1, batched=False)
        return stateful(dataset, batch_size=24, num_workers=workers,
                        multiprocessing_context="forkserver" if workers else None)

    whole = [batch["index"].tolist() for batch in make()]
    before, rest = resumed(make, 7)
    assert before + rest == whole
    assert sorted(itertools.chain(*whole)) == list(range(1000))


@pytest.mark.parametrize("workers", WORKERS)
def test_stateful_dataloader_resumes_samples(server, stateful, workers):
    def make():
        dataset = samples(server)
        return stateful(dataset, batch_size=64, sampler=KeyedShuffle(dataset, seed=3), num_workers=workers,
                        multiprocessing_context="forkserver" if workers else None)

    before, rest = resumed(make, 5)
    assert before + rest == in_batches(touchstone.Permutation(1000, 3)[np.arange(1000)].tolist())


@pytest.mark.parametrize("workers", [0, 2])
def test_the_epoch_after_a_resumed_one_is_whole(server, stateful, workers):
    def make():
        return stateful(TouchstoneDataset(server.target, **OPTIONS, batch_size=64, rank=0, ranks=1), batch_size=None,
                        num_workers=workers, multiprocessing_context="forkserver" if workers else None)

    loader = make()
    iterator = iter(loader)
    for _ in range(5):
        next(iterator)
    again = make()
    again.load_state_dict(loader.state_dict())
    assert len(list(again)) == 11
    assert [batch["index"].tolist() for batch in again] == in_batches(list(range(1000)))


def test_a_state_of_workers_is_not_taken_by_others(server):
    dataset = TouchstoneDataset(server.target, **OPTIONS, batch_size=64, rank=0, ranks=1)
    state = dict(dataset.state_dict(), worker="worker 1 of 2")
    with pytest.raises(touchstone.InvalidRequest, match=r"worker 1 of 2.*as many workers"):
        dataset.load_state_dict(state)
