"""The clock of a host is set back and ahead while programs run, by an hour and by years: nothing that they do in time, such as
limits, leases, streams, touches and reconnecting, takes longer or ends sooner, and the bytes are the same."""

from __future__ import annotations

import contextlib
import hashlib
import os
import pathlib
import random
import signal
import socket
import struct
import subprocess
import threading
import time

import grpc

from kill_gateway import PATIENT, Client, compare, dashboard_port
from programs import CLIENT, PATIENCE_S, Preloaded, Result, Server, describe, emulated_rig, export_session, scratch, stream, wait_until
from touchstone.v1 import control_pb2

HOUR_S, YEAR_S = 3600, 365.25 * 86400
# The last is past 2038, where a signed 32-bit second ends.
JUMPS = {"an hour back": -HOUR_S, "an hour ahead": HOUR_S, "ten years back": -10 * YEAR_S, "fifteen years ahead": 15 * YEAR_S}
# For what has to happen after `limit` seconds, on a busy machine. The smallest jump is far longer.
BUSY_S = 60.0


class HostClock(Preloaded):
    """The wall clock of the programs that are started with its environment; host_clock.cpp does it."""

    def __init__(self, folder: str):
        super().__init__("touchstone-host-clock", "TOUCHSTONE_HOST_CLOCK", folder)

    def set(self, ahead_s: float) -> None:
        self.state[:] = struct.pack("<q", round(ahead_s * 1e9))

    def jump(self, seconds: float) -> None:
        """From the true time, back or ahead."""
        self.set(0)
        time.sleep(0.1)  # those that wait have seen it
        self.set(seconds)


def _digest(channel: grpc.Channel, samples: int, timeout_s: float = PATIENCE_S) -> str:
    digest = hashlib.sha256()
    for response in stream(channel, samples, timeout_s=timeout_s):
        digest.update(response.batch.SerializeToString(deterministic=True))
    return digest.hexdigest()


def _closed_after(connection: socket.socket, at_most_s: float) -> bool:
    connection.settimeout(at_most_s)
    try:
        while connection.recv(4096):  # the server's greeting
            pass
    except TimeoutError:
        return False
    except OSError:
        pass
    return True


def _limits(folder: str, names: tuple[str, ...], result: Result) -> None:
    """At a server: a silent connection, a stream that nobody reads, one that is read, and its end."""
    clock = HostClock(folder)
    for name in names:
        seconds = JUMPS[name]
        with Server("--handshake-s", "2", "--stall-s", "2", "--drain-s", "2", environment=clock.environment) as server, \
             server.channel() as reader, server.channel() as stalled:
            expected = _digest(reader, 200_000)
            # First, and alone: whatever else happens may wake the thread that waits for the timers.
            host, port = server.target.split(":")
            silent = socket.create_connection((host, int(port)), timeout=PATIENCE_S)
            silent.recv(1)  # of the greeting: the server has taken the connection
            clock.jump(seconds)
            result.expect(_closed_after(silent, 2 + BUSY_S), f"{name}: a silent connection is still open after {2 + BUSY_S:.0f} s instead of 2 s")
            clock.set(0)
            unread = stream(stalled, 10**9, timeout_s=600)
            next(iter(unread))
            clock.jump(seconds)
            result.expect(_digest(reader, 200_000) == expected, f"{name}: a stream has other bytes")
            result.expect(_ends(unread), f"{name}: a stream that nobody reads was not ended after {2 + BUSY_S:.0f} s instead of 2 s")
            unread = stream(stalled, 10**9, timeout_s=600)
            next(iter(unread))
            clock.jump(-seconds)
            describe(reader)
            server.process.send_signal(signal.SIGTERM)
            try:
                code = server.process.wait(2 + BUSY_S)
                result.expect(code == 0, f"{name}, and then the other way: the server ended with {code} at SIGTERM")
            except subprocess.TimeoutExpired:
                result.failures.append(f"{name}, and then the other way: the server still runs {2 + BUSY_S:.0f} s after SIGTERM instead of 2 s")


def _ends(call) -> bool:
    """Whether a stream's status arrives; what it holds until then is read, in steps so far apart that it counts as unread."""
    ended = threading.Event()
    call.add_callback(ended.set)
    deadline = time.monotonic() + BUSY_S
    while not ended.wait(2.5) and time.monotonic() < deadline:
        with contextlib.suppress(grpc.RpcError):
            for _ in range(1000):
                next(call)
                if ended.is_set():
                    break
    return ended.is_set()


