"""touchstone rig, session and the Python client against a gateway in front of the emulated rig, as people use them."""
import contextlib
import csv
import json
import os
import pathlib
import signal
import sqlite3
import subprocess
import sys
import time

import pytest

ROOT = pathlib.Path(__file__).resolve().parents[2]
BIN = pathlib.Path(os.environ.get("TOUCHSTONE_BIN", ROOT / "build/release/bin"))
PYTHON_CLIENT = ROOT / "client/python"
HIDDEN_OFFSETS_MM = (0.2, 0.0, -0.2)
HIDDEN_SIGMA_US = 2000
SPEEDUP = 20
# The emulated rig exists once.
pytestmark = pytest.mark.xdist_group("rig_commands")
DONE = 3  # stage of a touch in a journal
PATIENCE_S = 120


def wait_for_line(process):
    line = process.stdout.readline()
    assert line, f"{process.args[0]} ended with {process.wait()}"
    return line.split()[-1]


def start_gateway(*arguments):
    process = subprocess.Popen([BIN / "touchstone-gateway", *arguments, "--listen", "127.0.0.1:0"],
                               stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
    return process, wait_for_line(process)


@contextlib.contextmanager
def emulated_rig(folder, speedup, *flags):
    """The address of a gateway in front of an emulated rig that puts its objects down by itself.

    Its fingers give way without end: on its clock a gateway that waits for the processor comes late to stop the arm.
    """
    emulator = subprocess.Popen([BIN / "touchstone-rig-emulator", "--dir", folder, "--speedup", str(speedup), "--finger-give-mm",
                                 "1000", *flags],
                                stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
    gateway = None
    try:
        gateway, address = start_gateway("--config", wait_for_line(emulator))
        yield address
    finally:
        for process in filter(None, (gateway, emulator)):
            process.terminate()
            process.wait(timeout=PATIENCE_S)


@pytest.fixture(scope="module")
def rig(tmp_path_factory):
    with emulated_rig(tmp_path_factory.mktemp("rig"), SPEEDUP, "--no-camera", "--seed", "7", "--sigma-us", str(HIDDEN_SIGMA_US), "--hide",
                      "finger_length.offset_mm=" + ",".join(map(str, HIDDEN_OFFSETS_MM))) as address:
        yield address


def touchstone(*words, server=None, code=0):
    """What the command says on stdout; its stderr is in the assertion's message."""
    command = [BIN / "touchstone", *words, *(["--server", server] if server else [])]
    result = subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE_S, stdin=subprocess.DEVNULL, check=False)
    assert result.returncode == code, (command, result.returncode, result.stderr)
    return result.stdout if code == 0 else result.stderr


def touches_of(journal, session):
    """(id, stage) of each touch, in the order in which it was begun."""
    with sqlite3.connect(f"file:{journal}?mode=ro", uri=True) as database:
        return database.execute("select touch.id, stage from touch join session using (session_id) "
                                "where session.name = ? order by touch_id", (session,)).fetchall()


@pytest.fixture(scope="module")
def plan(tmp_path_factory):
    """A plan of 24 touches of lat20 on its upper face and one on its side."""
    folder = tmp_path_factory.mktemp("plan")
    touchstone("plan", "lat20", "--plan", "faces", "--samples-per-face", "4", "--rounds", "6", "-o", folder / "all.csv")
    with open(folder / "all.csv", newline="") as file:
        head, *rows = csv.reader(file)
    z = head.index("approach_z")
    top = [row for row in rows if float(row[z]) < -0.9][:24]
    side = [row for row in rows if abs(float(row[z])) < 0.5][:1]
    assert len(top) == 24 and len(side) == 1
    with open(folder / "plan.csv", "w", newline="") as file:
        csv.writer(file).writerows([head, *top, *side])
    return folder / "plan.csv"


def journal_of_gateway(rig):
    """Ids of the touches of every session that the source itself has, through its own list."""
    sessions = json.loads(touchstone("session", "list", "--json", server=rig))["sessions"]
    return {entry["name"]: entry for entry in sessions}


@pytest.fixture
def rig_with_camera(tmp_path):
    with emulated_rig(tmp_path / "rig", SPEEDUP, "--power-off") as address:
        yield address


def test_status_shows_every_part_and_that_it_is_emulated(rig_with_camera):
    rig = rig_with_camera
    # Looking powers nothing on, nor does a motion that is asked for.
    assert "POWER_OFF" in touchstone("rig", "status", server=rig)
    assert "rig power-on" in " ".join(touchstone("rig", "home", server=rig, code=4).split())
    assert "POWER_OFF" in touchstone("rig", "status", server=rig)
    touchstone("rig", "power-on", server=rig)
    assert "RUNNING" in touchstone("rig", "status", server=rig)
    touchstone("rig", "home", server=rig)
    text = touchstone("rig", "status", server=rig)
    assert "emulator" in text and "not safety-rated" in text and "RUNNING" in text
    state = json.loads(touchstone("rig", "status", "--json", server=rig))["rig"]
    assert state["arm"]["connected"] and state["effector"]["connected"] and state["camera"]["connected"]
    assert state["fingers"] == 3 and state["time_scale"] == SPEEDUP


def test_commands_without_a_gateway_say_what_is_missing():
    assert "--server is missing" in touchstone("rig", "status", code=2)


def test_mount_stop_and_home(rig):
    touchstone("rig", "mount", "lat20", "-x", server=rig)
    touchstone("rig", "stop", "--reason", "a test", server=rig)
    state = json.loads(touchstone("rig", "status", "--json", server=rig))
    assert state["state"]["state"] == "stopped"
    assert (state["rig"]["object"], state["rig"]["up_face"]) == ("lat20", "-x")
    # The stop holds until somebody releases it.
    assert "touchstone rig reset" in " ".join(touchstone("rig", "home", server=rig, code=4).split())
    assert json.loads(touchstone("rig", "status", "--json", server=rig))["state"]["state"] == "stopped"
    touchstone("rig", "reset", "--reason", "a test", server=rig)
    touchstone("rig", "home", server=rig)
    assert json.loads(touchstone("rig", "status", "--json", server=rig))["state"]["state"] == "idle"
    assert "lat21" in touchstone("rig", "mount", "lat21", server=rig, code=2)


def test_a_dry_run_checks_and_draws_and_moves_nothing(rig, plan, tmp_path):
    before = json.loads(touchstone("rig", "status", "--json", server=rig))["rig"]["arm"]["program_id"]
    checked = json.loads(touchstone("rig", "dry-run", plan, "-o", tmp_path / "path.svg", "--json", server=rig))
    assert checked["touches"] == checked["possible"] == 25
    assert {group["up_face"]: group["touches"] for group in checked["groups"]}["+z"] == 24
    assert (tmp_path / "path.svg").read_text().startswith("<svg")
    assert json.loads(touchstone("rig", "status", "--json", server=rig))["rig"]["arm"]["program_id"] == before


@pytest.fixture(scope="module")
def session(rig, plan, stop_and_wait, tmp_path_factory):
    """The journal of a run that was interrupted by Ctrl-C, then killed, and then went on to its end."""
    journal = tmp_path_factory.mktemp("session") / "session.db"
    words = [BIN / "touchstone", "rig", "run", plan, "-o", journal, "--session", "monday", "--server", rig]
    # In the background of a shell an interrupt is ignored, and programs inherit that.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    for signal_number, enough in ((signal.SIGINT, 3), (signal.SIGKILL, 8)):
        process = subprocess.Popen(words, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True,
                                   stdin=subprocess.DEVNULL)
        deadline = time.monotonic() + PATIENCE_S
        # It stands still while it is looked at: a busy machine would let it end meanwhile.
        while process.poll() is None and time.monotonic() < deadline:
            stop_and_wait(process)
            interrupt = journal.exists() and done(journal) >= enough
            if interrupt:
                process.send_signal(signal_number)
            process.send_signal(signal.SIGCONT)
            if interrupt:
                break
            time.sleep(0.05)  # a fifth of a touch
        process.communicate(timeout=PATIENCE_S)
        assert process.returncode != 0, "it was done before it could be interrupted"
        if signal_number == signal.SIGINT:  # Ctrl-C stops the rig, which holds
            touchstone("rig", "reset", "--reason", "a test", server=rig)
    result = subprocess.run(words, capture_output=True, text=True, timeout=PATIENCE_S, stdin=subprocess.DEVNULL, check=False)
    assert result.returncode == 0, result.stderr
    return journal


def done(journal):
    try:
        return sum(stage == DONE for _, stage in touches_of(journal, "monday"))
    except sqlite3.OperationalError:  # being made
        return 0


def test_an_interrupted_run_goes_on_and_makes_no_touch_twice(rig, session):
    here = touches_of(session, "monday")
    assert len(here) == 25 and len({identity for identity, _ in here}) == 25
    assert all(stage == DONE for _, stage in here)
    there = journal_of_gateway(rig)["monday"]
    assert there["touches"] == 25, "the source itself made every touch once"


def test_a_changed_plan_is_no_resumption(rig, plan, session, tmp_path):
    changed = tmp_path / "changed.csv"
    lines = plan.read_text().splitlines()
    speed = lines[0].split(",").index("speed_mm_s")
    words = lines[1].split(",")
    words[speed] = "10"
    changed.write_text("\n".join([lines[0], ",".join(words), *lines[2:]]) + "\n")
    message = touchstone("rig", "run", changed, "-o", session, "--session", "monday", server=rig, code=2)
    assert "the plan was changed" in message


def rows_of(path):
    """What was commanded and measured, whatever the touches' numbers."""
    with open(path, newline="") as file:
        return sorted(tuple(value for name, value in row.items() if name != "touch") for row in csv.DictReader(file))


def times_of(path):
    with open(path, newline="") as file:
        return sorted((row["t_l_us"], row["t_m_us"], row["t_r_us"]) for row in csv.DictReader(file))


def test_export_and_import_give_the_same_set(session, tmp_path):
    touchstone("session", "export", session, "-o", tmp_path / "a.csv")
    touchstone("session", "export", session, "-o", tmp_path / "a.h5")
    touchstone("session", "import", tmp_path / "a.csv", "-o", tmp_path / "again.db", "--session", "csv")
    touchstone("session", "import", tmp_path / "a.h5", "-o", tmp_path / "again.db", "--session", "hdf5")
    listed = json.loads(touchstone("session", "list", tmp_path / "again.db", "--json"))["sessions"]
    assert {entry["name"]: entry["done"] for entry in listed} == {"csv": 25, "hdf5": 25}
    for name in ("csv", "hdf5"):
        touchstone("session", "export", tmp_path / "again.db", name, "-o", tmp_path / f"{name}.csv")
        assert rows_of(tmp_path / f"{name}.csv") == rows_of(tmp_path / "a.csv")
    touchstone("session", "delete", tmp_path / "again.db", "csv")
    listed = json.loads(touchstone("session", "list", tmp_path / "again.db", "--json"))["sessions"]
    assert [entry["name"] for entry in listed] == ["hdf5"]


def test_a_recorded_session_is_a_source_again(session, plan, tmp_path):
    gateway, address = start_gateway("--replay", str(session))
    try:
        touchstone("touch", "lat20", "--plan", plan, "-o", tmp_path / "again.csv", server=address)
        refused = touchstone("touch", "lat20", "--approach", "0,0,-1", server=address, code=2)
        assert "no such touch" in refused
        assert "recorded" in touchstone("rig", "status", server=address, code=4)
    finally:
        gateway.terminate()
        assert gateway.wait(timeout=PATIENCE_S) == 0
    touchstone("session", "export", session, "-o", tmp_path / "first.csv")
    # Every repeat once, in whatever order the two were touched.
    assert sorted(times_of(tmp_path / "again.csv")) == sorted(times_of(tmp_path / "first.csv"))


def test_a_flat_face_gives_back_the_hidden_offsets_and_noise(rig, tmp_path):
    found = json.loads(touchstone("rig", "calibrate", "flat", "lat20", "--touches", "60", "--session", "flat", "-o",
                                  tmp_path / "flat.yaml", "--json", server=rig))
    assert found["touches"] + found["left_out"] == 60
    for hidden, offset, error in zip(HIDDEN_OFFSETS_MM, found["offset_mm"], found["offset_std_error_mm"]):
        assert 0 < error < 0.02
        assert abs(offset - hidden) < 5 * error, found
    assert abs(found["sigma_us"] - HIDDEN_SIGMA_US) < 5 * found["sigma_std_error_us"], found
    assert "finger_length" in (tmp_path / "flat.yaml").read_text()


def test_the_python_script_makes_the_same_touches(rig, plan, tmp_path):
    pytest.importorskip("numpy")
    if not (PYTHON_CLIENT / "touchstone/v1").is_dir():
        pytest.skip("client/python/generate was not run")
    script = [sys.executable, PYTHON_CLIENT / "examples/rig_run.py", rig, plan, "tuesday", tmp_path / "set.csv"]
    for _ in range(2):
        subprocess.run(script, check=True, timeout=PATIENCE_S, stdin=subprocess.DEVNULL,
                       env={**os.environ, "PYTHONPATH": str(PYTHON_CLIENT)})
        with open(tmp_path / "set.csv", newline="") as file:
            assert len(list(csv.DictReader(file))) == 25
        assert journal_of_gateway(rig)["tuesday"]["touches"] == 25, "run again, nothing is touched again"
