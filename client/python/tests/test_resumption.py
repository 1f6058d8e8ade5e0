"""A stream whose server dies goes on without a gap or a repeat."""

import os
import random
import threading
import time
from typing import Any, Optional

import numpy as np
import pytest

import touchstone
from touchstone import errors
from touchstone.retry import Retry

OPTIONS: dict[str, Any] = dict(objects=["lat00", "lat20"], plan=touchstone.sphere(step_angle_deg=5), samples=200_000, seed=5,
               columns=("index", "descriptor"))


def expected(server):
    dataset = touchstone.connect(server.target).dataset(**OPTIONS)
    return np.concatenate([batch["descriptor_us"] for batch in dataset])


def stream(dataset, at, disturb):
    """All batches; `disturb` is called when batch number `at` was taken."""
    batches = []
    for batch in dataset:
        batches.append(batch)
        if len(batches) == at:
            disturb()
    np.testing.assert_array_equal(np.concatenate([b["index"] for b in batches]), np.arange(dataset.stop))
    return np.concatenate([b["descriptor_us"] for b in batches])


def test_another_server_goes_on_where_the_first_was_killed(server, new_server, losses):
    first, second = new_server(), new_server()
    client = touchstone.connect([first.target, second.target], retry_for_s=20)
    dataset = client.dataset(**OPTIONS, batch_size=500)
    values = stream(dataset, 37, first.kill)
    assert losses
    np.testing.assert_array_equal(values, expected(server))


def test_the_same_server_started_again_goes_on(server, new_server, losses, start_again):
    own = new_server()
    start_again(own, once=lambda: len(losses) >= 3)

    dataset = touchstone.connect(own.target, retry_for_s=60).dataset(**OPTIONS, batch_size=500)
    np.testing.assert_array_equal(stream(dataset, 37, own.kill), expected(server))
    assert len(losses) >= 3


def test_a_client_that_calls_too_often_waits_and_goes_on(new_server, monkeypatch):
    refused, is_too_fast = [], errors.is_too_fast
    monkeypatch.setattr(errors, "is_too_fast", lambda error: refused.append(is_too_fast(error)) or refused[-1])
    # Five at once, then one a second.
    with touchstone.connect(new_server("--max-unary-calls-per-s", "1").target, retry_for_s=0) as client:
        versions = {client.describe().version}
        while not any(refused):
            versions.add(client.describe().version)
        assert len(versions) == 1


# Long runs: TOUCHSTONE_KILLS=100, as the step cluster of deploy/test.
KILLS = int(os.environ.get("TOUCHSTONE_KILLS", "8"))


def test_servers_killed_at_random_all_along_change_no_byte(server, new_server, losses):
    servers = [new_server("--supershape-triangles", "20000") for _ in range(3)]
    options = {**OPTIONS, "samples": 2 * (KILLS + 1) * 16384, "columns": ("index", "descriptor", "pose")}
    client = touchstone.connect([each.target for each in servers], retry_for_s=60)
    dataset = client.dataset(**options, batch_size=16384)
    chance, batches = random.Random(11), []
    restarts: list[Optional[threading.Thread]] = [None] * len(servers)
    for batch in dataset:
        batches.append(batch)
        if len(batches) % 2 or len(batches) > 2 * KILLS:
            continue
        # A blow at any moment of the next batch, and at any server: the one that streams, one that waits, one that starts.
        time.sleep(chance.uniform(0, 0.02))
        number = chance.randrange(len(servers)) if len(batches) > 2 else 0  # the first meets the one that streams
        if restarts[number]:
            restarts[number].join(60)
        servers[number].kill()
        restart = restarts[number] = threading.Thread(target=servers[number].start_again)
        restart.start()
    for last in restarts:
        if last:
            last.join(60)
    reference = list(touchstone.connect(server.target).dataset(**options))
    for column in ("index", "descriptor_us", "target_mm", "approach"):
        one, other = (np.concatenate([batch[column] for batch in each]) for each in (batches, reference))
        assert one.tobytes() == other.tobytes()
    print(f"{KILLS} kills; {len(losses)} times the client found its stream cut or a server gone")
    assert losses, "no blow met the stream; the test shows nothing"


def test_a_drained_server_hands_over(server, new_server, losses):
    first, second = new_server("--drain-s", "0.2"), new_server()
    client = touchstone.connect(f"{first.target},{second.target}", retry_for_s=20)

    def drain():
        first.process.terminate()
        first.process.wait(60)  # nothing is read meanwhile, so that the stream cannot end before

    values = stream(client.dataset(**OPTIONS, batch_size=500), 11, drain)
    assert losses
    np.testing.assert_array_equal(values, expected(server))


def test_patience_is_bounded(new_server, losses, retry_clock):
    own = new_server()
    dataset = touchstone.connect(own.target, retry_for_s=60).dataset(**OPTIONS, batch_size=500)
    with pytest.raises(touchstone.SourceUnreachable, match=own.target):  # noqa: PT012 - raised in the middle of the loop
        for _ in dataset:
            own.kill()
    assert retry_clock.now_s == pytest.approx(60)


def test_a_lost_source_is_named_long_before_patience_is_over(new_server, losses, caplog, retry_clock, start_again):
    def told():
        return [record.getMessage() for record in caplog.records if record.name == "touchstone"]

    own = new_server()
    dataset = touchstone.connect(own.target, retry_for_s=600).dataset(**OPTIONS, batch_size=500)
    batches = iter(dataset)
    next(batches)
    own.kill()
    start_again(own, once=told)
    assert sum(batch.rows for batch in batches) == OPTIONS["samples"] - 500
    assert retry_clock.now_s < 60
    lost, again = told()
    assert own.target in lost and "Start touchstone-server" in lost and "Trying again for" in lost
    assert "answers again" in again


def test_a_server_with_another_model_is_refused(new_server, losses, tmp_path):
    # Both have a model called "rig", but not the same one.
    def model(radius_mm):
        return ("touchstone: model/1\nname: rig\nend_effector: {fingers: 3, spacing_mm: 30}\n"
                f"effects:\n  - tip_radius: {{radius_mm: {radius_mm}}}\n")

    first, second = new_server(), new_server()
    touchstone.connect(first.target).add_model(model(2))
    touchstone.connect(second.target).add_model(model(3))
    client = touchstone.connect([first.target, second.target], retry_for_s=5)
    with pytest.raises(touchstone.SourceChanged, match="model hash"):
        stream(client.dataset(**OPTIONS, model="rig", batch_size=500), 5, first.kill)


def test_unary_calls_find_the_server_that_is_there(server, nobody):
    client = touchstone.connect([nobody, server.target])
    assert client.target == server.target and client.objects()


def test_a_call_is_not_repeated_when_it_was_refused(client, monkeypatch):
    monkeypatch.setattr(Retry, "lost", lambda *_: pytest.fail("the call was made again"))
    with pytest.raises(touchstone.NotFound):
        client.touch("no such object", touchstone.touches(
            target_mm=(0, 0, 0), approach=(0, 0, -1), lateral=(1, 0, 0), standoff_mm=200))
