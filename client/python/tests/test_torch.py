"""The PyTorch dataset in real DataLoaders: order, ranks, resumption, fork."""

import itertools
import os
import subprocess
import sys
import tempfile
import textwrap
from typing import Any

import numpy as np
import pytest

import touchstone

torch = pytest.importorskip("torch", reason="PyTorch is not installed; the tests of touchstone.torch need it.")

from touchstone.torch import TouchstoneDataset, epoch_seed  # noqa: E402
from touchstone.v1 import control_pb2, control_pb2_grpc  # noqa: E402

# PyTorch's advice about more workers than cores is not ours.
pytestmark = pytest.mark.filterwarnings("ignore:This DataLoader will create")

# 1000 samples in batches of 64: 15 whole ones and one of 40.
OPTIONS: dict[str, Any] = dict(objects=["lat00", "lat20"], plan=touchstone.sphere(step_angle_deg=5), samples=1000, seed=5,
               columns=("index", "object", "descriptor"), batch_size=64)


def dataset(server, **changes):
    return TouchstoneDataset(server.target, **{**OPTIONS, "rank": 0, "ranks": 1, **changes})


def indices(batches):
    return [batch["index"].tolist() for batch in batches]


def in_order(step=64, stop=1000):
    return [list(range(i, min(i + step, stop))) for i in range(0, stop, step)]


@pytest.fixture(scope="module")
def values(server):
    return np.concatenate([b["descriptor_us"] for b in touchstone.connect(server.target).dataset(**OPTIONS)])


def test_batches_are_tensors(server):
    first = next(iter(dataset(server, columns=("index", "object", "descriptor", "image"),
                              image=touchstone.image(20, 10, "rgb"))))
    assert first["descriptor_us"].dtype == torch.float32 and first["descriptor_us"].shape == (64, 3)
    assert first["index"].dtype == torch.int64 and first["object"].dtype == torch.int64
    assert first["image"].dtype == torch.uint8 and first["image"].shape == (64, 3, 10, 20)


OTHER_WORKERS = pytest.mark.second_tier("repeated: other numbers of workers")


@pytest.mark.parametrize("context", ["fork", "forkserver", "spawn"])
@pytest.mark.parametrize("workers", [0, pytest.param(1, marks=OTHER_WORKERS), 2, pytest.param(3, marks=OTHER_WORKERS)])
def test_the_order_does_not_depend_on_the_workers(server, values, workers, context):
    if workers == 0 and context != "fork":
        pytest.skip("no workers, no start method")
    if context == "fork":
        # In a process of its own, which has not used gRPC.
        run_alone(server, f"""
            loader = dataset.loader(num_workers={workers})
            batches = list(loader)
            assert [b["index"].tolist() for b in batches] == in_order, batches
            np.save(sys.argv[1], torch.cat([b["descriptor_us"] for b in batches]).numpy())
        """, values)
        return
    batches = list(dataset(server).loader(num_workers=workers, multiprocessing_context=context))
    assert indices(batches) == in_order()
    np.testing.assert_array_equal(torch.cat([b["descriptor_us"] for b in batches]).numpy(), values)


def run_alone(server, body, values=None):
    """Runs a script with `dataset` and `in_order` in a new process; it may save an array that must equal values."""
    script = "\n".join([
        "import sys, warnings",
        "warnings.simplefilter('error')",
        # PyTorch's advice about more workers than cores is not ours.
        "warnings.filterwarnings('ignore', message='This DataLoader will create')",
        "import numpy as np, torch, touchstone",
        "from touchstone.torch import TouchstoneDataset",
        f"in_order = {in_order()!r}",
        (f"dataset = TouchstoneDataset({server.target!r}, ['lat00', 'lat20'], touchstone.sphere(step_angle_deg=5), "
         "samples=1000, seed=5, columns=('index', 'object', 'descriptor'), batch_size=64)"),
        "if __name__ == '__main__':",
        textwrap.indent(textwrap.dedent(body), "    "),
    ])
    with tempfile.TemporaryDirectory() as folder:
        path, saved = os.path.join(folder, "script.py"), os.path.join(folder, "values.npy")
        with open(path, "w") as file:
            file.write(script)
        # The package of this process, however it was found.
        package = os.path.dirname(os.path.dirname(touchstone.__file__))
        done = subprocess.run([sys.executable, path, saved], capture_output=True, text=True, timeout=120,
                              env={**os.environ, "PYTHONPATH": package}, check=False)
        assert done.returncode == 0, done.stdout + done.stderr
        if values is not None:
            np.testing.assert_array_equal(np.load(saved), values)
        return done.stdout


