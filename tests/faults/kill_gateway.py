"""The gateway of an emulated rig is killed at random points while a client touches through it: a touch that was acknowledged
is in the journal with the same times, and is never made a second time; the journal is whole."""

from __future__ import annotations

import contextlib
import csv
import math
import pathlib
import random
import re
import socket
import sqlite3
import threading
import time

import grpc

from programs import PATIENCE_S, Result, Server, emulated_rig, export_session, scratch, wait_until
from touchstone.v1 import control_pb2, control_pb2_grpc, rig_pb2, rig_pb2_grpc, source_pb2, source_pb2_grpc

COLUMNS = ("t_l_us", "t_m_us", "t_r_us")
# Of host time, so that a busy machine is not taken for a fault of the rig.
PATIENT = ("--arm-watchdog-hz", "1", "--arm-silence-s", "1.5", "--effector-silence-s", "3")


def dashboard_port(config: str) -> int:
    """Of the emulated arm of that configuration."""
    return int(re.search(r"dashboard_port = (\d+)", pathlib.Path(config).read_text()).group(1))


class Client:
    """What a client of a rig does, through one gateway process."""

    def __init__(self, channel: grpc.Channel, dashboard: int):
        self.source, self.control = source_pb2_grpc.SourceStub(channel), control_pb2_grpc.ControlStub(channel)
        self.rig = rig_pb2_grpc.RigStub(channel)
        self.dashboard, self.token = dashboard, ""

    def programs(self) -> int:
        return self.rig.GetRig(rig_pb2.GetRigRequest(), timeout=PATIENCE_S).arm.program_id

    def recover(self) -> None:
        """As a person does who finds the rig stopped: looks, unlocks at the pendant, resets; then the arm may move."""
        deadline = time.monotonic() + PATIENCE_S
        while time.monotonic() < deadline:
            state = self.control.GetState(control_pb2.GetStateRequest(), timeout=PATIENCE_S).state
            if state == control_pb2.SOURCE_STATE_IDLE:
                self.token = self.control.AcquireLease(
                    control_pb2.AcquireLeaseRequest(holder="a client", take=True), timeout=PATIENCE_S).token
                return
            if state == control_pb2.SOURCE_STATE_PROTECTIVE_STOP:
                with socket.create_connection(("127.0.0.1", self.dashboard), timeout=5) as pendant, pendant.makefile() as answers:
                    answers.readline()
                    pendant.sendall(b"unlock protective stop\n")
                    answers.readline()
            elif state == control_pb2.SOURCE_STATE_STOPPED:
                with contextlib.suppress(grpc.RpcError):  # the controller may have stopped in between
                    self.control.Reset(control_pb2.ResetRequest(holder="a person", reason="the gateway was killed"), timeout=PATIENCE_S)
            time.sleep(0.02)
        raise TimeoutError(f"the rig is not ready after {PATIENCE_S:.0f} s: {control_pb2.SourceState.Name(state)}")

    def touch(self, number: int) -> bytes:
        """The answer to touch `number`, which is the same touch whenever it is asked for."""
        request = source_pb2.TouchRequest(object="lat20", session="killed", touch_ids=[f"touch-{number}"], lease_token=self.token)
        touch, rng = request.touches.add(), random.Random(number)
        touch.target_m.x, touch.target_m.y, touch.target_m.z = rng.uniform(-0.02, 0.02), rng.uniform(-0.015, 0.015), 0.07
        touch.approach.z, touch.lateral.x, touch.standoff_m, touch.speed_m_s = -1, 1, 0.05, 0.02
        return self.source.Touch(request, timeout=PATIENCE_S).SerializeToString(deterministic=True)


def _touch_until_killed(gateway: Server, client: Client, answers: dict[int, bytes], result: Result) -> None:
    """Touches on from the first number that has no answer; renews the lease with every one, which takes a fraction of a second."""
    while gateway.alive():
        number = len(answers)
        try:
            answers[number] = client.touch(number)
            client.control.RenewLease(control_pb2.RenewLeaseRequest(token=client.token), timeout=PATIENCE_S)
        except grpc.RpcError as error:
            if error.code() in (grpc.StatusCode.UNAVAILABLE, grpc.StatusCode.CANCELLED):
                return
            result.expect(error.code() in (grpc.StatusCode.ABORTED, grpc.StatusCode.FAILED_PRECONDITION),
                          f"touch {number}: {error.code().name}: {error.details()}")
            with contextlib.suppress(grpc.RpcError):
                client.recover()


