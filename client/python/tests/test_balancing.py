"""One name, several servers: each stream goes to the next one, and a lost one's streams go on at the others."""

import hashlib
import subprocess
import sys
from typing import Any

import pytest

import touchstone

NAME = "servers.touchstone.test"
DATASET: dict[str, Any] = dict(objects=["lat00", "lat20"], samples=200_000, seed=5, columns=("index", "descriptor"))

# Runs where NAME has the addresses of both servers. Opens streams until each server has one, says so, waits until one of the
# servers is gone, and prints a digest of every stream and how often one was lost. Arguments: options of gRPC, port, addresses.
CLIENT = f"""
import ast, hashlib, sys, time
import touchstone
from touchstone import connection
from touchstone.v1 import control_pb2, control_pb2_grpc

connection._OPTIONS += ast.literal_eval(sys.argv[1])

def running(target):
    with touchstone.connect(target) as client:
        return client.call(control_pb2_grpc.ControlStub, "GetState", control_pb2.GetStateRequest()).running_streams

port, addresses = sys.argv[2], sys.argv[3:]
dataset = touchstone.connect(f"dns:///{NAME}:{{port}}", retry_for_s=60).dataset(**{DATASET!r}, batch_size=500)
losses, lost = [], dataset._lost
dataset._lost = lambda error, retry: (losses.append(error), lost(error, retry))
streams, heads = [], []
end = time.monotonic() + 60
while not all(running(address) for address in addresses):
    assert time.monotonic() < end, "all streams went to one server"
    streams.append(iter(dataset))
    heads.append(next(streams[-1]))
print("spread", flush=True)
sys.stdin.readline()
for head, stream in zip(heads, streams):
    digest = hashlib.sha256(head["descriptor_us"].tobytes())
    for batch in stream:
        digest.update(batch["descriptor_us"].tobytes())
    print(digest.hexdigest(), flush=True)
print(len(losses), "lost", flush=True)
"""


def test_streams_to_a_name_spread_over_its_servers_and_outlive_one(new_server, little_ahead, tmp_path):
    first = new_server()
    second = new_server(port=first.port, host="127.0.0.2")
    hosts = tmp_path / "hosts"
    hosts.write_text(f"127.0.0.1 localhost\n127.0.0.1 {NAME}\n127.0.0.2 {NAME}\n")
    own_hosts = ["unshare", "--mount", "sh", "-c", 'mount --bind "$0" /etc/hosts && exec "$@"', str(hosts)]
    if subprocess.run([*own_hosts, "true"], capture_output=True, check=False).returncode:
        pytest.skip("only root may give a process names of its own (unshare --mount)")
    with subprocess.Popen([*own_hosts, sys.executable, "-c", CLIENT, repr(little_ahead), str(first.port), first.target,
                           second.target], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as client:
        assert client.stdout.readline() == "spread\n"
        first.kill()
        *digests, losses = client.communicate("go on\n", timeout=120)[0].splitlines()
    whole = hashlib.sha256()
    for batch in touchstone.connect(second.target).dataset(**DATASET):
        whole.update(batch["descriptor_us"].tobytes())
    assert len(digests) >= 2 and set(digests) == {whole.hexdigest()}
    assert losses.endswith("lost") and losses != "0 lost"
