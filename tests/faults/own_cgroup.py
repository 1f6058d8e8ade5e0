"""A server in a cgroup with a memory limit of its own, as systemd and Slurm make one, and many streams that nobody reads: it
refuses what has no room, and is not ended by the kernel."""

from __future__ import annotations

import contextlib
import os
import pathlib
import time
from collections.abc import Iterator
from typing import Any

from programs import SERVER, SMALL, Program, Result, open_stream, own_channel, wait_until
from touchstone.v1 import source_pb2

# Name of the file with a group's limit, and of that with what it uses, by the type of the hierarchy.
_FILES = {"cgroup2": ("memory.max", "memory.current"), "cgroup": ("memory.limit_in_bytes", "memory.usage_in_bytes")}
_QUIET_S = 2.0  # without growth: the streams are full


def _remove(folder: pathlib.Path) -> None:
    # Empty once the kernel has taken the last process out of it.
    wait_until(lambda: not (folder / "cgroup.procs").read_text())
    folder.rmdir()


@contextlib.contextmanager
def _group(limit_bytes: int) -> Iterator[tuple[pathlib.Path, str]]:
    """A group below that of this process, and its file of usage. PermissionError where none may be made."""
    mounts = [(line.split()[4], line.partition(" - ")[2].split()[0]) for line in
              pathlib.Path("/proc/self/mountinfo").read_text().splitlines()]
    for line in pathlib.Path("/proc/self/cgroup").read_text().splitlines():
        _, controllers, own = line.split(":", 2)
        if controllers and "memory" not in controllers.split(","):
            continue
        kind = "cgroup" if controllers else "cgroup2"
        limit, usage = _FILES[kind]
        for mount in (path for path, type_ in mounts if type_ == kind):
            folder = pathlib.Path(f"{mount}{own}/touchstone-faults-{os.getpid()}")
            if not (folder.parent / usage).exists() and not (folder.parent / limit).exists():
                continue
            try:
                folder.mkdir()
            except OSError:
                continue
            try:
                if (folder / limit).exists():
                    (folder / limit).write_text(str(limit_bytes))
                    yield folder, usage
                    return
            finally:
                _remove(folder)
    raise PermissionError("no cgroup with a memory limit may be made here")


def _request(seed: int) -> source_pb2.StreamDatasetRequest:
    request = source_pb2.StreamDatasetRequest(batch_size=65536)
    request.spec.objects.extend(["lat00", "lat20"])
    request.spec.plan.sphere.SetInParent()
    request.spec.samples, request.spec.seed = 100_000_000, seed
    request.spec.columns.extend(["index", "object", "descriptor", "contact_time", "pose", "contact"])
    return request


def run(limit_mib: int = 600, streams: int = 40) -> Result:
    result = Result()
    with _group(limit_mib << 20) as (folder, usage):
        enter = ("sh", "-c", f'echo $$ > "{folder}/cgroup.procs" && exec "$@"', "sh")
        with Program([*enter, SERVER, "--listen", "127.0.0.1:0", *SMALL], r"listening on (127\.0\.0\.1:\d+)") as server:
            # A window of a byte or so: what nobody reads stays at the server.
            channels = [own_channel(server.ready, ("grpc.http2.lookahead_bytes", 16384), ("grpc.http2.bdp_probe", 0)) for _ in range(streams)]
            calls = [open_stream(channel, _request(seed), 600) for seed, channel in enumerate(channels)]
            largest, grown_at = 0, time.monotonic()
            while server.alive() and time.monotonic() - grown_at < _QUIET_S:
                used = int((folder / usage).read_text())
                if used > largest:
                    largest, grown_at = used, time.monotonic()
                time.sleep(0.01)
            result.expect(server.alive(), f"the kernel ended the server at {largest >> 20} of {limit_mib} MiB")
            if server.alive():
                # HealthCheckRequest{} is no bytes; HealthCheckResponse{status: SERVING} is field 1, varint 1.
                channel: Any = own_channel(server.ready)
                answer = channel.unary_unary("/grpc.health.v1.Health/Check")(b"", timeout=60)
                result.expect(answer == b"\x08\x01", f"its health check says {answer!r}")
            refused = {call.details() for call in calls if call.done()}
            result.expect(all("max_memory_mib" in words or "max_streams" in words for words in refused), f"other refusals: {refused}")
            result.seen.append(f"{streams} streams that nobody reads, in a cgroup of {limit_mib} MiB: at most {largest >> 20} MiB were used")
            for each in channels:
                each.close()
    return result
