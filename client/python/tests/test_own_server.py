"""connect() without an address: a server of its own, which ends with the client, the process, and a process that is killed."""

import os
import signal
import socket
import subprocess
import sys
import time

import pytest

import touchstone


@pytest.fixture(autouse=True)
def named(server_program, monkeypatch):
    monkeypatch.setenv("TOUCHSTONE_SERVER_PROGRAM", str(server_program))


def expect_serving(target):
    touchstone.connect(target, timeout_s=60).close()


def listens(target):
    """Also a server that is slow to answer does."""
    try:
        socket.create_connection(target.split(":"), timeout=30).close()
        return True
    except ConnectionRefusedError:
        return False


def expect_gone(target):
    give_up = time.monotonic() + 60
    while listens(target):
        assert time.monotonic() < give_up, "the server outlives what it belongs to"
        time.sleep(0.01)


def test_it_serves_and_ends_with_the_client():
    with touchstone.connect() as client:
        target = client.target
        assert client.describe().kind == "virtual"
        assert client.samples(["lat20"], samples=10)[3]["descriptor_us"].shape == (3,)
        expect_serving(target)
    assert not listens(target)


def script(*lines):
    """A process that prints the address of its server and then does what these lines say."""
    package = os.path.dirname(os.path.dirname(touchstone.__file__))
    text = "\n".join(["import os, sys, threading, time, touchstone", "client = touchstone.connect()",
                      "print(client.target, flush=True)", *lines])
    return subprocess.Popen([sys.executable, "-c", text], stdout=subprocess.PIPE, text=True,
                            env={**os.environ, "PYTHONPATH": package})


@pytest.mark.parametrize("ending", ["pass", "sys.exit(3)", "raise SystemExit"])
def test_it_ends_with_the_process(ending):
    process = script(ending)
    target = process.stdout.readline().strip()
    process.wait(timeout=60)
    expect_gone(target)


def test_it_ends_with_a_process_that_is_killed():
    process = script("time.sleep(600)")
    target = process.stdout.readline().strip()
    expect_serving(target)
    process.send_signal(signal.SIGKILL)
    process.wait()
    expect_gone(target)


def test_a_thread_that_ends_does_not_take_it_along():
    process = script(
        "clients = []",
        "thread = threading.Thread(target=lambda: clients.append(touchstone.connect()))",
        "thread.start(); thread.join()",
        # By then the kernel has sent what it sends when a thread ends; a server that was told to end cuts the stream.
        "while os.path.exists(f'/proc/self/task/{thread.native_id}'): pass",
        "print(sum(batch.rows for batch in clients[0].dataset(['lat20'], samples=300_000)), flush=True)",
    )
    process.stdout.readline()
    assert process.stdout.readline().strip() == "300000"
    assert process.wait(timeout=60) == 0


def test_no_server_to_start_is_said_with_what_to_do(monkeypatch, tmp_path):
    monkeypatch.setenv("TOUCHSTONE_SERVER_PROGRAM", str(tmp_path / "nothing"))
    with pytest.raises(touchstone.SourceUnreachable, match=r"TOUCHSTONE_SERVER_PROGRAM is .*nothing"):
        touchstone.connect()


@pytest.mark.parametrize("says", ["echo no disk left >&2",
                                  # Written by another process that still has the pipe, after this one has ended.
                                  "{ while kill -0 $PPID; do sleep 0.01; done 2>/dev/null; echo no disk left >&2; } &"])
def test_a_server_that_does_not_start_is_quoted(monkeypatch, tmp_path, says):
    program = tmp_path / "touchstone-server"
    program.write_text(f"#!/bin/sh\n{says}\nexit 4\n")
    program.chmod(0o755)
    monkeypatch.setenv("TOUCHSTONE_SERVER_PROGRAM", str(program))
    with pytest.raises(touchstone.SourceUnreachable, match="ended with 4: no disk left"):
        touchstone.connect()


def test_the_variable_names_the_source_of_a_connect_without_one(server, monkeypatch):
    monkeypatch.setenv("TOUCHSTONE_SERVER", server.target)
    with touchstone.connect() as client:
        assert client.target == server.target
        assert client.own_server is None
    with touchstone.connect("none") as client:
        assert client.own_server is not None
        assert client.target != server.target


def test_an_address_goes_before_the_variable(server, monkeypatch):
    monkeypatch.setenv("TOUCHSTONE_SERVER", "127.0.0.1:1")
    with touchstone.connect(server.target) as client:
        assert client.target == server.target


def test_a_path_in_the_variable_is_refused_with_the_right_variable(server_program, monkeypatch):
    monkeypatch.setenv("TOUCHSTONE_SERVER", str(server_program))
    with pytest.raises(touchstone.InvalidRequest, match=r"is a path.*TOUCHSTONE_SERVER_PROGRAM"):
        touchstone.connect()
