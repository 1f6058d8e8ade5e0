"""Recordings of other tools as measured sets. The writers are those tools' own packages; what must come out is the set of touches
that was written into them."""

import dataclasses
import json
import math
import os
import subprocess
import sys

import pytest

import touchstone

np = pytest.importorskip("numpy")
pa = pytest.importorskip("pyarrow")
pq = pytest.importorskip("pyarrow.parquet")
yaml = pytest.importorskip("yaml")

from touchstone.formats import OpenQuestions, export, import_recording  # noqa: E402

_HEAD = {"touchstone": "mapping/1"}
_POSE = {"topic": "/tool", "position": "position", "unit": "m", "orientation": "orientation", "is": "start", "approach_axis": "+z",
         "lateral_axis": "+x"}
# What a log of touches has: per touch a start with the tool's pose, and an end with the fingers' times.
_LOG_MAP = {**_HEAD, "touches": "/touch", "object": {"field": "object"}, "contact_time": {"field": "times", "unit": "s"},
            "standoff": {"field": "standoff", "unit": "m"}, "speed": {"field": "speed", "unit": "m/s"}, "pose": _POSE}


@pytest.fixture(scope="module")
def run(server_program):
    def call(*words):
        return subprocess.run([server_program.parent / "touchstone", *map(str, words)], capture_output=True, text=True, check=False,
                              env={**os.environ, "TOUCHSTONE_PYTHON": sys.executable})
    return call


@pytest.fixture(scope="module")
def rows(run, tmp_path_factory):
    """A measured set, simulated: 384 touches of two objects."""
    folder = tmp_path_factory.mktemp("rows")
    assert run("plan", "lat20,lat00", "--plan", "faces", "-o", folder / "plan.csv").returncode == 0
    (folder / "noisy.yaml").write_text("touchstone: model/1\nname: noisy\nend_effector: {fingers: 3, spacing_mm: 30}\neffects:\n"
                                       "  - gaussian_noise: {sigma_us: 5000}\n  - missed_contact: {probability: 0.05}\n")
    done = run("touch", "--plan", folder / "plan.csv", "--model", folder / "noisy.yaml", "-o", folder / "set.csv")
    assert done.returncode == 0, done.stderr
    return touchstone.read_plan(folder / "set.csv")


def _quaternion(row, along_y=False):
    """x, y, z, w of the tool, whose z is the approach and whose x is the lateral vector; `along_y`: -y and z."""
    lateral, approach = row.command.lateral[0], row.command.approach[0]
    columns = [np.cross(-approach, lateral), -approach, lateral] if along_y else [lateral, np.cross(approach, lateral), approach]
    # The eigenvector of Bar-Itzhack's matrix, which has no case distinctions.
    m = np.stack(columns, 1)
    k = np.array([[m[0, 0] - m[1, 1] - m[2, 2], 0, 0, 0], [m[1, 0] + m[0, 1], m[1, 1] - m[0, 0] - m[2, 2], 0, 0],
                  [m[2, 0] + m[0, 2], m[2, 1] + m[1, 2], m[2, 2] - m[0, 0] - m[1, 1], 0],
                  [m[2, 1] - m[1, 2], m[0, 2] - m[2, 0], m[1, 0] - m[0, 1], np.trace(m)]])
    return np.linalg.eigh(k, "L")[1][:, -1]


def _start_m(row):
    return (row.command.target_mm[0] - row.command.approach[0] * row.command.standoff_mm[0]) / 1e3


def _same(path, rows, tolerance_us=1e-3, objects=True):
    """The set is that of the rows, within what the units' conversions leave."""
    found = touchstone.read_plan(path)
    assert len(found) == len(rows)
    for got, row in zip(found, rows):
        assert got.object == row.object or not objects
        for name in ("target_mm", "approach", "lateral", "standoff_mm", "speed_mm_s"):
            assert getattr(got.command, name) == pytest.approx(getattr(row.command, name), abs=1e-5), name
        assert got.time_us == pytest.approx(row.time_us, abs=tolerance_us, nan_ok=True)
    return found


def _write_map(path, entries):
    path.write_text(yaml.safe_dump(entries))
    return path


# --- MCAP

