"""Pictures and time series of the emulated rig, as people get them: rig photos, rig run --series, HDF5, MCAP."""
import csv
import json
import math
import pathlib
import subprocess
import sys

import pytest

from test_rig_commands import PATIENCE_S, PYTHON_CLIENT, emulated_rig, touchstone

SPEEDUP = 10
# The emulated rig exists once.
pytestmark = pytest.mark.xdist_group("rig_truth")


@pytest.fixture(scope="module")
def rig(tmp_path_factory):
    with emulated_rig(tmp_path_factory.mktemp("rig"), SPEEDUP, "--seed", "3") as address:
        yield address


def rows_of(path):
    with open(path, newline="") as file:
        return list(csv.DictReader(file))


def test_photos_are_an_image_set_with_both_poses(rig, tmp_path):
    folder = tmp_path / "photos"
    command = ["rig", "photos", "lat20", "-o", folder, "--sequence", "seed", "--turns", "1", "--image", "64x48"]
    first = json.loads(touchstone(*command, "--json", server=rig))
    rows = rows_of(folder / "images.csv")
    assert first["kept"] == 0 and len(rows) == len(first["files"]) == 12 - first["left_out"] > 0
    assert {row["file"] for row in rows} == {pathlib.Path(path).name for path in first["files"]}
    for row in rows:
        assert (folder / row["file"]).read_bytes().startswith(b"\x89PNG") and row["object"] == "lat20"
        for point in ("eye", "at"):
            off_mm = math.dist(*([float(row[f"{prefix}{point}_{axis}_mm"]) for axis in "xyz"] for prefix in ("", "measured_")))
            assert off_mm < 1.5, (row["file"], point)
        assert 0 < math.dist(*([float(row[f"{prefix}eye_{axis}_mm"]) for axis in "xyz"] for prefix in ("", "measured_"))) < 0.5
    assert float(rows[0]["session_time_s"]) == 0 and float(rows[-1]["session_time_s"]) > 0
    assert "width_px: 64, height_px: 48, fx_px: 57.9" in (folder / "camera.yaml").read_text()

    # Run again, only what is missing is taken.
    (folder / rows[0]["file"]).unlink()
    again = json.loads(touchstone(*command, "--json", server=rig))
    # (From where the arm is now it may reach more of the views than then.)
    assert again["kept"] == len(rows) - 1 and set(first["files"]) <= set(again["files"])
    assert len(rows_of(folder / "images.csv")) == len(again["files"])
    assert "another size" in touchstone(*command[:-1], "32x32", server=rig, code=4)


def test_a_run_with_series_becomes_hdf5_and_mcap(rig, tmp_path):
    h5py = pytest.importorskip("h5py")
    reader = pytest.importorskip("mcap.reader")
    if not (PYTHON_CLIENT / "touchstone/v1").is_dir():
        pytest.skip("client/python/generate was not run")
    plan, journal = tmp_path / "plan.csv", tmp_path / "session.db"
    touchstone("plan", "lat20", "--plan", "faces", "--samples-per-face", "1", "--rounds", "1", "-o", plan)
    made = json.loads(touchstone("rig", "run", plan, "-o", journal, "--series", "--skip-impossible", "--json", server=rig))
    assert made["touches"] > 0
    touchstone("session", "export", journal, "-o", tmp_path / "session.h5")
    with h5py.File(tmp_path / "session.h5") as file:
        states, times = file["series/states"][...], file["series/time_s"][...]
        forces, joints = file["series/tip_force_n"][...], file["series/joints_rad"][...]
        contacts = file["contact_time_s"][...]
        ids = [identity.decode() for identity in file["id"][...]]
        heights = file["series/base_from_tip_position_m"][...]
    assert len(states) == made["touches"] and all(states >= 5)
    assert len(times) == states.sum() and forces.shape == (len(times), 3) and joints.shape == (len(times), 6)
    begin = 0
    for row, count in enumerate(int(count) for count in states):
        own = slice(begin, begin + count)
        begin += count
        assert all(times[own][1:] > times[own][:-1])
        assert -0.1 < times[own][0] < 0.5 and times[own][-1] > max(filter(math.isfinite, contacts[row])) - 0.1
        assert heights[own][0].tolist() != heights[own][-1].tolist()

    done = subprocess.run([sys.executable, "-m", "touchstone.mcap", tmp_path / "session.h5", "-o", tmp_path / "session.mcap"],
                          capture_output=True, text=True, timeout=PATIENCE_S, check=False)
    assert done.returncode == 0, done.stderr
    from touchstone.v1 import types_pb2
    found = {}
    with open(tmp_path / "session.mcap", "rb") as stream:
        for _, channel, message in reader.make_reader(stream).iter_messages():
            found.setdefault(channel.topic, []).append(message.data)
    touches = [types_pb2.RecordedTouch.FromString(data) for data in found["/touch"]]
    assert [touch.result.measured.touch_id for touch in touches] == ids
    for touch, row in zip(touches, contacts):
        assert [*map(repr, touch.result.contact_time_s)] == [*map(repr, map(float, row))]
    assert len(found["/arm_state"]) == len(times)

    # Imported again, the series is the same.
    touchstone("session", "import", tmp_path / "session.h5", "-o", tmp_path / "again.db")
    touchstone("session", "export", tmp_path / "again.db", "-o", tmp_path / "again.h5")
    with h5py.File(tmp_path / "again.h5") as file:
        assert (file["series/states"][...] == states).all() and (file["series/tip_force_n"][...] == forces).all()
        assert (file["series/time_s"][...] == times).all()


def test_the_python_client_gets_a_series_where_it_asks_for_one(rig, tmp_path):
    package = pytest.importorskip("touchstone")
    plan = tmp_path / "plan.csv"
    touchstone("plan", "lat20", "--plan", "faces", "--samples-per-face", "1", "--rounds", "1", "-o", plan)
    client = package.connect(rig)
    rows = package.read_plan(plan)
    with client.session("python") as session:
        for (thing, face), group in client.rig.groups(rows).items():
            client.rig.prepare(thing, face)
            done = session.touch(group[0], series=True)
            series = done.result.measured[0].series
            count = len(series.time_s)
            assert count >= 5 and len(series.joints_rad) == len(series.base_from_tip) == 6 * count
            assert len(series.tip_force_n) == 3 * count and max(done.time_us) * 1e-6 < series.time_s[-1] + 0.1
            assert not session.touch(group[0]).result.measured[0].HasField("series")
            break
