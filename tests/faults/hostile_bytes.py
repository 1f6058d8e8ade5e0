"""Every method of the protocol, at a server and at the gateway of an emulated rig, is sent no message, random bytes, random messages
and extreme values: each call ends with a status that names what is wrong, and the process lives."""

from __future__ import annotations

import contextlib
import math
import random
import subprocess
import tempfile
from typing import Any

import grpc
from google.protobuf import descriptor_pb2, descriptor_pool, message_factory
from google.protobuf.descriptor import FieldDescriptor

from programs import PATIENCE_S, ROOT, Result, Server, describe, emulated_rig, scratch

# A status goes in a header, and headers have a limit of 8 KiB together.
MAX_STATUS_BYTES = 2048
CALL_S = 5.0
# UNIMPLEMENTED: methods of a rig at a server, and of a simulation at a gateway.
NO_MESSAGE = (grpc.StatusCode.INVALID_ARGUMENT, grpc.StatusCode.UNIMPLEMENTED)
# Of methods that have a queue of their own gRPC itself says that there is no message.
QUEUED, NO_MESSAGE_QUEUED = "touchstone.v1.Control", (grpc.StatusCode.INTERNAL,)
NUMBERS = (0, 1, -1, 2**31 - 1, -(2**31), 2**32 - 1, 2**63 - 1, -(2**63), 2**64 - 1)
REALS = (0.0, -0.0, 1.0, -1.0, math.nan, math.inf, -math.inf, 1e300, -1e300, 5e-324, 1e-9)
TEXTS = ("", "lat00", "lat20", "nominal", "x" * 8192, "a\nb\r\x1b[31m", "\x00", "../../etc/passwd", "%n%s", "ä" * 200, "-1", "{}")
BOUNDS = {FieldDescriptor.CPPTYPE_INT32: (-(2**31), 2**31 - 1), FieldDescriptor.CPPTYPE_UINT32: (0, 2**32 - 1),
          FieldDescriptor.CPPTYPE_INT64: (-(2**63), 2**63 - 1), FieldDescriptor.CPPTYPE_UINT64: (0, 2**64 - 1)}


def methods():
    """(name, request class, client streams) of every method in proto/, whichever server has it."""
    with tempfile.NamedTemporaryFile(suffix=".pb") as file:
        protos = sorted((ROOT / "proto/touchstone/v1").glob("*.proto"))
        subprocess.run(["protoc", f"-I{ROOT / 'proto'}", "--include_imports", f"--descriptor_set_out={file.name}", *protos], check=True)
        files = descriptor_pb2.FileDescriptorSet.FromString(file.read())
    pool = descriptor_pool.DescriptorPool()
    for each in files.file:
        pool.Add(each)
    factory = message_factory.MessageFactory(pool)
    prototype: Any = factory.GetPrototype  # type: ignore[attr-defined]  # of protobuf before 5
    return [(f"/{each.package}.{service.name}/{method.name}",
             prototype(pool.FindMessageTypeByName(method.input_type.lstrip("."))), method.client_streaming)
            for each in files.file for service in each.service for method in service.method]


def _value(field, rng: random.Random, depth: int):
    if field.cpp_type in (FieldDescriptor.CPPTYPE_DOUBLE, FieldDescriptor.CPPTYPE_FLOAT):
        return rng.choice(REALS)
    if field.cpp_type in BOUNDS:
        low, high = BOUNDS[field.cpp_type]
        return min(max(rng.choice(NUMBERS), low), high)
    if field.cpp_type == FieldDescriptor.CPPTYPE_BOOL:
        return rng.random() < 0.5
    if field.cpp_type == FieldDescriptor.CPPTYPE_ENUM:
        return rng.choice([value.number for value in field.enum_type.values] + [77])
    return rng.randbytes(rng.choice((0, 3, 1000))) if field.type == FieldDescriptor.TYPE_BYTES else rng.choice(TEXTS)