def _write_json_mcap(path, rows, with_times=True):
    writer_module = pytest.importorskip("mcap.writer")
    with open(path, "wb") as stream:
        writer = writer_module.Writer(stream)
        writer.start()
        schema = writer.register_schema(name="any", encoding="jsonschema", data=b'{"type": "object"}')
        topics = ("/tool", "/touch", "/joint_states")
        channels = {topic: writer.register_channel(topic=topic, message_encoding="json", schema_id=schema) for topic in topics}

        def add(topic, at_s, data):
            writer.add_message(channel_id=channels[topic], log_time=round(at_s * 1e9), publish_time=0, data=json.dumps(data).encode())

        for k, row in enumerate(rows):
            at_s = 1.7e9 + 8 * k
            x, y, z, w = map(float, _quaternion(row))
            add("/tool", at_s - 1, {"position": dict(zip("xyz", map(float, _start_m(row)))), "orientation": {"x": x, "y": y, "z": z, "w": w}})
            add("/joint_states", at_s - 0.5, {"position": [0.1 * k, 0.2, -math.pi / 2]})
            times = [None if math.isnan(time) else time / 1e6 for time in row.time_us]
            add("/touch", at_s, {"object": row.object, "standoff": float(row.command.standoff_mm[0]) / 1e3,
                                 "speed": float(row.command.speed_mm_s[0]) / 1e3, **({"times": times} if with_times else {})})
        writer.finish()


def test_an_mcap_of_json_is_the_set_that_was_written(rows, run, tmp_path):
    _write_json_mcap(tmp_path / "log.mcap", rows)
    mapping = {**_LOG_MAP, "joints": {"topic": "/joint_states", "field": "position", "unit": "rad"}}
    _write_map(tmp_path / "map.yaml", mapping)
    done = run("import", tmp_path / "log.mcap", "--map", tmp_path / "map.yaml", "-o", tmp_path / "set.csv")
    assert done.returncode == 0, done.stderr
    assert done.stderr == f"wrote {tmp_path / 'set.csv'} (384 touches)\n"
    found = _same(tmp_path / "set.csv", rows)
    assert [row.session_time_s for row in found] == [8 * k for k in range(len(rows))]
    assert found[3].command.covariates["cov_joint_2_deg"][0] == pytest.approx(-90)
    assert found[3].command.covariates["cov_joint_0_deg"][0] == pytest.approx(math.degrees(0.3))


def test_compare_reads_what_was_imported(rows, run, tmp_path):
    _write_json_mcap(tmp_path / "log.mcap", rows)
    import_recording(tmp_path / "log.mcap", tmp_path / "set.db", _LOG_MAP)
    done = run("compare", tmp_path / "set.db", "--model", "nominal", "--json", "-")
    assert done.returncode == 0, done.stderr
    # The noise that was planted is what compare finds.
    data = json.loads(done.stdout)["data"][0]
    assert data["unit"] == "us" and data["initial"]["rmse"] == pytest.approx(5000, rel=0.1)


def test_a_recording_of_this_program_comes_back(rows, run, tmp_path):
    touchstone.write_measurements(tmp_path / "set.csv", rows)
    export(tmp_path / "set.csv", tmp_path / "out", to="mcap")
    import_recording(tmp_path / "out/session.mcap", tmp_path / "again.csv", {
        **_HEAD, "touches": "/touch", "object": "object", "contact_time": {"field": "result.contact_time_s"},
        "target": {"field": "command.target_m", "unit": "m"}, "approach": {"field": "command.approach"}, "lateral": {"field": "command.lateral"},
        "standoff": {"field": "command.standoff_m"}, "speed": {"field": "command.speed_m_s"}})
    _same(tmp_path / "again.csv", rows)


@pytest.mark.parametrize("to", ["parquet", "lerobot"])
def test_covariates_come_back_from_an_export(rows, run, tmp_path, to):
    """Above all that an emulator made the touches."""
    emulated = {"cov_emulated": np.ones(1), "cov_room_degC": np.array([21.5])}
    made = [dataclasses.replace(row, command=dataclasses.replace(row.command, covariates=emulated)) for row in rows[:20]]
    touchstone.write_measurements(tmp_path / "set.csv", made)
    export(tmp_path / "set.csv", tmp_path / "out", to=to)
    done = run("import", tmp_path / "out", "-o", tmp_path / "again.csv")
    assert done.returncode == 0, done.stderr
    for row in _same(tmp_path / "again.csv", made):
        assert {name: values.tolist() for name, values in row.command.covariates.items()} == {"cov_emulated": [1], "cov_room_degC": [21.5]}


