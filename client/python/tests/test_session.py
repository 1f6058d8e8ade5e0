"""Sessions, leases and measurement files. The source that moves something is a fake made here; the real one is tested end
to end elsewhere."""

import concurrent.futures
import os
import re
import time

import grpc
import numpy as np
import pytest

import touchstone
from touchstone import lease
from touchstone.v1 import (
    control_pb2,
    control_pb2_grpc,
    rig_pb2,
    rig_pb2_grpc,
    sessions_pb2,
    sessions_pb2_grpc,
    source_pb2,
    source_pb2_grpc,
    types_pb2,
)

_PLAN = """touch,object,speed_mm_s,standoff_mm,target_x_mm,target_y_mm,target_z_mm,approach_x,approach_y,approach_z,\
lateral_x,lateral_y,lateral_z,cov_temperature
0,lat20,20,60,0,0,0,0,0,-1,1,0,0,21.5
7,lat20,20,60,0.1,0,0,-1,0,0,0,1,0,
8,lat00,20,60,0,0,0,0,0,-1,1,0,0,22
"""


def _eventually(done):
    end = time.monotonic() + 60
    while not done():
        assert time.monotonic() < end, "this never came true"
        time.sleep(0.005)


class FakeRig(source_pb2_grpc.SourceServicer, control_pb2_grpc.ControlServicer, rig_pb2_grpc.RigServicer,
              sessions_pb2_grpc.SessionsServicer):
    """Grants leases, answers touches under their ids, and fails where it is told to."""

    def __init__(self):
        self.window_s, self.holder, self.epoch, self.renewals, self.released = 30.0, "", 0, 0, 0
        self.failures, self.stale, self.state = [], False, control_pb2.SOURCE_STATE_IDLE
        self.touches, self.mounted, self.stopped, self.resets = [], ("", rig_pb2.UP_FACE_UNSPECIFIED), [], []
        self.emulated, self.homes, self.csv = False, 0, ""
        self.server = grpc.server(concurrent.futures.ThreadPoolExecutor(8))
        for add in (source_pb2_grpc.add_SourceServicer_to_server, control_pb2_grpc.add_ControlServicer_to_server,
                    rig_pb2_grpc.add_RigServicer_to_server, sessions_pb2_grpc.add_SessionsServicer_to_server):
            add(self, self.server)
        self.target = f"127.0.0.1:{self.server.add_insecure_port('127.0.0.1:0')}"
        self.server.start()

    def _lease(self):
        return control_pb2.Lease(token=f"token{self.epoch}", holder=self.holder, epoch=self.epoch, window_s=self.window_s)

    def Describe(self, request, context):
        return source_pb2.DescribeResponse(kind=source_pb2.SOURCE_KIND_PHYSICAL, version="0", lease_required=True)

    def AcquireLease(self, request, context):
        if self.holder and not request.take and not self.stale:
            context.abort(grpc.StatusCode.FAILED_PRECONDITION, f"the lease is held by '{self.holder}'.")
        self.holder, self.epoch, self.stale = request.holder, self.epoch + 1, False
        return self._lease()

    def RenewLease(self, request, context):
        self.renewals += 1
        if self.stale or request.token != f"token{self.epoch}":
            context.abort(grpc.StatusCode.ABORTED, f"this lease is stale: '{self.holder}' holds epoch {self.epoch} now")
        return self._lease()

    def ReleaseLease(self, request, context):
        self.holder, self.released = "", self.released + 1
        return control_pb2.ReleaseLeaseResponse()

    def GetState(self, request, context):
        return control_pb2.State(state=self.state, lease_holder=self.holder, lease_epoch=self.epoch)

    def Stop(self, request, context):
        self.stopped.append(request.reason)
        return control_pb2.StopResponse(aborted_touches=1, standstill=True)

    def Reset(self, request, context):
        self.resets.append((request.holder, request.reason))
        self.state = control_pb2.SOURCE_STATE_IDLE
        return control_pb2.State(state=self.state)

    def PowerOn(self, request, context):
        self.powered_with = request.lease_token
        return self.GetRig(request, context)

    def Touch(self, request, context):
        self.touches.append((request.session, list(request.touch_ids), request.lease_token))
        if self.failures:
            context.abort(self.failures.pop(0), "the arm is not there")
        if request.lease_token != f"token{self.epoch}" or self.stale:
            context.abort(grpc.StatusCode.ABORTED, "this lease is stale")
        results = [types_pb2.TouchResult(
            descriptor_s=[0, 1e-3, 2e-3], contact_time_s=[1, 1.001, 1.002], complete=True,
            measured=types_pb2.Measured(touch_id=i, session=request.session, session_time_s=12.5),
        ) for i in request.touch_ids or [""]]
        return source_pb2.TouchResponse(results=results)

    def GetRig(self, request, context):
        return rig_pb2.RigState(object=self.mounted[0], up_face=self.mounted[1], emulated=self.emulated)

    def Home(self, request, context):
        self.homes += 1
        return self.GetRig(request, context)

    def ExportSession(self, request, context):
        if not self.csv:
            context.abort(grpc.StatusCode.NOT_FOUND, f"there is no session '{request.name}'")
        for at in range(0, len(self.csv), 100):
            yield sessions_pb2.ExportSessionResponse(csv=self.csv[at : at + 100].encode())

    def MountObject(self, request, context):
        self.mounted = (request.object, request.up_face)
        return self.GetRig(request, context)

    def CheckTouches(self, request, context):
        checks = [rig_pb2.TouchCheck(possible=t.target_m.x == 0 or t.approach.x != 0,
                                     up_face=rig_pb2.UP_FACE_PLUS_Z if t.approach.z else rig_pb2.UP_FACE_PLUS_X) for t in request.touches]
        return rig_pb2.CheckTouchesResponse(checks=checks)