def _rig(folder: str, jumps: int, names: tuple[str, ...], result: Result) -> None:
    """At a gateway with an emulated rig: touches and the lease that they need."""
    clock, rng, answers = HostClock(folder), random.Random(1), {}
    # Slow enough that a stop is the clock's doing, not a busy machine's.
    with emulated_rig(folder, speedup=15) as emulator, \
         Server("--config", emulator.ready, *PATIENT, "--lease-window-s", "3", gateway=True, environment=clock.environment) as gateway, \
         gateway.channel() as channel:
        client = Client(channel, dashboard_port(emulator.ready))
        grpc.channel_ready_future(channel).result(PATIENCE_S)
        client.recover()
        ended = threading.Event()
        toucher = threading.Thread(target=_touch_until, args=(ended, client, answers, result))
        toucher.start()
        made, deadline = 0, time.monotonic() + PATIENCE_S
        while made < jumps or (len(answers) < jumps // 4 and toucher.is_alive() and time.monotonic() < deadline):
            time.sleep(rng.uniform(0.05, 0.3))
            clock.set(rng.choice(list(JUMPS.values())) * rng.uniform(0.5, 1.0))
            made += 1
        ended.set()
        toucher.join()
        for name in names:
            clock.set(0)
            client.recover()
            clock.jump(JUMPS[name])
            client.control.RenewLease(control_pb2.RenewLeaseRequest(token=client.token), timeout=PATIENCE_S)
            result.expect(wait_until(lambda: _may_acquire(client)),
                          f"{name}: a lease of 3 s that nobody renews still stands after {PATIENCE_S:.0f} s")
        if answers:  # else there is no session, and the count below says so
            compare(export_session(channel, "killed"), answers, result)
    result.expect(len(answers) >= jumps // 4, f"only {len(answers)} touches in {made} jumps")
    result.seen.append(f"{len(answers)} touches of an emulated rig during {made} jumps of the gateway's clock are in the session as they "
                       "were answered")


def _may_acquire(client: Client) -> bool:
    try:
        client.control.AcquireLease(control_pb2.AcquireLeaseRequest(holder="another"), timeout=PATIENCE_S)
        return True
    except grpc.RpcError:
        return False


def _touch_until(ended: threading.Event, client: Client, answers: dict[int, bytes], result: Result) -> None:
    while not ended.is_set() and not result.failures:
        try:
            answers[len(answers)] = client.touch(len(answers))
            client.control.RenewLease(control_pb2.RenewLeaseRequest(token=client.token), timeout=PATIENCE_S)
        except grpc.RpcError as error:
            result.failures.append(f"touch {len(answers)}: {error.code().name}: {error.details()}")


def _reconnecting(folder: str, result: Result) -> None:
    """A client whose server went away, and whose clock is set back while it waits for the next attempt."""
    clock, words = HostClock(folder), ["stream", "--samples", "300000", "--shard-size", "20000", "--objects", "lat00,lat20", "--quiet"]
    made, alone = pathlib.Path(folder) / "made", pathlib.Path(folder) / "alone"
    with Server() as server:
        subprocess.run([CLIENT, *words, "--server", server.target, "--out", alone], check=True)
        target = server.target
        client = subprocess.Popen([CLIENT, *words, "--server", target, "--out", made], env=os.environ | clock.environment,
                                  stderr=subprocess.PIPE, text=True)
        wait_until(lambda: any(made.glob("shard-*.tar")))
    try:
        result.expect(client.poll() is None, "the client ended before its server was killed")
        time.sleep(2)
        clock.jump(-HOUR_S)
        time.sleep(1)
        result.expect(client.poll() is None, "the client ended while its server was away")
        with Server(listen=target):
            try:
                _, said = client.communicate(timeout=PATIENCE_S)
                result.expect(client.returncode == 0, f"the client ended with {client.returncode}: {said}")
            except subprocess.TimeoutExpired:
                result.failures.append(f"a client whose clock was set back an hour has not come back after {PATIENCE_S:.0f} s")
    finally:
        client.kill()
        client.wait()
    shards = {path.name: path.read_bytes() for path in alone.glob("shard-*.tar")}
    result.expect({path.name: path.read_bytes() for path in made.glob("shard-*.tar")} == shards, "the client's dataset has other bytes")


PARTS = ("limits", "rig", "reconnecting")


def run(jumps: int = 100, names: tuple[str, ...] = tuple(JUMPS), parts: tuple[str, ...] = PARTS) -> Result:
    """jumps: of the gateway's clock, while it touches. names: of JUMPS, whose limits are tried. parts: of PARTS."""
    result = Result()
    programs = {"limits": lambda folder: _limits(folder, names, result), "rig": lambda folder: _rig(folder, jumps, names, result),
                "reconnecting": lambda folder: _reconnecting(folder, result)}
    for part in parts:
        with scratch() as folder:
            programs[part](folder)
    kept = "took the time that they take, and streams had the same bytes" if not result.failures else "were not all kept"
    result.seen.append(f"clocks set {', '.join(names)}, each way: limits of connections and streams, leases, the end after SIGTERM and a client's "
                       f"return to its server {kept}")
    return result