# --- ROS 2

_TOUCH_MSG = "string object\nfloat64 standoff\nfloat64 speed\nfloat64[] times\n"
_FINGERS = ("/finger_l", "/finger_m", "/finger_r")


def test_an_mcap_of_ros_2_is_the_set_that_was_written(rows, tmp_path):
    writer_module = pytest.importorskip("mcap_ros2.writer")
    with open(tmp_path / "log.mcap", "wb") as stream:
        writer = writer_module.Writer(stream)
        touch = writer.register_msgdef("lab_msgs/msg/Touch", _TOUCH_MSG)
        pose = writer.register_msgdef("geometry_msgs/msg/Pose", "geometry_msgs/Point position\ngeometry_msgs/Quaternion orientation\n" + "\n".join(
            [80 * "=", "MSG: geometry_msgs/Point", "float64 x\nfloat64 y\nfloat64 z", 80 * "=", "MSG: geometry_msgs/Quaternion",
             "float64 x\nfloat64 y\nfloat64 z\nfloat64 w"]))
        for k, row in enumerate(rows):
            at_ns = 10**9 * (1_700_000_000 + 8 * k)
            writer.write_message("/tool", pose, {"position": dict(zip("xyz", _start_m(row))), "orientation": dict(zip("xyzw", _quaternion(row)))},
                                 log_time=at_ns - 1, publish_time=at_ns - 1)
            writer.write_message("/touch", touch, {"object": row.object, "standoff": row.command.standoff_mm[0] / 1e3, "speed":
                                                   row.command.speed_mm_s[0] / 1e3, "times": [time / 1e6 for time in row.time_us]},
                                 log_time=at_ns, publish_time=at_ns)
        writer.finish()
    import_recording(tmp_path / "log.mcap", tmp_path / "set.csv", _LOG_MAP)
    _same(tmp_path / "set.csv", rows)


@pytest.mark.parametrize("storage", ["SQLITE3", "MCAP"])
def test_a_bag_with_a_topic_per_finger_is_the_set_that_was_written(rows, run, tmp_path, storage):
    """Standard messages only: poses, a start of each touch, switches that close and open again."""
    rosbag2 = pytest.importorskip("rosbags.rosbag2")
    typesys = pytest.importorskip("rosbags.typesys")
    store = typesys.get_typestore(typesys.Stores.ROS2_HUMBLE)
    pose, point, quaternion = (store.types[f"geometry_msgs/msg/{name}"] for name in ("Pose", "Point", "Quaternion"))
    string, boolean = store.types["std_msgs/msg/String"], store.types["std_msgs/msg/Bool"]
    messages = []
    for k, row in enumerate(rows):
        at_ns = 10**9 * (1_700_000_000 + 100 * k)
        messages += [(at_ns - 5, "/tool", pose(point(*_start_m(row)), quaternion(*_quaternion(row)))), (at_ns, "/start", string(row.object))]
        for finger, time_us in zip(_FINGERS, row.time_us):
            messages.append((at_ns - 3, finger, boolean(False)))
            if not math.isnan(time_us):
                messages += [(at_ns + round(time_us * 1e3), finger, boolean(True)), (at_ns + 90 * 10**9, finger, boolean(False))]
    with rosbag2.Writer(tmp_path / "bag", version=9, storage_plugin=rosbag2.StoragePlugin[storage]) as writer:
        connections = {}
        for at_ns, topic, message in sorted(messages, key=lambda entry: entry[0]):
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, message.__msgtype__, typestore=store)
            writer.write(connections[topic], at_ns, store.serialize_cdr(message, message.__msgtype__))
    _write_map(tmp_path / "map.yaml", {
        **_HEAD, "touches": "/start", "object": {"field": "data"}, "contacts": {"topics": list(_FINGERS), "field": "data"},
        "standoff": {"value": 60, "unit": "mm"}, "speed": {"value": 2, "unit": "cm/s"}, "pose": _POSE})
    done = run("import", tmp_path / "bag", "--map", tmp_path / "map.yaml", "-o", tmp_path / "set.csv", "--json")
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout) == {"file": str(tmp_path / "set.csv"), "touches": len(rows), "left_out": []}
    _same(tmp_path / "set.csv", rows, tolerance_us=2e-3)


