"""What the programs of this folder share: a real server that can be killed, calls of its methods, and a result."""

from __future__ import annotations

import dataclasses
import mmap
import os
import pathlib
import re
import signal
import subprocess
import tempfile
import threading
import time
from typing import Callable

import grpc

from touchstone.v1 import models_pb2, sessions_pb2, source_pb2

ROOT = pathlib.Path(__file__).resolve().parents[2]
SERVER = pathlib.Path(os.environ.get("TOUCHSTONE_SERVER_PROGRAM") or ROOT / "build/release/bin/touchstone-server")
GATEWAY, EMULATOR = SERVER.parent / "touchstone-gateway", SERVER.parent / "touchstone-rig-emulator"
CLIENT = SERVER.parent / "touchstone"
# Five supershapes that take a moment to build: what is tried here does not depend on their size.
SMALL = ("--supershape-triangles", "2000")
PATIENCE_S = 60.0


@dataclasses.dataclass
class Result:
    """What a program saw: `seen` for people, `failures` for tests. No failure: the promise was kept."""

    seen: list[str] = dataclasses.field(default_factory=list)
    failures: list[str] = dataclasses.field(default_factory=list)

    def expect(self, kept: bool, broken: str) -> None:
        if not kept:
            self.failures.append(broken)


class Program:
    """A process that says on standard output when it is ready, killed at the end.

    Attributes:
      ready: what it said then.
      log: its lines on standard error so far.
    """

    def __init__(self, words: list, ready: str, environment: dict[str, str] | None = None):
        """ready: a regular expression with one group. environment: beside that of this process."""
        self.process = subprocess.Popen(list(map(str, words)), text=True, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
                                        env=os.environ | (environment or {}))
        self.log: list[str] = []
        threading.Thread(target=self.log.extend, args=(self.process.stderr,), daemon=True).start()
        for line in self.process.stdout:
            if found := re.search(ready, line):
                self.ready = found.group(1)
                break
        else:
            raise RuntimeError(f"{words[0]} ended with {self.process.wait()}: {''.join(self.log)}")
        threading.Thread(target=lambda: [None for _ in self.process.stdout], daemon=True).start()

    def __enter__(self):
        return self

    def __exit__(self, *_) -> None:
        self.kill()

    def alive(self) -> bool:
        return self.process.poll() is None

    def kill(self) -> None:
        self.process.send_signal(signal.SIGKILL)
        self.process.wait()

    def resident_bytes(self) -> int:
        """Of the memory that is in use now; ru_maxrss would only ever grow."""
        status = pathlib.Path(f"/proc/{self.process.pid}/status").read_text()
        return int(re.search(r"VmRSS:\s+(\d+) kB", status).group(1)) * 1024

    def threads(self) -> int:
        return len(os.listdir(f"/proc/{self.process.pid}/task"))


class Preloaded:
    """A library of this folder that a program is started with, and eight bytes that it and this process share.

    Attributes:
      environment: what the program is started with.
      state: the eight bytes, zero at first.
    """

    def __init__(self, library: str, variable: str, folder: str):
        """variable: by which the library learns where the bytes lie."""
        path = pathlib.Path(folder) / library
        path.write_bytes(bytes(8))
        with path.open("r+b") as file:
            self.state = mmap.mmap(file.fileno(), 8)
        self.environment = {"LD_PRELOAD": str(SERVER.parent / f"{library}.so"), variable: str(path)}


def emulated_rig(folder: str, speedup: float = 50) -> Program:
    """A rig that is so much faster than a real one; `ready` is the path of its gateway's configuration.

    Its fingers give 50 mm: at 20 mm/s a gateway that does not get the processor for 2.5 s / speedup lets them be pushed too far.
    """
    return Program([EMULATOR, "--dir", folder, "--speedup", speedup, "--powered", "--object", "lat20", "--no-camera", *SMALL], r"ready (\S+)")


class Server(Program):
    """A touchstone-server, or with `gateway` a touchstone-gateway, on a free port of this machine."""

    def __init__(self, *options: str, gateway: bool = False, max_files: int | None = None, environment: dict[str, str] | None = None,
                 listen: str = "127.0.0.1:0", memory_mib: int | None = None):
        """max_files: soft and hard limit of open files; memory_mib: of its address space; None: as this process has it."""
        # By a program, not by preexec_fn: that makes Python fork, which gRPC's fork handlers can hold up for good.
        limited: tuple[str, ...] = () if max_files is None else ("prlimit", f"--nofile={max_files}:{max_files}")
        if memory_mib is not None:
            limited += ("prlimit", f"--as={memory_mib << 20}")
        super().__init__([*limited, GATEWAY if gateway else SERVER, "--listen", listen, *SMALL, *options],
                         r"listening on (127\.0\.0\.1:\d+)", environment)

    @property
    def target(self) -> str:
        """ "127.0.0.1:port"."""
        return self.ready

    def channel(self, *options: tuple[str, int]) -> grpc.Channel:
        return own_channel(self.target, *options)


