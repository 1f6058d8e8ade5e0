"""Many streams of slow samples keep every thread of a server busy, and another stream asks for a few quick ones from the same
address: its first batch comes long before each of the slow ones has had another turn, as it would in the order of requests."""

from __future__ import annotations

import pathlib
import statistics
import subprocess
import sys
import threading
import time

import grpc

from programs import Result, Server, open_stream, own_channel
from touchstone.v1 import source_pb2

LONG_S = 600.0  # more than anything here takes


def _formulas() -> str:
    terms = "+".join(f"sin({k}*travel_mm)" for k in range(1, 20))
    effects = "".join(f"  - formula: {{name: f{k}, adds: travel_mm, expression: \"a*1e-9*({terms})\", "
                      f"parameters: {{a: {{value: {k + 1}, unit: mm, min: 0, max: 100}}}}}}\n" for k in range(62))
    return f"touchstone: model/1\nname: slow\neffects:\n{effects}"


def _request(samples: int, kind: str = "quick", batch_size: int = 4096) -> source_pb2.StreamDatasetRequest:
    request = source_pb2.StreamDatasetRequest(batch_size=batch_size)
    request.spec.objects.append("lat00")
    request.spec.plan.sphere.SetInParent()
    request.spec.samples = samples
    if kind == "formulas":
        request.spec.model.yaml = _formulas()
    elif kind == "pictures":
        request.spec.columns.append("image")
        request.spec.image.width = request.spec.image.height = 512
    return request


class _Slow:
    """A stream that is read for as long as it lives."""

    def __init__(self, channel: grpc.Channel, request: source_pb2.StreamDatasetRequest):
        self.batches = 0
        self._call = open_stream(channel, request, LONG_S)
        self._thread = threading.Thread(target=self._read, daemon=True)
        self._thread.start()

    def _read(self) -> None:
        try:
            for response in self._call:
                self.batches += response.HasField("batch")
        except grpc.RpcError:
            pass

    def end(self) -> None:
        self._call.cancel()
        self._thread.join()


def _round_s(slow: list[_Slow], turns: int = 2) -> float:
    """The time in which each of them gets another batch, over so many turns: where they run at once, those of one turn may all
    come at its end."""
    begin, before = time.monotonic(), [each.batches for each in slow]
    while any(each.batches < old + turns for each, old in zip(slow, before)):
        if time.monotonic() - begin > LONG_S:
            raise TimeoutError(f"the slow streams had {[each.batches for each in slow]} batches, {before} {LONG_S:.0f} s before")
        time.sleep(0.01)
    return (time.monotonic() - begin) / turns


def first_batch_s(target: str) -> float:
    """How long a quick stream over a connection of its own waits for its first batch."""
    with own_channel(target) as channel:
        begin = time.monotonic()
        for response in open_stream(channel, _request(1000), LONG_S):
            if response.HasField("batch"):
                return time.monotonic() - begin
    raise RuntimeError("the stream ended without a batch")


def _waits_s(server: Server, times: int) -> list[float]:
    """Sorted. From a process of its own: this one is busy with reading the slow streams, and would be waited for too."""
    script = f"import slow_streams; print(*(slow_streams.first_batch_s({server.target!r}) for _ in range({times})))"
    said = subprocess.run([sys.executable, "-c", script], cwd=pathlib.Path(__file__).parent, stdout=subprocess.PIPE, text=True,
                          check=True, timeout=LONG_S)
    return sorted(map(float, said.stdout.split()))


KINDS = ("formulas", 4096), ("formulas", 16384), ("pictures", 64)


def run(streams: int = 20, times: int = 100, kinds: tuple[tuple[str, int], ...] = KINDS) -> Result:
    """streams: slow ones at once. times: how often the quick one is asked for beside them. kinds: what makes them slow, and the
    samples of their batches."""
    result = Result()
    for kind, batch_size in kinds:
        with Server("--renderer", "cpu") as server:
            slow = [_Slow(server.channel(("grpc.max_receive_message_length", -1)), _request(10**9, kind, batch_size)) for _ in range(streams)]
            _round_s(slow, turns=1)
            waits = _waits_s(server, times)
            round_s = _round_s(slow)
            for each in slow:
                each.end()
            result.expect(server.alive(), "the server ended")
        median = statistics.median(waits)
        result.expect(median < round_s / 2, f"beside {streams} streams of {kind} a quick one waited {median:.2f} s, "
                                             f"as long as a turn of them all ({round_s:.2f} s)")
        result.seen.append(f"beside {streams} streams of {kind}, {batch_size} a batch, from the same address a quick "
                           f"stream had its first batch after {waits[0]:.3f} to {waits[-1]:.3f} s (median {median:.3f}, {times} "
                           f"times); the slow ones had one each in {round_s:.1f} s")
    return result
