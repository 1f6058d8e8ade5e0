"""Two servers, of which the first is killed or stopped as a client begins or in mid-stream: the second takes over within the time
of the policy, and the bytes are those of a stream that nothing happened to."""

from __future__ import annotations

import hashlib
import os
import pathlib
import random
import signal
import subprocess
import sys
import time

from programs import CLIENT, Result, Server, scratch

# Largest time from the blow to a batch of the other server, beside the work itself: silence, sign of life, connection, and
# what a busy machine adds.
LIMIT_S = 10.0
SEED = 8

# Streams from the servers given, and prints a digest of what came, as a client of its own.
PYTHON = """
import hashlib, sys, touchstone
digest = hashlib.sha256()
with touchstone.connect(sys.argv[1]) as client:
    for batch in client.dataset(["lat20", "lat00"], samples=int(sys.argv[2]), seed=1, batch_size=500):
        digest.update(batch["descriptor_us"].tobytes() + batch["object"].tobytes())
print(digest.hexdigest())
"""


def _files(program: Server) -> int:
    return len(os.listdir(f"/proc/{program.process.pid}/fd"))


def _command(client: str, samples: int, servers: str, out: pathlib.Path) -> list[str]:
    if client == "python":
        return [sys.executable, "-c", PYTHON, servers, str(samples)]
    return [str(CLIENT), "stream", "--objects", "lat20,lat00", "--samples", str(samples), "--seed", "1", "--batch-size", "500",
            "--server", servers, "--out", str(out), "-q"]


def _digest(client: str, out: pathlib.Path, printed: str) -> str:
    if client == "python":
        return printed.strip()
    shards = sorted(out.glob("*.tar"))
    return hashlib.sha256(b"".join(shard.read_bytes() for shard in shards)).hexdigest() if shards else "no shard"


def _finish(process: subprocess.Popen, began: float) -> tuple[int, str, str, float]:
    printed, said = process.communicate(timeout=120)
    return process.returncode, printed, said, time.monotonic() - began


def run(blows: int = 30, clients=("command line", "python"), signals=("SIGKILL", "SIGSTOP"), samples: int = 200_000) -> Result:
    """blows: how many of each client and signal; half of them as it begins, the others in mid-stream."""
    result, chance = Result(), random.Random(SEED)
    with scratch() as folder, Server() as second:
        for client in clients:
            whole = subprocess.Popen(_command(client, samples, second.target, pathlib.Path(folder) / "whole"), text=True,
                                     stdout=subprocess.PIPE, stderr=subprocess.PIPE)
            status, printed, said, usual_s = _finish(whole, time.monotonic())
            result.expect(status == 0, f"{client} without a blow: {said[-200:]}")
            wanted = _digest(client, pathlib.Path(folder) / "whole", printed)
            for name in signals:
                longest_s = 0.0
                for k in range(blows):
                    out = pathlib.Path(folder) / f"{client.replace(' ', '-')}-{name}-{k}"
                    with Server() as first:
                        idle = _files(first)
                        process = subprocess.Popen(_command(client, samples, f"{first.target},{second.target}", out), text=True,
                                                   stdout=subprocess.PIPE, stderr=subprocess.PIPE)
                        began = time.monotonic()
                        while process.poll() is None and _files(first) <= idle:
                            time.sleep(0.0005)
                        time.sleep(chance.choice([0, 0.001, 0.01, *(chance.uniform(0, 0.6 * usual_s) for _ in range(3))]))
                        first.process.send_signal(getattr(signal, name))
                        status, printed, said, took_s = _finish(process, began)
                    longest_s = max(longest_s, took_s)
                    blow = f"{client}, {name} {k}"
                    result.expect(status == 0, f"{blow}: exit status {status}, {said.strip()[-200:]}")
                    result.expect(_digest(client, out, printed) == wanted, f"{blow}: other bytes")
                    result.expect(took_s < LIMIT_S + 3 * usual_s, f"{blow}: took {took_s:.1f} s, usually {usual_s:.1f} s")
                result.seen.append(f"{client}: {blows} times the first of two servers got {name}; the stream took {longest_s:.1f} s "
                                   f"at most, {usual_s:.1f} s without a blow, and had the same bytes")
    return result