def test_a_parent_that_used_grpc_gets_workers_that_work(server, values):
    run_alone(server, f"""
        client = touchstone.connect({server.target!r})
        assert next(iter(client.dataset(["lat20"], samples=10))).rows == 10
        batches = list(dataset.loader(num_workers=2))
        assert [b["index"].tolist() for b in batches] == in_order
        np.save(sys.argv[1], torch.cat([b["descriptor_us"] for b in batches]).numpy())
    """, values)


def test_a_fork_of_a_parent_that_used_grpc_is_refused_and_does_not_hang(server):
    out = run_alone(server, f"""
        client = touchstone.connect({server.target!r})
        loader = torch.utils.data.DataLoader(dataset, batch_size=None, num_workers=1, multiprocessing_context="fork")
        try:
            next(iter(loader))
        except touchstone.Refused as error:
            print(error)
    """)
    assert "forkserver" in out


@pytest.mark.parametrize("workers", [0, 1, 2, 3])
def test_samples_come_in_order_too(server, workers):
    loader = dataset(server, batched=False).loader(num_workers=workers)
    batches = list(loader)
    assert len(loader) == 16 and indices(batches) == in_order()
    assert batches[-1]["descriptor_us"].shape == (40, 3)


def test_samples_without_a_loader(server):
    data = dataset(server, batched=False)
    assert len(data) == 1000
    assert [int(sample["index"]) for sample in data] == list(range(1000))


@pytest.mark.parametrize("workers", [0, 2])
@pytest.mark.parametrize("ranks", [2, 3])
def test_ranks_share_the_batches_out(server, ranks, workers):
    loaders = [dataset(server, rank=r, ranks=ranks).loader(num_workers=workers) for r in range(ranks)]
    shares = [indices(loader) for loader in loaders]
    assert [len(share) for share in shares] == [len(loader) for loader in loaders]
    for rank, share in enumerate(shares):
        assert share == in_order()[rank::ranks]


def test_whole_rounds_give_every_rank_as_much(server):
    shares = [indices(dataset(server, rank=r, ranks=4, whole_rounds=True)) for r in range(4)]
    # 15 whole batches make 3 whole rounds of 4.
    assert [len(share) for share in shares] == [3, 3, 3, 3]
    assert sorted(itertools.chain(*shares)) == in_order()[:12]
    assert len(dataset(server, rank=1, ranks=4, whole_rounds=True)) == 3


@pytest.mark.parametrize("at, before, after, batched", [
    (1, 0, 0, True), (5, 0, 2, True), (5, 2, 0, True), (15, 3, 2, True), (16, 2, 2, True), (16, 0, 0, True),
    (5, 0, 2, False), (16, 2, 0, False),
])
def test_a_saved_state_goes_on_exactly(server, at, before, after, batched):
    loader = dataset(server, batched=batched, new_samples_each_epoch=True).loader(num_workers=before)
    whole = [b["descriptor_us"] for _ in range(2) for b in loader]

    # Saved in mid-epoch; as text, as a checkpoint would be.
    loader = dataset(server, batched=batched, new_samples_each_epoch=True).loader(num_workers=before)
    for _ in zip(range(at), loader):
        state = loader.state_dict()
    assert all(isinstance(value, (int, str)) for value in state.values())

    loader = dataset(server, batched=batched, new_samples_each_epoch=True).loader(num_workers=after)
    loader.load_state_dict(state)
    rest = [b["descriptor_us"] for b in loader]
    assert len(rest) == 16 - at and loader.epoch == 1
    rest += [b["descriptor_us"] for b in loader]
    assert len(rest) == 32 - at
    assert all(torch.equal(a, b) for a, b in zip(rest, whole[at:]))


def test_a_state_after_the_epoch_begins_the_next(server):
    loader = dataset(server).loader(num_workers=2)
    assert len(list(loader)) == 16
    again = dataset(server).loader()
    again.load_state_dict(loader.state_dict())
    assert again.epoch == 1 and indices(again) == in_order() and again.epoch == 2


def test_a_state_within_a_batch_of_samples_goes_on_at_the_sample(server):
    data = dataset(server, batched=False)
    for _ in zip(range(100), data):
        pass
    state = data.state_dict()
    again = dataset(server, batched=False)
    again.load_state_dict(state)
    assert [int(s["index"]) for s in again] == list(range(100, 1000))
    # And a state saved right after loading is the same.
    again.load_state_dict(state)
    assert again.state_dict() == state


def test_a_state_fits_other_ranks(server):
    ranks = [dataset(server, rank=r, ranks=2).loader() for r in range(2)]
    for loader in ranks:
        for _ in zip(range(3), loader):
            state = loader.state_dict()
    alone = dataset(server).loader()
    alone.load_state_dict(state)
    assert indices(alone) == in_order()[6:]


def test_a_state_of_another_dataset_is_refused(server):
    state = dataset(server).state_dict()
    with pytest.raises(touchstone.InvalidRequest, match="another specification"):
        dataset(server, seed=6).load_state_dict(state)


