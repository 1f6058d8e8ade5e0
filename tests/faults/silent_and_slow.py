"""Clients that connect and say nothing, speak half a greeting, talk nonsense, or read no answer: the others are served."""

from __future__ import annotations

import contextlib
import os
import socket
import time

import grpc

from programs import Result, Server, describe, stream

PREFACE = b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n"
MAX_FILES = 256
WITHIN_S = 60.0


def _connect(target: str, count: int, says: bytes) -> list[socket.socket]:
    host, port = target.split(":")
    sockets = []
    for _ in range(count):
        try:
            connection = socket.create_connection((host, int(port)), timeout=2)
            connection.sendall(says)
        except OSError:
            continue
        sockets.append(connection)
    return sockets


def _served(server: Server, result: Result, beside: str) -> None:
    """A client that comes now gets an answer before patience is over, as people's clients ask again until then."""
    deadline, words = time.monotonic() + WITHIN_S, ""
    while time.monotonic() < deadline and server.alive():
        with server.channel() as channel:
            try:
                describe(channel, timeout_s=5)
                return
            except grpc.RpcError as error:
                words = f"{error.code().name}: {error.details()}"
    result.failures.append(f"beside {beside} no other client is served within {WITHIN_S:.0f} s: {words}"
                           + ("" if server.alive() else f"; the server ended with {server.process.returncode}"))


def run(connections: int = 600, handshake_s: float = 10) -> Result:
    """connections: how many of each kind, to a server that may have 256 open files. handshake_s: after which it closes them."""
    result = Result()
    for name, says in (("silent connections", b""), ("connections with half a greeting", PREFACE[:10]),
                       ("connections with a greeting and no more", PREFACE),
                       ("connections of nonsense", b"GET / HTTP/1.1\r\n\r\n" + os.urandom(300))):
        with Server("--handshake-s", str(handshake_s), max_files=MAX_FILES) as server, contextlib.ExitStack() as open_:
            for connection in _connect(server.target, connections, says):
                open_.callback(connection.close)
            _served(server, result, name)
    _slow_readers(result, 40)
    result.seen.append(f"beside {connections} silent, half greeting, greeting or nonsensical connections to a server of {MAX_FILES} files, and "
                       "beside 40 streams that nobody reads, another client was served")
    return result


def _slow_readers(result: Result, streams: int) -> None:
    with Server() as server, server.channel() as stalled, server.channel() as other:
        calls = [stream(stalled, 10**9, timeout_s=600) for _ in range(streams)]
        for call in calls:
            next(iter(call))
        rows = sum(response.batch.rows for response in stream(other, 200_000))
        result.expect(rows == 200_000, f"beside {streams} stalled streams another one gave {rows} of 200,000 samples")
        for call in calls:
            call.cancel()
