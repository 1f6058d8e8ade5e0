"""The disk fails at the n-th call that a running server or gateway makes for one request, for every n: the request is refused with the
file and the reason, what was acknowledged stays, and the same request once more, on a disk that is well again, is done."""

from __future__ import annotations

import contextlib
import errno
import os
import pathlib

import grpc

import kill_gateway
from failing_files import FAULTS, FailingDisk, Fault
from programs import (
    PATIENCE_S,
    Result,
    Server,
    create_model,
    create_session,
    emulated_rig,
    export_session,
    list_models,
    list_sessions,
    measurements,
    model_yaml,
    scratch,
)
from touchstone.v1 import control_pb2, sessions_pb2

LIVING = tuple(fault for fault in FAULTS if not fault.kills)
REMOVAL = Fault("cannot be removed", 4, errno.EIO)
CODES = (grpc.StatusCode.UNAVAILABLE, grpc.StatusCode.RESOURCE_EXHAUSTED, grpc.StatusCode.DATA_LOSS)


def _says_why(error: grpc.RpcError, fault: Fault, folder: str) -> str:
    """What is wrong with an error; empty: nothing."""
    if error.code() not in CODES:
        return f"{error.code().name}: {error.details()}"
    details = error.details() or ""
    named = folder in details and (os.strerror(fault.error) in details or "full" in details)
    return "" if named else f"it does not name the file and why: {details}"


def delete_session(channel: grpc.Channel, name: str) -> None:
    call = channel.unary_unary("/touchstone.v1.Sessions/DeleteSession", sessions_pb2.DeleteSessionRequest.SerializeToString,
                               sessions_pb2.DeleteSessionResponse.FromString)
    call(sessions_pb2.DeleteSessionRequest(name=name), timeout=PATIENCE_S)


def _stored(channel: grpc.Channel) -> dict[str, object]:
    found: dict[str, object] = {f"session {session.name}": export_session(channel, session.name) for session in list_sessions(channel)}
    return found | {f"model {model.name}": model.hash for model in list_models(channel)}


def run_server(faults: tuple[Fault, ...], stride: int, result: Result) -> str:
    csv = measurements(2000, 5.0)
    requests = {
        "CreateSession": (lambda channel: create_session(channel, "new", csv), "session new", False),
        "CreateModel": (lambda channel: create_model(channel, model_yaml("new", 2)), "model new", False),
        "DeleteSession": (lambda channel: delete_session(channel, "new"), "session new", True),
    }
    runs = refused = 0
    with scratch() as scratched:
        folder = pathlib.Path(scratched).resolve()
        for name, (request, made, removes) in requests.items():
            for fault in ((REMOVAL,) if removes else ()) + faults:
                for call in range(1, 200, stride):
                    stores = folder / f"{runs}"
                    stores.mkdir()
                    disk = FailingDisk(stores, folder / "plan")
                    options = ("--sessions-dir", str(stores), "--models-dir", str(stores))
                    where = f"{name}, {fault.name} at call {call}"
                    with Server(*options, environment=disk.environment) as server, server.channel() as channel:
                        if removes:
                            create_session(channel, "new", csv)
                        before = _stored(channel)
                        disk.set(fault, call)
                        done = True
                        try:
                            request(channel)
                        except grpc.RpcError as error:
                            done = False
                            wrong = _says_why(error, fault, str(stores))
                            result.expect(not wrong, f"{where} ({disk.plan.failed.decode()}): {wrong}")
                        reached = disk.reached()
                        disk.plan.fails_at = 0
                        result.expect(done or not fault.passes, f"{where}: it is refused")
                        now = _stored(channel)
                        result.expect(not done or (made in now) != removes, f"{where}: it is acknowledged and not done")
                        result.expect(done or now == before or set(now) ^ set(before) == {made}, f"{where}: something else changed")
                        try:
                            request(channel)
                        except grpc.RpcError as error:
                            result.expect(removes and made not in now and error.code() == grpc.StatusCode.NOT_FOUND,
                                          f"{where}: once more: {error.code().name}: {error.details()}")
                        result.expect((made in _stored(channel)) != removes, f"{where}: once more, and it is not done")
                    with Server(*options) as server, server.channel() as channel:
                        result.expect((made in _stored(channel)) != removes, f"{where}: another server does not find it as it was")
                    runs, refused = runs + 1, refused + (not done)
                    if not reached or result.failures:
                        break
    return f"a server's stores: {runs} failing calls, {refused} requests were refused and done when they came again"


def run_gateway(faults: tuple[Fault, ...], stride: int, result: Result) -> str:
    """Touches of an emulated rig, whose gateway's journal and audit log fail."""
    answers: dict[int, bytes] = {}
    kept = refused = runs = 0
    with scratch() as scratched, emulated_rig(scratched) as emulator:
        folder = pathlib.Path(scratched).resolve()
        config = emulator.ready
        with scratch() as plan_folder:
            disk = FailingDisk(folder, pathlib.Path(plan_folder) / "plan")
            with Server("--config", config, *kill_gateway.PATIENT, gateway=True, environment=disk.environment) as gateway, \
                    gateway.channel() as channel:
                client = kill_gateway.Client(channel, kill_gateway.dashboard_port(config))
                grpc.channel_ready_future(channel).result(PATIENCE_S)
                client.recover()
                answers[0] = client.touch(0)
                for fault in faults:
                    for call in range(1, 400, stride):
                        number = len(answers)
                        where = f"touch {number}, {fault.name} at call {call}"
                        client.control.RenewLease(control_pb2.RenewLeaseRequest(token=client.token), timeout=PATIENCE_S)
                        disk.set(fault, call)
                        made = False
                        try:
                            answers[number] = client.touch(number)
                        except grpc.RpcError as error:
                            made = "was made, but its result" in (error.details() or "")
                            wrong = _says_why(error, fault, str(folder))
                            result.expect(not wrong, f"{where} ({disk.plan.failed.decode()}): {wrong}")
                            result.expect(not fault.passes, f"{where}: it is refused: {error.details()}")
                            refused, kept = refused + 1, kept + made
                        reached = disk.reached()
                        disk.plan.fails_at = 0
                        before = client.programs()
                        with contextlib.suppress(grpc.RpcError):
                            client.recover()
                        again = client.touch(number)
                        result.expect(answers.setdefault(number, again) == again, f"{where}: it is answered otherwise now")
                        result.expect(not made or client.programs() == before, f"{where}: it was made twice")
                        runs += 1
                        if not reached or result.failures:
                            break
                kill_gateway.compare(export_session(channel, "killed"), answers, result)
            with Server("--config", config, *kill_gateway.PATIENT, gateway=True) as gateway, gateway.channel() as channel:
                kill_gateway.compare(export_session(channel, "killed"), answers, result)
    return (f"a gateway's journal: {runs} touches with a failing call, {refused} were refused, {kept} of them after they were made, and none was "
            "lost or made twice (an emulated rig: nothing was measured)")


def run(faults: tuple[Fault, ...] = LIVING, stride: int = 1) -> Result:
    """stride: of the calls that fail."""
    result = Result()
    result.seen.append(run_server(faults, stride, result))
    result.seen.append(run_gateway(faults, stride, result))
    return result