@pytest.mark.parametrize("changes, says", [
    ({"version": 2}, "The state has version 2; what state_dict"),
    ({"epoch": -1}, "The state's epoch is -1; it must lie between 0 and"),
    ({"next_index": 1.5}, "The state's next_index is 1.5, not a whole number"),
    ({"next_index": 10**12}, "The state's next_index is 1000000000000; it must lie between 0 and"),
    ({"skip_samples": 64}, "The state's skip_samples is 64; it must lie between 0 and 63"),
    ({"served": "ab"}, "The state's served is 'ab'; 64 hexadecimal digits or none were expected"),
])
def test_a_value_of_a_state_that_cannot_be_is_named(changes, says):
    data = TouchstoneDataset("127.0.0.1:1", **OPTIONS)  # where nothing answers: a state is checked before anything is asked
    with pytest.raises(touchstone.InvalidRequest, match=says):
        data.load_state_dict({**data.state_dict(), **changes})


def test_what_is_no_state_is_refused():
    data = TouchstoneDataset("127.0.0.1:1", **OPTIONS)
    none: Any = None
    with pytest.raises(touchstone.InvalidRequest, match="The state is None; what state_dict"):
        data.load_state_dict(none)
    state = data.state_dict()
    del state["epoch"], state["served"]
    with pytest.raises(touchstone.InvalidRequest, match="The state has no epoch, served; what state_dict"):
        data.load_state_dict(state)


@pytest.mark.parametrize("workers, says", [(-1, "num_workers is -1; it must lie between 0 and 65536"),
                                           ("2", "num_workers is '2'; a whole number was expected")])
def test_a_number_of_workers_that_cannot_be_is_named(workers, says):
    with pytest.raises(touchstone.InvalidRequest, match=says):
        TouchstoneDataset("127.0.0.1:1", **OPTIONS).loader(num_workers=workers)


def test_a_broken_loop_begins_its_epoch_anew(server):
    loader = dataset(server).loader(num_workers=2)
    for _ in zip(range(3), loader):
        pass
    assert loader.state_dict()["next_index"] == 3 * 64
    assert indices(loader) == in_order() and loader.epoch == 1


def test_an_epoch_whose_end_was_not_asked_for_is_over_all_the_same(server):
    loader, data = dataset(server).loader(), dataset(server)
    for batches in (loader, data):
        # zip() ends with the range, which is shorter by one question.
        assert len(list(zip(range(16), batches))) == 16 and batches.epoch == 0
        assert len(list(zip(batches, range(16)))) == 16 and batches.epoch == 2


@pytest.mark.parametrize("workers", [0, 2])
@pytest.mark.parametrize("persistent", [False, True])
def test_epochs_repeat_or_renew_the_samples(server, workers, persistent):
    options = {"persistent_workers": True} if persistent and workers else {}
    same = dataset(server).loader(num_workers=workers, **options)
    new = dataset(server, new_samples_each_epoch=True).loader(num_workers=workers, **options)
    epochs = lambda loader: [torch.cat([b["descriptor_us"] for b in loader]) for _ in range(2)]
    (first, second), (third, fourth) = epochs(same), epochs(new)
    assert torch.equal(first, second) and torch.equal(first, third) and not torch.equal(third, fourth)
    renewed = dataset(server, seed=epoch_seed(5, 1))
    assert torch.equal(fourth, torch.cat([b["descriptor_us"] for b in renewed]))


def test_workers_spread_over_servers_and_survive_the_loss_of_one(server, new_server, values):
    own = new_server()
    # The pictures are there for their size, 24 MB a worker: most of it is not sent yet when the server is killed.
    options = {**OPTIONS, "batch_size": 10, "columns": (*OPTIONS["columns"], "image"), "image": touchstone.image(128, 128, "rgb"),
               "plan": touchstone.sphere(step_angle_deg=5, radius_ratio=1.05)}
    loader = TouchstoneDataset([server.target, own.target], **options).loader(num_workers=2)
    parts = []
    for k, batch in enumerate(loader):
        parts.append(batch["descriptor_us"])
        if k == 5:
            with touchstone.connect(own.target) as client:
                assert client.call(control_pb2_grpc.ControlStub, "GetState", control_pb2.GetStateRequest()).running_streams == 1
            own.kill()
    np.testing.assert_array_equal(torch.cat(parts).numpy(), values)


def test_a_workers_error_is_the_sources_own(server):
    loader = dataset(server, objects=["lat20", "lat99"]).loader(num_workers=1)
    with pytest.raises(touchstone.NotFound, match="lat99"):
        next(iter(loader))


def test_options_that_would_change_the_order_are_refused(server):
    for options in ({"shuffle": True}, {"batch_size": 4}, {"in_order": False}):
        with pytest.raises(touchstone.InvalidRequest):
            dataset(server).loader(**options)
