"""Real servers for the tests. TOUCHSTONE_SERVER_PROGRAM names the program; default build/release/bin/touchstone-server."""

import os
import pathlib
import re
import signal
import socket
import subprocess
import threading

import pytest

import touchstone
from touchstone import connection, credentials, retry
from touchstone.dataset import Dataset

_REPOSITORY = pathlib.Path(__file__).resolve().parents[3]


class Server:
    """A touchstone-server on a free port, or on the one given, at an address of this machine alone."""

    def __init__(self, program, *options, port=0, host="127.0.0.1"):
        self._program, self._options, self._host = str(program), options, host
        self._start(port)

    def _start(self, port):
        self.process = subprocess.Popen(
            [self._program, "--listen", f"{self._host}:{port}", *self._options],
            stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        )
        # Both pipes are drained all along, or the server would block on a full one.
        self.log = []
        threading.Thread(target=self._drain, args=(self.process.stderr, self.log), daemon=True).start()
        for line in self.process.stdout:
            found = re.search(rf"listening on {re.escape(self._host)}:(\d+)", line)
            if found:
                break
        else:
            self.process.wait()
            raise RuntimeError(f"{self._program} ended with {self.process.returncode}: {''.join(self.log)}")
        threading.Thread(target=self._drain, args=(self.process.stdout, []), daemon=True).start()
        self.port = int(found.group(1))
        self.target = f"{self._host}:{self.port}"

    @staticmethod
    def _drain(pipe, lines):
        with pipe:
            lines.extend(pipe)

    def kill(self):
        self.process.send_signal(signal.SIGKILL)
        self.process.wait()

    def start_again(self):
        self._start(self.port)

    def stop(self):
        self.process.terminate()
        try:
            self.process.wait(timeout=60)
        except subprocess.TimeoutExpired:
            self.kill()
            raise


@pytest.fixture(scope="session")
def server_program():
    program = pathlib.Path(os.environ.get("TOUCHSTONE_SERVER_PROGRAM") or _REPOSITORY / "build/release/bin/touchstone-server")
    if not program.exists():
        pytest.fail(f"{program} does not exist; build it, or set TOUCHSTONE_SERVER_PROGRAM.")
    return program


@pytest.fixture(scope="session")
def server(server_program):
    """One server for all tests that leave it as it is."""
    # It limits nobody, and when it ends it does not wait until the idle channels of this process look.
    running = Server(server_program, "--max-unary-calls-per-s", "0", "--drain-s", "0.1")
    yield running
    running.stop()


@pytest.fixture
def new_server(server_program):
    """A function that starts servers of the test's own."""
    started = []

    def start(*options, port=0, host="127.0.0.1"):
        started.append(Server(server_program, *options, port=port, host=host))
        return started[-1]

    yield start
    for running in started:
        if running.process.poll() is None:
            running.kill()


@pytest.fixture
def client(server):
    with touchstone.connect(server.target) as connected:
        yield connected


@pytest.fixture(scope="session")
def two_rounds(tmp_path_factory):
    """A function that measures 24 poses of lat20 in two rounds with a rig of that model; it returns the file."""

    def measure(client, model):
        touches = client.plan(touchstone.faces(samples_per_face=4, rounds=2), "lat20", count=48)
        batch = client.touch("lat20", touches, model=model, seed=1)
        path = tmp_path_factory.mktemp("two_rounds") / "set.csv"
        touchstone.write_measurements(path, [touchstone.Row(k, "lat20", touches[k:k + 1], tuple(batch["contact_time_us"][k]))
                                             for k in range(len(touches))])
        return path

    return measure


@pytest.fixture
def nobody():
    """An address of this machine at which nobody listens, for as long as the test runs."""
    with socket.socket() as bound:
        bound.bind(("127.0.0.1", 0))
        yield f"127.0.0.1:{bound.getsockname()[1]}"


class Clock:
    """Stands in for the module `time`: its time passes where it is waited for, and at no other moment.

    Attributes:
      during: called in every wait.
    """

    def __init__(self):
        self.now_s, self.during = 0.0, lambda: None

    def monotonic(self):
        return self.now_s

    def sleep(self, seconds):
        self.now_s += seconds
        self.during()


@pytest.fixture
def retry_clock(monkeypatch):
    """The clock of connections of this process that try a lost source again."""
    clock = Clock()
    monkeypatch.setattr(retry, "time", clock)
    return clock


@pytest.fixture
def start_again(retry_clock):
    """A function that has a server started again in the client's first wait in which `once()` is true. Where that never comes,
    the client's patience ends the test."""

    def arrange(server, once):
        def start():
            if once() and server.process.poll() is not None:
                server.start_again()

        retry_clock.during = start

    return arrange


@pytest.fixture
def at_once(monkeypatch):
    """What is refused is refused at the first attempt, however slow the machine is to find out why."""
    monkeypatch.setattr(retry.Retry, "lost", lambda *_: pytest.fail("tried again although nothing could change"))
    monkeypatch.setattr(credentials, "_PROBE_S", 60.0)


@pytest.fixture
def little_ahead(monkeypatch):
    """Data come at most 64 KiB ahead of what was read: without that bound all of a short stream lies in buffers on the way
    by the time its source is killed, and nothing is lost. Gives the options of gRPC that do this, for other processes."""
    options = (("grpc.http2.bdp_probe", 0), ("grpc.http2.lookahead_bytes", 65536))
    monkeypatch.setattr(connection, "_OPTIONS", connection._OPTIONS + options)
    return options


@pytest.fixture
def losses(monkeypatch, little_ahead):
    """The errors by which datasets of this process found their source lost, in order."""
    found, lost = [], Dataset._lost

    def record(dataset, error, retry):
        found.append(error)
        lost(dataset, error, retry)

    monkeypatch.setattr(Dataset, "_lost", record)
    return found