@pytest.fixture
def rig():
    running = FakeRig()
    yield running
    running.server.stop(None).wait()


@pytest.fixture
def rig_client(rig):
    with touchstone.connect(rig.target) as connected:
        yield connected


@pytest.fixture
def plan(tmp_path):
    path = tmp_path / "plan.csv"
    path.write_text(_PLAN)
    return path


def test_a_plan_is_read_with_its_numbers_and_covariates(plan):
    rows = touchstone.read_plan(plan)
    assert [(row.touch, row.object) for row in rows] == [(0, "lat20"), (7, "lat20"), (8, "lat00")]
    assert rows[1].command.approach.tolist() == [[-1, 0, 0]]
    assert rows[0].command.covariates["cov_temperature"].tolist() == [21.5]
    assert not rows[1].command.covariates and rows[1].time_us == ()


@pytest.mark.parametrize("old, new, words", [
    ("speed_mm_s", "speed", "plan.csv:1: column 'speed_mm_s' is missing"),
    ("\n7,lat20,20", "\n7,lat20,fast", "plan.csv:3: speed_mm_s is 'fast'"),
    ("\n8,lat00,20,60", "\n8,lat00,20", "plan.csv:4: 13 fields, but the header has 14"),
])
def test_a_wrong_plan_is_refused_with_its_place(plan, old, new, words):
    plan.write_text(_PLAN.replace(old, new, 1))
    with pytest.raises(touchstone.InvalidRequest, match=words):
        touchstone.read_plan(plan)


def test_a_session_at_a_virtual_source_gives_a_measurement_file(client, plan, tmp_path):
    with client.session("monday") as session:
        rows = [session.touch(row) for row in touchstone.read_plan(plan)]
    direct = client.touch("lat20", touchstone.read_plan(plan)[0].command)
    assert rows[0].time_us == pytest.approx(direct["contact_time_us"][0])
    path = tmp_path / "set.csv"
    touchstone.write_measurements(path, rows)
    again = touchstone.read_plan(path)
    assert [row.touch for row in again] == [0, 7, 8]
    for before, after in zip(rows, again):
        np.testing.assert_allclose(after.time_us, before.time_us, rtol=1e-14)
        np.testing.assert_array_equal(after.command.approach, before.command.approach)
    assert path.read_text().splitlines()[0].endswith("t_l_us,t_m_us,t_r_us,cov_temperature")


def test_a_virtual_source_grants_no_lease_and_needs_none(client):
    with client.lease() as lease:
        assert lease.token == "" and lease.lost is None


def test_a_touch_acquires_a_lease_and_gives_it_back(rig, rig_client, plan):
    rig_client.touch("lat20", touchstone.read_plan(plan)[0].command)
    assert rig.touches[0][2] == "token1"
    assert rig.released == 1 and rig.holder == ""


