"""What a client does when a source is lost or says nothing: the same as that of C++, as documented, and soon enough."""

import contextlib
import pathlib
import re
import signal
import socket
import time
from typing import Any

import numpy as np
import pytest

import touchstone
from touchstone import connection, retry

ROOT = pathlib.Path(__file__).resolve().parents[3]
# So that a test waits for two seconds and not for eight; a source takes more than one question a second for an attack.
FAST = {"grpc.keepalive_time_ms": 1200, "grpc.keepalive_timeout_ms": 1000}


def test_both_languages_have_the_numbers_that_are_documented():
    header = (ROOT / "client/source/connection/retry.h").read_text()
    of_cpp = {re.sub("([A-Z])", r"_\1", name)[1:].lower(): float(value)
              for name, value in re.findall(r"^inline constexpr double k(\w+) = ([\d.]+);", header, re.MULTILINE)}
    of_python = {name.lower(): value for name, value in vars(retry).items() if name.isupper() and name[0] != "_"}
    page = (ROOT / "server/LIMITS.md").read_text().partition("## Clients that lose their server")[2]
    documented = {name: float(value) for name, value in re.findall(r"^\| `(\w+)` \| ([\d.]+)", page, re.MULTILINE)}
    assert len(of_python) == 7
    assert of_python == of_cpp == documented


def test_another_source_is_found_within_ten_seconds():
    assert retry.KEEPALIVE_S + retry.KEEPALIVE_TIMEOUT_S < 10, "of a silent one, in mid-stream"
    assert 2 * retry.CONNECT_S < 10, "also where the next one is silent as well"


@pytest.fixture
def silent():
    """An address at which the system takes connections and nobody looks at them, as at a machine that hangs."""
    with socket.create_server(("127.0.0.1", 0), backlog=100) as listener:
        yield f"127.0.0.1:{listener.getsockname()[1]}"


@pytest.fixture
def fast(monkeypatch):
    monkeypatch.setattr(connection, "_OPTIONS", tuple((name, FAST.get(name, value)) for name, value in connection._OPTIONS))


@pytest.fixture
def stopped(stop_and_wait):
    @contextlib.contextmanager
    def hold(server):
        stop_and_wait(server.process)
        try:
            yield
        finally:
            server.process.send_signal(signal.SIGCONT)

    return hold


def test_connect_goes_on_to_the_next_source_where_one_hangs(server, silent):
    with touchstone.connect([silent, server.target], timeout_s=1) as client:
        assert client.target == server.target and client.objects()


def test_a_call_goes_on_to_the_next_source_where_one_does_not_answer_a_connection(server, silent, monkeypatch):
    options = tuple((name, 500 if name == "grpc.min_reconnect_backoff_ms" else value) for name, value in connection._OPTIONS)
    monkeypatch.setattr(connection, "_OPTIONS", options)
    with touchstone.Client([silent, server.target]) as client:
        assert client.objects() and client.target == server.target


def test_each_source_gets_its_time_once(silent):
    began = time.monotonic()
    with pytest.raises(touchstone.SourceUnreachable, match="no answer in time"):
        touchstone.connect([silent, silent], timeout_s=0.3)
    assert time.monotonic() - began < 30


def test_a_call_leaves_a_source_that_is_stopped(new_server, stopped, fast):
    first, second = new_server(), new_server()
    with touchstone.connect([first.target, second.target]) as client, stopped(first):
        assert client.objects() and client.target == second.target


def test_a_stream_leaves_a_source_that_is_stopped(server, new_server, stopped, losses, fast):
    what: dict[str, Any] = {"objects": ["lat00", "lat20"], "samples": 200_000, "seed": 5, "columns": ("index", "descriptor"), "batch_size": 500}
    first, second = new_server(), new_server()
    batches = []
    with contextlib.ExitStack() as until_the_end:
        client = touchstone.connect([first.target, second.target])
        for batch in client.dataset(**what):
            batches.append(batch)
            if len(batches) == 20:
                until_the_end.enter_context(stopped(first))
    assert losses
    np.testing.assert_array_equal(np.concatenate([batch["index"] for batch in batches]), np.arange(what["samples"]))
    values = np.concatenate([batch["descriptor_us"] for batch in batches])
    wanted = np.concatenate([batch["descriptor_us"] for batch in touchstone.connect(server.target).dataset(**what)])
    assert values.tobytes() == wanted.tobytes()


@pytest.mark.second_tier("long: signs of life while nobody reads")
def test_a_slow_reader_is_no_lost_source(server, losses, fast):
    dataset = touchstone.connect(server.target).dataset(["lat00"], samples=200_000, seed=5, batch_size=500)
    batches = iter(dataset)
    next(batches)
    time.sleep(2 * sum(FAST.values()) / 1000)  # what is meant to pass is time: longer than any sign of life may take
    assert sum(batch.rows for batch in batches) == 200_000 - 500
    assert not losses


def test_a_source_that_has_nothing_to_say_is_no_lost_one(server, fast):
    """It is asked for signs of life while no data flow, and does not take that for an attack, as gRPC by itself does."""
    connected = connection.Connection(server.target)
    channel: Any = connected.channel()
    watch = channel.unary_stream("/grpc.health.v1.Health/Watch")(b"")
    next(watch)  # its state now; the next one comes when it changes
    time.sleep(5 * FAST["grpc.keepalive_time_ms"] / 1000)  # what is meant to pass is time
    assert watch.is_active()
    connected.close()