# --- Tables

def test_what_was_exported_needs_no_mapping(rows, tmp_path):
    touchstone.write_measurements(tmp_path / "set.csv", rows)
    for to in ("parquet", "lerobot"):
        export(tmp_path / "set.csv", tmp_path / to, to=to)
        import_recording(tmp_path / to, tmp_path / f"{to}.csv")
        found = _same(tmp_path / f"{to}.csv", rows)
        assert [row.session_time_s for row in found] == [row.session_time_s for row in rows]


def test_a_table_of_other_names_is_mapped(rows, tmp_path):
    table = {"part": [row.object for row in rows], "q": [list(np.roll(_quaternion(row, along_y=True), 1)) for row in rows],
             "tip_mm": [list(row.command.target_mm[0]) for row in rows],
             **{f"touch{k}": [row.time_us[k] / 1e3 for row in rows] for k in range(3)}, "room": [21.5] * len(rows)}
    pq.write_table(pa.table(table), tmp_path / "log.parquet")
    import_recording(tmp_path / "log.parquet", tmp_path / "set.csv", {
        **_HEAD, "object": "part", "contact_time": {"fields": ["touch0", "touch1", "touch2"], "unit": "ms"},
        "standoff": {"value": 60, "unit": "mm"}, "speed": {"value": 0.02, "unit": "m/s"}, "covariates": {"room_degc": {"field": "room"}},
        "pose": {"position": "tip_mm", "orientation": "q", "order": "wxyz", "is": "target", "approach_axis": "-y", "lateral_axis": "+z"}})
    found = _same(tmp_path / "set.csv", rows)
    assert found[0].command.covariates["cov_room_degc"][0] == 21.5


# --- What is not said is asked

def test_everything_that_is_open_is_asked_at_once_with_candidates(rows, run, tmp_path):
    table = {"part": [row.object for row in rows], "label": ["a"] * len(rows), "q": [list(_quaternion(row)) for row in rows],
             "tip": [list(row.command.target_mm[0]) for row in rows], "contact_a": [list(row.time_us) for row in rows],
             "contact_b": [list(row.time_us) for row in rows], "velocity": [20.0] * len(rows)}
    pq.write_table(pa.table(table), tmp_path / "log.parquet")
    _write_map(tmp_path / "map.yaml", {**_HEAD, "pose": {"position": "tip", "orientation": "q"}, "speed": "velocity"})
    done = run("import", tmp_path / "log.parquet", "--map", tmp_path / "map.yaml", "-o", tmp_path / "set.csv")
    assert done.returncode == 2 and not (tmp_path / "set.csv").exists()
    for question in ("object: which field of the table is the name of the object? It may be part (text, for instance 'lat20')",
                     "contact_time: which field of the table is the fingers' contact times since the approach began? It may be contact_a (3 numbers",
                     "; contact_b (3 numbers",
                     "speed: in which unit is velocity, the commanded speed? It may be mm/s, m/s, cm/s",
                     "standoff: which field of the table",
                     "pose: in which unit is tip, the tool's position? It may be mm, cm, m, um",
                     "pose.order: in which order stand the four numbers of the quaternion? It may be xyzw, wxyz",
                     "pose.approach_axis: along which axis", "pose.lateral_axis: which axis", "pose.is: is the position the start"):
        assert question in done.stderr, question
    with pytest.raises(OpenQuestions) as asked:
        import_recording(tmp_path / "log.parquet", tmp_path / "set.csv", {**_HEAD, "speed": "velocity"})
    assert any(question.startswith("approach: which field of the table is the unit vector of the motion") for question in asked.value.questions)


def test_topics_are_asked_for(rows, tmp_path):
    _write_json_mcap(tmp_path / "log.mcap", rows)
    with pytest.raises(OpenQuestions, match=r"touches: which topic has one message per touch\? There are /tool \(any, 384 messages\)"):
        import_recording(tmp_path / "log.mcap", tmp_path / "set.csv")


