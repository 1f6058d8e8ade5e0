"""What was closed says so at every call, and does not connect again."""

import pytest

import touchstone
from touchstone.torch import TouchstoneDataset

ONE = touchstone.touches(target_mm=(0, 0, 0), approach=(0, 0, -1), lateral=(1, 0, 0), standoff_mm=120)


def calls(client, dataset, samples, session):
    row = touchstone.Row(0, "lat20", ONE)
    return {
        "describe": client.describe, "is_physical": lambda: client.is_physical, "lease": client.lease, "with": client.__enter__,
        "stop": client.stop, "objects": client.objects, "model": client.model, "plan": lambda: client.plan(touchstone.sphere(), "lat20", 1),
        "touch": lambda: client.touch("lat20", ONE), "capture": lambda: client.capture("lat20", ONE),
        "dataset": lambda: client.dataset("lat20", samples=1), "samples": lambda: client.samples("lat20", samples=1),
        "session": client.session, "compare": lambda: client.compare("monday"), "check": lambda: client.check("monday"),
        "iteration": lambda: next(iter(dataset)), "header": lambda: dataset.header, "sample": lambda: samples[0],
        "session.with": session.__enter__, "session.made_before": lambda: session.made_before([row]),
        "rig.status": client.rig.status, "rig.stop": client.rig.stop, "rig.reset": lambda: client.rig.reset("done"),
        "rig.check": lambda: client.rig.check("lat20", ONE), "rig.home": client.rig.home,
        "torch": lambda: TouchstoneDataset(client, "lat20", samples=1),
    }


def test_every_call_of_a_closed_client_says_that_it_is_closed(server):
    client = touchstone.connect(server.target)
    dataset, samples, session = client.dataset("lat20", samples=8), client.samples("lat20", samples=8), client.session("monday")
    client.close()
    client.close()
    for name, call in calls(client, dataset, samples, session).items():
        with pytest.raises(touchstone.Refused, match=r"The client of .* is closed") as refused:
            pytest.fail(f"{name} gave {call()!r}")
        assert server.target in str(refused.value)


def test_a_stream_that_runs_ends_with_its_client(server):
    with touchstone.connect(server.target) as client:
        batches = iter(client.dataset("lat20", samples=1_000_000, batch_size=1000))
        next(batches)
    with pytest.raises(touchstone.Refused, match="is closed"):
        for _ in batches:
            pass