def test_a_session_holds_one_lease_and_sends_ids_that_repeat(rig, rig_client, plan):
    for _ in range(2):
        with rig_client.session("monday") as session:
            rows = [session.touch(row) for row in touchstone.read_plan(plan)]
            assert re.fullmatch(rf"\S+@\S+ \S+ {os.getpid()}", rig.holder), "person, program and process"
    ids = [touch[1][0] for touch in rig.touches]
    assert ids == ["monday/lat20/0", "monday/lat20/7", "monday/lat00/8"] * 2
    assert {touch[0] for touch in rig.touches} == {"monday"}
    assert rig.epoch == 2 and rig.released == 2
    assert rows[0].session_time_s == 12.5 and rows[0].time_us[1] == pytest.approx(1001000)


def test_ids_stay_within_128_bytes():
    assert len(touchstone.touch_id("s" * 64, "ö" * 60, 2**64 - 1).encode()) <= 128


def test_who_holds_the_lease_is_told_and_how_to_take_it(rig, rig_client, monkeypatch):
    monkeypatch.setattr(lease, "_HOLDER_MAY_BE_GONE_S", 0.0)
    rig.holder = "ana@bench2"
    with pytest.raises(touchstone.Refused, match=r"ana@bench2.*take=True"):
        with rig_client.lease():
            pass
    with rig_client.lease(take=True):
        assert rig.holder != "ana@bench2"


def test_a_lease_is_renewed_until_it_is_taken(rig, rig_client, plan, monkeypatch):
    # Every 0.03 s, and yet no machine is too slow to do it within the window.
    monkeypatch.setattr(lease, "_RENEWALS_A_WINDOW", 1000)
    with rig_client.session() as session:
        _eventually(lambda: rig.renewals >= 5)
        rig.holder, rig.epoch = "ben@desk", rig.epoch + 1
        _eventually(lambda: rig_client._leases[-1].lost is not None)
        with pytest.raises(touchstone.Refused, match="ben@desk"):
            session.touch(touchstone.read_plan(plan)[0])
    assert rig.touches == [] and rig.released == 0


def test_a_lost_source_is_asked_for_the_same_touch(rig, rig_client, plan):
    rig.failures = [grpc.StatusCode.UNAVAILABLE] * 2
    with rig_client.session() as session:
        session.touch(touchstone.read_plan(plan)[0])
    assert [touch[1] for touch in rig.touches] == [["default/lat20/0"]] * 3


def test_a_restarted_source_is_asked_with_a_new_lease(rig, rig_client, plan):
    rig.failures = [grpc.StatusCode.UNAVAILABLE]
    with rig_client.session() as session:
        rig.stale = True  # as after a restart: it knows of no lease
        session.touch(touchstone.read_plan(plan)[0])
    assert [touch[2] for touch in rig.touches] == ["token1", "token2"]


def test_a_stop_of_somebody_else_is_not_ended(rig, rig_client, plan):
    rig.failures = [grpc.StatusCode.UNAVAILABLE]
    rig.state = control_pb2.SOURCE_STATE_STOPPED
    with rig_client.session() as session:
        with pytest.raises(touchstone.Refused, match="Somebody stopped the source"):
            session.touch(touchstone.read_plan(plan)[0])
    assert rig.epoch == 1


def test_a_person_releases_the_stop(rig, rig_client):
    rig.state = control_pb2.SOURCE_STATE_STOPPED
    assert rig_client.rig.reset("cable freed").state == control_pb2.SOURCE_STATE_IDLE
    assert [reason for _, reason in rig.resets] == ["cable freed"] and rig.resets[0][0]


def test_a_source_without_a_rig_has_no_stop_to_release(client):
    with pytest.raises(touchstone.Refused, match="is a virtual source, which has no rig"):
        client.rig.reset("cable freed")


def test_power_on_carries_a_lease(rig, rig_client):
    rig_client.rig.power_on()
    assert rig.powered_with == "token1"


def test_a_touch_without_an_id_is_not_repeated(rig, rig_client, plan):
    rig.failures = [grpc.StatusCode.UNAVAILABLE]
    with pytest.raises(touchstone.SourceUnreachable):
        rig_client.touch("lat20", touchstone.read_plan(plan)[0].command)
    assert len(rig.touches) == 1