def fill(message, rng: random.Random, depth: int = 0) -> None:
    """Sets about half of the fields to extreme values, as deep as five messages."""
    for field in message.DESCRIPTOR.fields:
        if rng.random() < (0.4 if depth < 5 else 1.0) or (depth >= 5 and field.message_type):
            continue
        repeated = field.label == FieldDescriptor.LABEL_REPEATED
        if field.message_type and field.message_type.GetOptions().map_entry:
            continue
        if field.message_type:
            for _ in range(rng.choice((1, 2, 40)) if repeated else 1):
                fill(getattr(message, field.name).add() if repeated else getattr(message, field.name), rng, depth + 1)
            if not repeated:
                getattr(message, field.name).SetInParent()
        elif repeated:
            getattr(message, field.name).extend(_value(field, rng, depth) for _ in range(rng.choice((1, 3, 300))))
        else:
            setattr(message, field.name, _value(field, rng, depth))


def _hostile(request_class, rng: random.Random) -> bytes:
    kind = rng.random()
    if kind < 0.2:
        return rng.randbytes(rng.choice((1, 10, 200, 5000)))
    message = request_class()
    fill(message, rng)
    data = bytearray(message.SerializePartialToString())
    if kind < 0.5 and data:
        for _ in range(rng.choice((1, 5, 50))):
            data[rng.randrange(len(data))] = rng.randrange(256)
    return bytes(data)


def _attack(server: Server, method: tuple, calls: int, rng: random.Random, codes: dict, result: Result) -> None:
    """Hostile calls of one method. codes: how often each status came; counted up."""
    name, request_class, client_streams = method
    with server.channel(("grpc.max_metadata_size", 1 << 20)) as channel:
        code, words = _answer(channel.stream_stream(name)(iter(()), timeout=PATIENCE_S))
        right = code in (NO_MESSAGE_QUEUED if QUEUED in name else NO_MESSAGE)
        result.expect(right and (words or code == grpc.StatusCode.UNIMPLEMENTED), f"{name} without a message: {code.name} {words!r}")
        call = (channel.stream_stream if client_streams else channel.unary_stream)(name)
        for k in range(calls):
            data = _hostile(request_class, rng)
            request: Any = iter([data]) if client_streams else data
            code, words = _answer(call(request, timeout=CALL_S))
            codes[code] = codes.get(code, 0) + 1
            place = f"{name}, call {k}"
            # Bytes that are no message are gRPC's own to refuse: INTERNAL without a word.
            result.expect(code != grpc.StatusCode.UNKNOWN and not (code == grpc.StatusCode.INTERNAL and words),
                          f"{place}: {code.name} {words[:200]!r}")
            result.expect(len(words.encode()) <= MAX_STATUS_BYTES, f"{place}: a status of {len(words.encode())} bytes")
            if not server.alive():
                result.failures.append(f"{place}: the server ended with {server.process.returncode}; {data[:80]!r}...")
                return
        describe(channel)


QUIET = ("--log-level", "off", "--max-unary-calls-per-s", "0")


@contextlib.contextmanager
def _servers():
    yield lambda: Server(*QUIET)


@contextlib.contextmanager
def _gateways():
    with scratch() as folder, emulated_rig(folder) as emulator:
        yield lambda: Server("--config", emulator.ready, *QUIET, gateway=True)


# Name: what starts one, and how many times fewer calls it gets; they may move a gateway's rig.
SOURCES = {"server": (_servers, 1), "gateway of an emulated rig": (_gateways, 10)}


def run(calls: int = 300, seed: int = 1, sources: tuple[str, ...] = tuple(SOURCES), part: tuple[int, int] = (0, 1)) -> Result:
    """calls: how many of each method at a server; at a gateway a tenth. sources: of SOURCES. part: (k, n): every n-th method from the
    k-th on."""
    result, rng, some = Result(), random.Random(seed), methods()[part[0]::part[1]]
    for source in sources:
        make, fewer = SOURCES[source]
        count, codes = max(2, calls // fewer), {}
        with make() as start:
            # A crash of one call would hide the others': each method has a process of its own.
            for method in some:
                with start() as attacked:
                    _attack(attacked, method, count, rng, codes, result)
        told = ", ".join(f"{number} {code.name}" for code, number in sorted(codes.items(), key=lambda item: -item[1]))
        result.seen.append(f"{len(some)} methods of a {source}, {count} hostile calls each and one without a message: {told}")
    return result


def _answer(call):
    """(status, its words) once the call has ended; of a stream at most a few messages are read."""
    try:
        for k, _ in enumerate(call):
            if k >= 3:
                call.cancel()
        return grpc.StatusCode.OK, ""
    except grpc.RpcError as error:
        return error.code(), error.details() or ""
