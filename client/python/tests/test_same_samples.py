"""The first promises of the README: whatever ends a training in mid-epoch, it sees the same samples in the same order."""

import json
import os
import signal
import subprocess
import sys
import textwrap
from typing import Any

import pytest

torch = pytest.importorskip("torch", reason="PyTorch is not installed; the tests of touchstone.torch need it.")

from touchstone.torch import TouchstoneDataset  # noqa: E402

pytestmark = pytest.mark.filterwarnings("ignore:This DataLoader will create")

# 1000 samples in 16 batches, the last one shorter; each epoch has its own.
OPTIONS: dict[str, Any] = dict(objects=["lat00", "lat20"], samples=1000, seed=5, columns=("index", "object", "descriptor"), batch_size=64,
                               rank=0, ranks=1, new_samples_each_epoch=True)


def loader(target, workers):
    return TouchstoneDataset(target, **OPTIONS).loader(num_workers=workers)


def seen(batches):
    return [batch["descriptor_us"].tolist() for batch in batches]


@pytest.fixture(scope="module")
def whole(server):
    """Two epochs without an interruption and without workers."""
    without = loader(server.target, 0)
    return seen(without) + seen(without)


def test_resumed_twice_in_mid_epoch_it_sees_the_same(server, whole):
    got, state = [], None
    for stop, workers in ((5, 2), (11, 0), (32, 3)):
        resumed = loader(server.target, workers)
        if state is not None:
            resumed.load_state_dict(json.loads(json.dumps(state)))
        while len(got) < stop:
            for batch in resumed:
                got += seen([batch])
                state = resumed.state_dict()
                if len(got) == stop:
                    break
    assert got == whole


TRAINING = """
import json, os, sys
from touchstone.torch import TouchstoneDataset

if __name__ == "__main__":
    target, folder, options = sys.argv[1], sys.argv[2], json.loads(sys.argv[3])
    loader = TouchstoneDataset(target, **options).loader(num_workers=2)
    seen = []
    for batch in loader:
        seen.append(batch["descriptor_us"].tolist())
        with open(f"{folder}/part", "w") as file:
            json.dump({"seen": seen, "state": loader.state_dict()}, file)
        os.replace(f"{folder}/part", f"{folder}/checkpoint")
        print(len(seen), flush=True)
"""


@pytest.mark.parametrize("killed", ["training", "training and server"])
def test_after_kill_9_in_mid_epoch_it_sees_the_same(new_server, tmp_path, whole, killed):
    own = new_server("--max-unary-calls-per-s", "0")
    (tmp_path / "training.py").write_text(textwrap.dedent(TRAINING))
    training = subprocess.Popen([sys.executable, tmp_path / "training.py", own.target, tmp_path, json.dumps(OPTIONS)], stdout=subprocess.PIPE,
                                text=True, env=dict(os.environ))
    assert training.stdout is not None
    for line in training.stdout:  # which it says after each batch
        if int(line) == 5:
            training.send_signal(signal.SIGKILL)
            break
    assert training.wait() == -signal.SIGKILL
    training.stdout.close()
    if killed != "training":
        own.kill()
        own.start_again()

    checkpoint = json.loads((tmp_path / "checkpoint").read_text())
    assert 5 <= len(checkpoint["seen"]) < 16
    resumed = loader(own.target, 3)
    resumed.load_state_dict(checkpoint["state"])
    assert checkpoint["seen"] + seen(resumed) + seen(resumed) == whole