def _check(client: Client, answers: dict[int, bytes], numbers: list[int], result: Result) -> None:
    before = client.programs()
    for number in numbers:
        result.expect(client.touch(number) == answers[number], f"touch {number} was acknowledged, and is answered otherwise now")
        client.control.RenewLease(control_pb2.RenewLeaseRequest(token=client.token), timeout=PATIENCE_S)
    result.expect(client.programs() == before, f"the arm moved for touches that were acknowledged before: {numbers}")


def run(kills: int = 100, seed: int = 1) -> Result:
    """kills: how often the gateway is killed."""
    result, rng, answers = Result(), random.Random(seed), {}
    interrupted = recovered = 0
    with scratch() as folder, emulated_rig(folder) as emulator:
        config, dashboard = emulator.ready, dashboard_port(emulator.ready)
        for round_ in range(kills + 1):
            with Server("--config", config, *PATIENT, gateway=True) as gateway, gateway.channel() as channel:
                client = Client(channel, dashboard)
                grpc.channel_ready_future(channel).result(PATIENCE_S)
                client.recover()
                rig = client.rig.GetRig(rig_pb2.GetRigRequest(), timeout=PATIENCE_S)
                interrupted, recovered = interrupted + rig.interrupted_touches, recovered + rig.recovered_touches
                _check(client, answers, sorted(rng.sample(range(len(answers)), min(3, len(answers))) + list(answers)[-2:]), result)
                if round_ == kills or result.failures:
                    compare(export_session(channel, "killed"), answers, result)
                    break
                toucher = threading.Thread(target=_touch_until_killed, args=(gateway, client, answers, result))
                begun = len(answers)
                toucher.start()
                # Every other one after a touch, however long that takes here; the others also before or within the first.
                if round_ % 2:
                    wait_until(lambda: len(answers) > begun)  # noqa: B023 - not called after this round
                time.sleep(rng.uniform(0.0, 1.0))
                gateway.kill()
                toucher.join()
        with contextlib.closing(sqlite3.connect(f"file:{folder}/rig.db?mode=ro", uri=True)) as journal:
            found = journal.execute("PRAGMA integrity_check").fetchall()
        result.expect(found == [("ok",)], f"the journal's file is damaged: {found}")
    result.seen.append(f"{kills} kills; {len(answers)} touches were acknowledged and stayed as they were, {interrupted + recovered} kills "
                       f"came in the middle of one, of which the next start found {recovered} finished and their times at the end effector, and said "
                       f"of {interrupted} that they were interrupted (an emulated rig: nothing was measured)")
    result.expect(len(answers) >= kills // 2, f"only {len(answers)} touches were acknowledged in {kills} rounds")
    result.expect(interrupted + recovered >= kills // 10, f"only {interrupted + recovered} of {kills} kills came in the middle of a touch")
    return result


def _nanoseconds(unit_s: float, value) -> int | None:
    """Rounded, so that the file's decimals of microseconds do not count; None: the finger reported nothing."""
    return None if value == "" or math.isnan(float(value)) else round(1e9 * unit_s * float(value))


def compare(exported: bytes, answers: dict[int, bytes], result: Result) -> None:
    """The exported session holds the times of every acknowledged touch; one that was done and not acknowledged may be there too."""
    rows = list(csv.DictReader(exported.decode().splitlines()))
    # To the nanosecond: the file has microseconds with decimals.
    there = {tuple(_nanoseconds(1e-6, row[column]) for column in COLUMNS) for row in rows}
    for number, answer in answers.items():
        times = source_pb2.TouchResponse.FromString(answer).results[0].contact_time_s
        result.expect(tuple(_nanoseconds(1, time_s) for time_s in times) in there,
                      f"touch {number} was acknowledged, and its times are not in the exported session")
    result.expect(len(rows) >= len(answers), f"{len(answers)} touches were acknowledged, {len(rows)} are in the exported session")
