"""A rig without a mount command: a person changes the object, and is asked to only once the arm is at home."""
import json
import math
import pathlib
import re
import subprocess
import sys

import pytest

from test_rig_commands import BIN, PATIENCE_S, PYTHON_CLIENT, SPEEDUP, start_gateway, touchstone, wait_for_line

pytestmark = pytest.mark.xdist_group("rig_commands")
HOME_RAD = (0, -1.5708, -0.9599, -2.1817, 1.5708, 0)


@pytest.fixture
def rig(tmp_path):
    """The address of a gateway that changes no object by itself; lat20 lies there as in its mesh file."""
    emulator = subprocess.Popen([BIN / "touchstone-rig-emulator", "--dir", tmp_path / "rig", "--speedup", str(SPEEDUP), "--no-camera",
                                 "--object", "lat20", "--finger-give-mm", "1000"],
                                stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
    gateway = None
    try:
        config = pathlib.Path(wait_for_line(emulator))
        config.write_text(re.sub("^mount_command = .*\n", "", config.read_text(), flags=re.MULTILINE))
        gateway, address = start_gateway("--config", config)
        touchstone("rig", "mount", "lat20", server=address)
        yield address
    finally:
        for process in filter(None, (gateway, emulator)):
            process.terminate()
            process.wait(timeout=PATIENCE_S)


def at_home(rig):
    joints = json.loads(touchstone("rig", "status", "--json", server=rig))["rig"]["arm"]["joints_rad"]
    return all(math.isclose(joint, home, abs_tol=1e-3) for joint, home in zip(joints, HOME_RAD))


def touch_from_above(rig):
    touchstone("touch", "lat20", "--approach", "0,0,-1", server=rig)
    assert not at_home(rig), "after a touch the arm stands over the fixture"


def read_until(stream, words):
    text = ""
    while words not in text:
        letter = stream.read(1)
        assert letter, text
        text += letter
    return text


@pytest.fixture
def side_plan(tmp_path):
    """One touch of lat20 that needs another of its faces up."""
    path = tmp_path / "side.csv"
    path.write_text("touch,object,speed_mm_s,standoff_mm,target_x_mm,target_y_mm,target_z_mm,approach_x,approach_y,approach_z,"
                    "lateral_x,lateral_y,lateral_z\n0,lat20,20,100,0,0,0,-1,0,0,0,1,0\n")
    return path


def test_a_refused_touch_leaves_the_arm_at_home(rig, side_plan):
    touch_from_above(rig)
    refused = " ".join(touchstone("touch", "--plan", side_plan, server=rig, code=4).split())
    assert "put 'lat20' there with its face +x up" in refused
    assert at_home(rig)


def test_a_run_asks_for_the_object_with_the_arm_at_home(rig, side_plan, tmp_path):
    touch_from_above(rig)
    run = subprocess.Popen([BIN / "touchstone", "rig", "run", side_plan, "-o", tmp_path / "set.csv", "--server", rig],
                           stdin=subprocess.PIPE, stderr=subprocess.PIPE, stdout=subprocess.DEVNULL, text=True)
    assert "its face +x points up" in read_until(run.stderr, "press Enter")
    assert at_home(rig)
    run.communicate("\n", timeout=PATIENCE_S)
    assert run.returncode == 0


def test_python_asks_for_the_object_with_the_arm_at_home(rig):
    sys.path.insert(0, str(PYTHON_CLIENT))
    touchstone_module = pytest.importorskip("touchstone")
    touch_from_above(rig)
    asked = []
    with touchstone_module.connect(rig) as client:
        client.rig.prepare("lat20", "+x", lambda thing, face: asked.append((thing, face, at_home(rig))))
    assert asked == [("lat20", "+x", True)]


def test_what_was_made_before_comes_back_without_motion_and_is_called_so(rig, tmp_path):
    touchstone("plan", "lat20", "--plan", "faces", "--samples-per-face", "1", "--rounds", "2", "-o", tmp_path / "all.csv")
    head, *lines = (tmp_path / "all.csv").read_text().splitlines()
    z = head.split(",").index("approach_z")
    plan = tmp_path / "plan.csv"
    plan.write_text("\n".join([head, *(line for line in lines if float(line.split(",")[z]) < -0.9)]) + "\n")
    words = ["rig", "run", plan, "--server", rig]
    touchstone(*words, "-o", tmp_path / "monday.csv", "--session", "plan")
    touchstone("rig", "mount", "lat20", "+x", server=rig)

    def state():
        rig_state = json.loads(touchstone("rig", "status", "--json", server=rig))["rig"]
        return rig_state["up_face"], rig_state["arm"]["program_id"]

    before = state()
    for command in ([*words, "-o", tmp_path / "tuesday.csv", "--json"], ["touch", "--plan", plan, "--session", "plan", "-o",
                                                                        tmp_path / "wednesday.csv", "--server", rig]):
        again = subprocess.run([BIN / "touchstone", *command], capture_output=True, text=True, timeout=PATIENCE_S,
                               stdin=subprocess.DEVNULL, check=False)
        assert again.returncode == 0, again.stderr
        said = " ".join(again.stderr.split())
        assert "2 of 2 touches come from the gateway's journal, made at 20" in said
        assert "nothing was moved; --session NAME makes new ones" in said and "2 touches were made now" not in said
        if "--json" in command:
            counts = json.loads(again.stdout)
            assert (counts["made_now"], counts["from_journal"]) == (0, 2)
    assert state() == before, "neither the arm nor what lies on the fixture moved"
    held = subprocess.run([BIN / "touchstone", *words, "-o", tmp_path / "monday.db", "--session", "plan"], capture_output=True,
                          text=True, timeout=PATIENCE_S, check=True)
    assert "has 2 of 2 touches already; nothing was moved" in " ".join(held.stderr.split())


def test_a_stop_of_a_source_without_a_rig_names_no_command_that_is_refused_there():
    server = subprocess.Popen([BIN / "touchstone-server", "--listen", "127.0.0.1:0"], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
    try:
        address = wait_for_line(server)
        stopped = subprocess.run([BIN / "touchstone", "rig", "stop", "--server", address], capture_output=True, text=True, timeout=PATIENCE_S,
                                 check=True)
        assert "virtual source, which has no rig" in stopped.stderr and "rig reset" not in stopped.stderr
        assert "virtual source, which has no rig" in touchstone("rig", "reset", "--reason", "a test", server=address, code=4)
    finally:
        server.terminate()
        server.wait(timeout=PATIENCE_S)


def test_what_a_rig_does_not_offer_is_said_with_who_does(rig):
    refused = touchstone("effects", server=rig, code=4)
    assert "models, effects and diagnoses are a touchstone-server's" in " ".join(refused.split())