def own_channel(target: str, *options: tuple[str, int]) -> grpc.Channel:
    """A connection of its own, however many this process has to that server."""
    return grpc.insecure_channel(target, options=[("grpc.use_local_subchannel_pool", 1), ("grpc.enable_http_proxy", 0), *options])


def wait_until(done: Callable[[], bool]) -> bool:
    """True once it is done; False when the patience is over."""
    deadline = time.monotonic() + PATIENCE_S
    while not done():
        if time.monotonic() > deadline:
            return False
        time.sleep(0.001)
    return True


def create_model(channel: grpc.Channel, yaml: str) -> models_pb2.Model:
    call = channel.unary_unary("/touchstone.v1.Models/CreateModel", models_pb2.CreateModelRequest.SerializeToString,
                               models_pb2.Model.FromString)
    return call(models_pb2.CreateModelRequest(yaml=yaml), timeout=PATIENCE_S)


def _pages(call, request):
    while True:
        page = call(request, timeout=PATIENCE_S)
        yield page
        request.page_token = page.next_page_token
        if not request.page_token:
            return


def list_models(channel: grpc.Channel) -> list[models_pb2.Model]:
    call = channel.unary_unary("/touchstone.v1.Models/ListModels", models_pb2.ListModelsRequest.SerializeToString,
                               models_pb2.ListModelsResponse.FromString)
    return [model for page in _pages(call, models_pb2.ListModelsRequest()) for model in page.models]


def create_session(channel: grpc.Channel, name: str, csv: bytes, piece: int = 1 << 16) -> sessions_pb2.Session:
    call = channel.stream_unary("/touchstone.v1.Sessions/CreateSession", sessions_pb2.CreateSessionRequest.SerializeToString,
                                sessions_pb2.Session.FromString)
    return call((sessions_pb2.CreateSessionRequest(name=name if at == 0 else "", csv=csv[at:at + piece])
                 for at in range(0, len(csv), piece)), timeout=PATIENCE_S)


def list_sessions(channel: grpc.Channel) -> list[sessions_pb2.Session]:
    call = channel.unary_unary("/touchstone.v1.Sessions/ListSessions", sessions_pb2.ListSessionsRequest.SerializeToString,
                               sessions_pb2.ListSessionsResponse.FromString)
    return [session for page in _pages(call, sessions_pb2.ListSessionsRequest()) for session in page.sessions]


def export_session(channel: grpc.Channel, name: str) -> bytes:
    call = channel.unary_stream("/touchstone.v1.Sessions/ExportSession", sessions_pb2.ExportSessionRequest.SerializeToString,
                                sessions_pb2.ExportSessionResponse.FromString)
    return b"".join(part.csv for part in call(sessions_pb2.ExportSessionRequest(name=name), timeout=PATIENCE_S))


def describe(channel: grpc.Channel, timeout_s: float = PATIENCE_S) -> source_pb2.DescribeResponse:
    call = channel.unary_unary("/touchstone.v1.Source/Describe", source_pb2.DescribeRequest.SerializeToString,
                               source_pb2.DescribeResponse.FromString)
    return call(source_pb2.DescribeRequest(), timeout=timeout_s)


def open_stream(channel: grpc.Channel, request: source_pb2.StreamDatasetRequest, timeout_s: float):
    """The call of the dataset; iterate for its responses, cancel() to leave it."""
    call = channel.unary_stream("/touchstone.v1.Source/StreamDataset", source_pb2.StreamDatasetRequest.SerializeToString,
                                source_pb2.StreamDatasetResponse.FromString)
    return call(request, timeout=timeout_s)


def stream(channel: grpc.Channel, samples: int, batch_size: int = 4096, seed: int = 1, timeout_s: float = PATIENCE_S):
    """The call of a dataset of two objects; iterate for its responses, cancel() to leave it."""
    request = source_pb2.StreamDatasetRequest(batch_size=batch_size)
    request.spec.objects.extend(["lat00", "lat20"])
    request.spec.plan.sphere.SetInParent()
    request.spec.samples, request.spec.seed = samples, seed
    return open_stream(channel, request, timeout_s)


def model_yaml(name: str, radius_mm: float) -> str:
    return f"touchstone: model/1\nname: {name}\nend_effector: {{fingers: 3, spacing_mm: 30}}\neffects:\n  - tip_radius: {{radius_mm: {radius_mm}}}\n"


def measurements(touches: int, first: float) -> bytes:
    """A measurement file whose bytes depend on `first`, a time in us."""
    rows = [("touch,object,speed_mm_s,standoff_mm,target_x_mm,target_y_mm,target_z_mm,approach_x,approach_y,approach_z,"
             "lateral_x,lateral_y,lateral_z,t_l_us,t_m_us,t_r_us")]
    rows += [f"{k},lat00,20,60,0,0,0,0,0,-1,1,0,0,{first + k},0,{k}" for k in range(touches)]
    return ("\n".join(rows) + "\n").encode()


def scratch() -> tempfile.TemporaryDirectory:
    return tempfile.TemporaryDirectory(prefix="touchstone-faults-")