def test_a_level_without_a_threshold_is_asked_for(rows, tmp_path):
    writer_module = pytest.importorskip("mcap.writer")
    with open(tmp_path / "log.mcap", "wb") as stream:
        writer = writer_module.Writer(stream)
        writer.start()
        schema = writer.register_schema(name="any", encoding="jsonschema", data=b"{}")
        for topic, data in (("/start", {"object": "lat20"}), ("/finger", {"force": 0.1}), ("/finger", {"force": 3.5})):
            channel = writer.register_channel(topic=topic, message_encoding="json", schema_id=schema)
            writer.add_message(channel_id=channel, log_time=1, publish_time=1, data=json.dumps(data).encode())
        writer.finish()
    with pytest.raises(OpenQuestions, match=r"contacts.threshold: above which value of force does a finger touch\? /finger has a number, 0.1 to 3.5"):
        import_recording(tmp_path / "log.mcap", tmp_path / "set.csv", {
            **_HEAD, "touches": "/start", "object": "object", "contacts": {"topics": ["/finger"], "field": "force"}})


@pytest.mark.parametrize("change, message", [
    ({"contact_tme": {"field": "times"}}, "unknown entry 'contact_tme', did you mean 'contact_time'?"),
    ({"touches": "/tuch"}, "the recording has no topic '/tuch', did you mean '/touch'?"),
    ({"contact_time": {"field": "tmes", "unit": "s"}}, "contact_time: topic /touch has no field 'tmes', did you mean 'times'?"),
    ({"contact_time": {"field": "times", "unit": "sec"}}, "contact_time: unit 'sec'"),
    ({"contact_time": {"feild": "times"}}, "contact_time: unknown entry 'feild', did you mean 'field'?"),
    ({"standoff": {"field": "times", "unit": "m"}}, "standoff: times has 3 numbers; 1 were expected"),
    ({"speed": {"field": "object", "unit": "m/s"}}, "field 'object' is text"),
    ({"pose": {**_POSE, "approach_axis": "z"}}, "pose.approach_axis: 'z'"),
    ({"pose": {**_POSE, "orientation": "position"}}, "has not 4 numbers"),
    ({"pose": {**_POSE, "lateral_axis": "+z"}}, "what the mapping makes of it is no measured set"),
    ({"speed": {"value": -20, "unit": "mm/s"}}, "what the mapping makes of it is no measured set"),
])
def test_a_wrong_mapping_is_named(rows, tmp_path, change, message):
    _write_json_mcap(tmp_path / "log.mcap", rows[:4])
    with pytest.raises(touchstone.InvalidRequest) as error:
        import_recording(tmp_path / "log.mcap", tmp_path / "set.csv", {**_LOG_MAP, **change})
    assert message in str(error.value)
    assert not (tmp_path / "set.csv").exists()


def test_a_message_without_a_pose_is_left_out_and_said(rows, tmp_path):
    """The first touch was logged before any joint state."""
    _write_json_mcap(tmp_path / "log.mcap", rows[:4])
    made = import_recording(tmp_path / "log.mcap", tmp_path / "set.csv", {
        **_LOG_MAP, "touches": "/tool", "object": {"topic": "/touch", "field": "object"}, "standoff": {"value": 60, "unit": "mm"},
        "speed": {"value": 20, "unit": "mm/s"}, "contact_time": {"topic": "/touch", "field": "times", "unit": "s"}})
    assert made.rows == 3 and made.left_out == ("message 0: object is missing",)