def test_an_interrupted_session_stops_the_motion(rig, rig_client):
    with pytest.raises(KeyboardInterrupt):
        with rig_client.session("monday"):
            raise KeyboardInterrupt
    assert len(rig.stopped) == 1 and "monday" in rig.stopped[0]


def test_rows_are_grouped_by_object_and_up_face(rig, rig_client, plan):
    groups = rig_client.rig.groups(touchstone.read_plan(plan))
    assert list(groups) == [("lat20", "+z"), ("lat20", "+x"), ("lat00", "+z")]
    rig.mounted = ("lat00", rig_pb2.UP_FACE_PLUS_Z)
    assert next(iter(rig_client.rig.groups(touchstone.read_plan(plan)))) == ("lat00", "+z")


def test_a_person_is_asked_only_for_what_does_not_lie_so(rig, rig_client):
    asked = []
    for _ in range(2):
        rig_client.rig.prepare("lat20", "-x", lambda *what: asked.append((*what, rig.homes)))
    assert asked == [("lat20", "-x", 1)], "the arm went home first"
    assert rig.mounted == ("lat20", rig_pb2.UP_FACE_MINUS_X)
    with pytest.raises(touchstone.InvalidRequest, match="up_face"):
        rig_client.rig.mount("lat20", "up")


def test_impossible_touches_are_refused_by_name_unless_they_may_be_left_out(rig_client, plan):
    plan.write_text(_PLAN.replace("\n8,lat00,20,60,0,", "\n8,lat00,20,60,5,"))
    rows = touchstone.read_plan(plan)
    with pytest.raises(touchstone.Refused, match=r"1 of 3 touches are impossible here: touch 8 of lat00: .*skip_impossible=True"):
        rig_client.rig.groups(rows)
    with pytest.warns(UserWarning, match="touch 8 of lat00"):
        groups = rig_client.rig.groups(rows, skip_impossible=True)
    assert [row.touch for part in groups.values() for row in part] == [0, 7]
    with pytest.raises(touchstone.Refused, match="Nothing was moved; change the plan"):
        rig_client.rig.groups(rows[2:], skip_impossible=True)


def test_nothing_is_not_written_over_a_set(tmp_path):
    (tmp_path / "set.csv").write_text("kept")
    with pytest.raises(touchstone.InvalidRequest, match="no touch to write"):
        touchstone.write_measurements(tmp_path / "set.csv", [])
    assert (tmp_path / "set.csv").read_text() == "kept"


def test_rows_of_an_emulated_rig_say_so_and_those_of_a_real_one_do_not(rig, rig_client, plan):
    rows = touchstone.read_plan(plan)
    for rig.emulated in (True, False):
        with rig_client.session("monday") as session:
            [row] = [session.touch(row) for row in rows[:1]]
            # A plan that was made from an emulated set makes no emulated touches.
            again = session.touch(row)
        assert [("cov_emulated" in made.command.covariates) for made in (row, again)] == [rig.emulated] * 2
        assert row.command.covariates["cov_temperature"].tolist() == [21.5]


def test_what_a_session_has_is_told_from_what_is_still_to_be_made(rig, rig_client, plan, tmp_path):
    rows = touchstone.read_plan(plan)
    with rig_client.session("monday") as session:
        assert session.made_before(rows) == ([], rows)
        made = [session.touch(row) for row in rows[:2]]
        touchstone.write_measurements(tmp_path / "set.csv", made)
        rig.csv = (tmp_path / "set.csv").read_text()
        before, left = session.made_before(rows)
    assert [row.touch for row in before] == [0, 7] and [row.touch for row in left] == [8]
    assert before[0].time_us == made[0].time_us


def test_the_example_runs(rig, plan, tmp_path):
    import os
    import pathlib
    import subprocess
    import sys

    example = pathlib.Path(__file__).resolve().parents[1] / "examples" / "rig_run.py"
    package = os.path.dirname(os.path.dirname(touchstone.__file__))
    done = subprocess.run(
        [sys.executable, "-W", "error", example, rig.target, plan, "monday", tmp_path / "set.csv"], input="\n" * 10,
        capture_output=True, text=True, timeout=120, env={**os.environ, "PYTHONPATH": package}, check=False,
    )
    assert done.returncode == 0, done.stderr
    assert "Put lat20 on the fixture with its face +z up" in done.stdout
    assert len(touchstone.read_plan(tmp_path / "set.csv")) == 3