@pytest.mark.parametrize("words, message", [
    (["none.mcap", "-o", "a.csv"], "none.mcap is not there; an MCAP file, a ROS 2 bag"),
    (["log.parquet"], "-o/--out is required (see touchstone import --help)"),
    (["log.parquet", "-o", "a.txt"], "'a.txt' does not say the format; a name that ends in .csv or .db was expected"),
    (["log.parquet", "-o", "there.csv"], "there.csv exists; replace it with --force"),
    (["log.parquet", "-o", "a.csv", "--map", "log.parquet"], "is not UTF-8 text"),
    (["log.parquet", "-o", "a.csv", "--map", "bad.yaml"], "bad.yaml is no YAML"),
    (["log.parquet", "-o", "a.csv", "--map", "other.yaml"], "other.yaml: its first entry is None; 'touchstone: mapping/1' was expected"),
    (["cut.parquet", "-o", "a.csv"], "cut.parquet cannot be read as Parquet"),
    (["cut.mcap", "-o", "a.csv"], "cut.mcap is no whole MCAP file"),
    (["there.csv", "-o", "a.csv"], "there.csv: an MCAP file, a ROS 2 bag"),
])
def test_mistakes_are_named(run, rows, tmp_path, monkeypatch, words, message):
    monkeypatch.chdir(tmp_path)
    pq.write_table(pa.table({"a": [1.0, 2.0]}), "log.parquet")
    _write_json_mcap(tmp_path / "whole.mcap", rows[:3])
    for whole, cut in (("log.parquet", "cut.parquet"), ("whole.mcap", "cut.mcap")):
        data = (tmp_path / whole).read_bytes()
        (tmp_path / cut).write_bytes(data[: len(data) // 2])
    (tmp_path / "there.csv").write_text("mine")
    (tmp_path / "bad.yaml").write_text("a: [1,\n")
    (tmp_path / "other.yaml").write_text("a: 1\n")
    done = run("import", *words)
    assert done.returncode == 2, done.stderr
    assert done.stderr.startswith("touchstone: error: ") and message in done.stderr
    assert (tmp_path / "there.csv").read_text() == "mine" and not (tmp_path / "a.csv").exists()


def test_a_list_says_what_the_file_has(run, rows, tmp_path):
    _write_json_mcap(tmp_path / "log.mcap", rows[:3])
    done = run("import", tmp_path / "log.mcap", "--list")
    assert done.returncode == 0, done.stderr
    assert "/touch  any, 3 messages\n" in done.stdout and "  times     3 numbers, " in done.stdout
    told = json.loads(run("import", tmp_path / "log.mcap", "--list", "--json").stdout)
    assert [topic["name"] for topic in told["topics"]] == ["/tool", "/joint_states", "/touch"]


def test_the_completion_has_what_the_parser_has(run):
    from touchstone.formats.__main__ import import_parser

    completed = next(line for line in run("completion", "bash").stdout.splitlines() if line.strip().startswith("' import')"))
    options = completed.split("options='")[1].split("'")[0].split()
    assert sorted(options) == sorted(name for action in import_parser()._actions for name in action.option_strings)


@pytest.mark.parametrize("to", ["mcap", "parquet"])
def test_what_this_program_exported_needs_no_mapping_and_stays_emulated(tmp_path, server_program, monkeypatch, to):
    pytest.importorskip("mcap" if to == "mcap" else "pyarrow")
    monkeypatch.setenv("PATH", f"{server_program.parent}:{os.environ['PATH']}")
    command = touchstone.touches(target_mm=(0, 0, 70), approach=(0, 0, -1), lateral=(1, 0, 0), standoff_mm=60, cov_emulated=1.0)
    rows = [touchstone.Row(k, "lat20", command, (1000.0 + k, 2000.0, 3000.0), 8.0 * k) for k in range(3)]
    touchstone.write_measurements(tmp_path / "set.csv", rows)
    export(tmp_path / "set.csv", tmp_path / "out", to)
    [source] = (tmp_path / "out").rglob(f"*.{to}")
    assert import_recording(source, tmp_path / "back.csv").rows == 3
    found = _same(tmp_path / "back.csv", rows)
    assert all(row.command.covariates["cov_emulated"][0] == 1 for row in found)
    assert [row.session_time_s for row in found] == [0, 8, 16]


def test_an_exported_session_counts_its_rows_when_it_is_copied(tmp_path, server_program, monkeypatch):
    pytest.importorskip("h5py")
    monkeypatch.setenv("PATH", f"{server_program.parent}:{os.environ['PATH']}")
    command = touchstone.touches(target_mm=(0, 0, 70), approach=(0, 0, -1), lateral=(1, 0, 0), standoff_mm=60)
    touchstone.write_measurements(tmp_path / "set.csv", [touchstone.Row(k, "lat20", command, (1.0, 2.0, 3.0), 8.0 * k) for k in range(3)])
    assert export(tmp_path / "set.csv", tmp_path / "one", "hdf5").rows == 3
    assert export(tmp_path / "one/session.h5", tmp_path / "two", "hdf5").rows == 3
