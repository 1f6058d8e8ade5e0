"""Sessions as MCAP files, read again with the mcap package's own reader."""

import base64
import json
import math
import subprocess
import sys

import pytest

import touchstone
from touchstone.v1 import types_pb2

# Installed by deploy/common.sh for the tests; part of touchstone[mcap] for users.
h5py = pytest.importorskip("h5py")
np = pytest.importorskip("numpy")
reader = pytest.importorskip("mcap.reader")

from touchstone import mcap as touchstone_mcap  # noqa: E402

_PNG = b"\x89PNG\r\n\x1a\n with \0 bytes"


def _write_session(path, series=True, format="touchstone: session/1"):
    """An HDF5 file as `touchstone session export` writes it: two touches, the second with a finger that reported nothing,
    one picture."""
    command = types_pb2.CommandedTouch(standoff_m=0.06, speed_m_s=0.02)
    command.target_m.z, command.approach.z, command.lateral.x = 0.07, -1, 1
    commands = [command.SerializeToString(), b""]
    with h5py.File(path, "w") as file:
        text = h5py.string_dtype("utf-8", 64)
        file["session/format"] = np.array([format], text)
        file["session/name"], file["session/source"] = np.array(["monday"], text), np.array(["a rig"], text)
        file["session/calibration"] = np.array(["unit: m"], text)
        file["session/fingers_touches_images"] = np.array([3, 2, 1], np.uint64)
        file["id"] = np.array(["monday/lat20/0", "monday/lat20/1"], text)
        file["object"], file["placement"] = np.array(["lat20"] * 2, text), np.array(["+z", "-x"], text)
        file["command"] = np.frombuffer(b"".join(commands), np.uint8)
        file["command_offset"] = np.array([0, len(commands[0]), len(commands[0])], np.uint64)
        file["contact_time_s"] = [[1.5, 1.25, 1.75], [1.0, 1.5, math.nan]]
        position = np.arange(18.0).reshape(2, 3, 3)
        position[1, 2] = math.nan
        file["base_from_tip_position_m"] = position
        file["base_from_tip_rotation_rad"] = np.where(np.isnan(position), math.nan, [0, 0, math.pi / 2])
        file["start_unix_s"], file["session_time_s"] = [1.7e9, 1.7e9 + 8], [0.0, 8.0]
        for name in ("measured_speed_m_s", "time_uncertainty_s", "synchronisation_uncertainty_s", "effector_drift"):
            file[name] = [0.02, 0.03]
        file["recovered"] = np.array([0, 1], np.uint64)
        file["images/png"] = np.frombuffer(_PNG, np.uint8)
        file["images/png_offset"] = np.array([0, len(_PNG)], np.uint64)
        file["images/base_from_camera_m_rad"] = [[0.1, 0.2, 0.3, 0, 0, 0]]
        file["images/measured_base_from_camera_m_rad"] = [[0.11, 0.2, 0.3, 0, 0, math.pi]]
        file["images/unix_s"] = [1.7e9 + 20]
        if series:
            file["series/states"] = np.array([0, 3], np.uint64)
            file["series/time_s"] = [0.0, 0.002, 0.004]
            file["series/joints_rad"] = np.arange(18.0).reshape(3, 6)
            file["series/base_from_tip_position_m"] = np.arange(9.0).reshape(3, 3)
            file["series/base_from_tip_rotation_rad"] = np.zeros((3, 3))
            file["series/tip_force_n"] = np.arange(9.0).reshape(3, 3) - 4


def _messages(path):
    found = {}
    with open(path, "rb") as stream:
        for schema, channel, message in reader.make_reader(stream).iter_messages():
            found.setdefault(channel.topic, []).append((schema, channel, message))
    return found


def _decoded(schema, data):
    """As a stranger would: with nothing but the schema that the file has."""
    from google.protobuf import descriptor_pb2, descriptor_pool, message_factory

    files = descriptor_pb2.FileDescriptorSet.FromString(schema.data)
    pool, left = descriptor_pool.DescriptorPool(), {file.name: file for file in files.file}

    def add(name):
        if name in left:
            file = left.pop(name)
            for dependency in file.dependency:
                add(dependency)
            pool.Add(file)

    for name in list(left):
        add(name)
    descriptor = pool.FindMessageTypeByName(schema.name)
    if hasattr(message_factory, "GetMessageClass"):
        made = message_factory.GetMessageClass(descriptor)
    else:  # protobuf before 4.22
        made = message_factory.MessageFactory(pool).GetPrototype(descriptor)  # type: ignore[attr-defined]  # as said
    return made.FromString(data)


def test_every_touch_is_there_and_its_schema_says_how_to_read_it(tmp_path):
    _write_session(tmp_path / "a.h5")
    counts = touchstone_mcap.export(tmp_path / "a.h5", tmp_path / "a.mcap")
    assert counts == {"/touch": 2, "/arm_state": 3, "/tip": 5 + 3, "/camera": 1, "/camera_pose": 1}
    found = _messages(tmp_path / "a.mcap")
    touches = [_decoded(schema, message.data) for schema, _, message in found["/touch"]]
    assert [touch.result.measured.touch_id for touch in touches] == ["monday/lat20/0", "monday/lat20/1"]
    assert [touch.object for touch in touches] == ["lat20", "lat20"]
    assert [touch.up_face for touch in touches] == ["+z", "-x"]
    assert touches[0].command.target_m.z == 0.07 and touches[0].command.speed_m_s == 0.02
    assert list(touches[0].result.contact_time_s) == [1.5, 1.25, 1.75]
    assert list(touches[0].result.descriptor_s) == [0.25, 0, 0.5]
    assert touches[0].result.complete and not touches[1].result.complete
    assert math.isnan(touches[1].result.contact_time_s[2])
    assert touches[1].result.measured.recovered and touches[1].result.measured.session == "monday"
    assert touches[1].result.measured.base_from_tip_at_contact[1].position_m.z == 14
    assert not touches[1].result.measured.base_from_tip_at_contact[2].HasField("position_m")
    assert [message.log_time for _, _, message in found["/touch"]] == [1_700_000_000 * 10**9, 1_700_000_008 * 10**9]
    for schema, channel, _ in found["/touch"]:
        assert (schema.encoding, channel.message_encoding, schema.name) == (
            "protobuf", "protobuf", "touchstone.v1.RecordedTouch")


def test_states_are_at_their_times(tmp_path):
    _write_session(tmp_path / "a.h5")
    touchstone_mcap.export(tmp_path / "a.h5", tmp_path / "a.mcap")
    found = _messages(tmp_path / "a.mcap")["/arm_state"]
    states = [_decoded(schema, message.data) for schema, _, message in found]
    assert [state.touch_id for state in states] == ["monday/lat20/1"] * 3
    assert [state.time_s for state in states] == [0, 0.002, 0.004]
    assert list(states[2].joints_rad) == [12, 13, 14, 15, 16, 17]
    assert states[1].tip_force_n.y == 0 and states[1].base_from_tip.position_m.x == 3
    begin = 1_700_000_008 * 10**9
    for k, (_, _, message) in enumerate(found):
        assert message.log_time == pytest.approx(begin + k * 2_000_000, abs=200)


def test_pictures_and_poses_are_foxgloves_own_messages(tmp_path):
    _write_session(tmp_path / "a.h5", series=False)
    touchstone_mcap.export(tmp_path / "a.h5", tmp_path / "a.mcap")
    found = _messages(tmp_path / "a.mcap")
    assert "/arm_state" not in found
    schema, channel, message = found["/camera"][0]
    assert (schema.name, schema.encoding, channel.message_encoding) == ("foxglove.CompressedImage", "jsonschema", "json")
    assert json.loads(schema.data)["properties"]["data"]["contentEncoding"] == "base64"
    image = json.loads(message.data)
    assert base64.b64decode(image["data"]) == _PNG and image["format"] == "png"
    assert image["timestamp"] == {"sec": 1_700_000_020, "nsec": 0}
    schema, _, message = found["/camera_pose"][0]
    assert schema.name == "foxglove.PoseInFrame"
    pose = json.loads(message.data)["pose"]
    assert pose["position"] == {"x": 0.11, "y": 0.2, "z": 0.3}  # the measured one
    assert pose["orientation"]["z"] == pytest.approx(1) and pose["orientation"]["w"] == pytest.approx(0, abs=1e-12)
    tips = [json.loads(message.data) for _, _, message in found["/tip"]]
    assert len(tips) == 5
    assert tips[0]["pose"]["orientation"]["z"] == pytest.approx(math.sin(math.pi / 4))


def _complaint(*words):
    """What the command says of bad input, for which it has the exit status of every command."""
    done = subprocess.run([sys.executable, "-m", "touchstone.mcap", *words], capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 2 and not done.stdout
    return done.stderr


def test_what_is_no_session_is_refused_and_nothing_is_left(tmp_path):
    (tmp_path / "a.h5").write_bytes(b"no HDF5")
    assert "touchstone session export" in _complaint(tmp_path / "a.h5", "-o", tmp_path / "a.mcap")
    _write_session(tmp_path / "b.h5", format="touchstone: session/9")
    assert "session/9" in _complaint(tmp_path / "b.h5", "-o", tmp_path / "a.mcap")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.h5", "b.h5"]


def test_a_file_that_exists_is_kept_without_force(tmp_path):
    _write_session(tmp_path / "a.h5")
    (tmp_path / "a.mcap").write_text("precious")
    arguments = [str(tmp_path / "a.h5"), "-o", str(tmp_path / "a.mcap")]
    assert "--force" in _complaint(*arguments) and (tmp_path / "a.mcap").read_text() == "precious"
    touchstone_mcap.main([*arguments, "--force"])
    assert len(_messages(tmp_path / "a.mcap")["/touch"]) == 2
    assert touchstone.__version__


def _from_elsewhere(path, name, make):
    with h5py.File(path, "r+") as file:
        del file[name]
        make(file)


@pytest.mark.parametrize("make", [
    lambda file, other: file.__setitem__("contact_time_s", h5py.ExternalLink(str(other), "contact_time_s")),
    lambda file, other: file.__setitem__("contact_time_s", h5py.SoftLink("/start_unix_s")),
    lambda file, other: file.create_dataset("contact_time_s", (2, 3), "f8", external=[(str(other), 0, 48)]),
    lambda file, other: file.create_virtual_dataset("contact_time_s", _layout_of(other)),
], ids=["external link", "soft link", "external storage", "virtual"])
def test_nothing_is_read_from_another_file(tmp_path, make):
    session, other = tmp_path / "session.h5", tmp_path / "other.h5"
    _write_session(session)
    _write_session(other)
    _from_elsewhere(session, "contact_time_s", lambda file: make(file, other))
    with pytest.raises(touchstone_mcap.ExportError, match="contact_time_s is a link, or has its values in another place"):
        touchstone_mcap.export(session, tmp_path / "session.mcap")
    assert not (tmp_path / "session.mcap").exists()


def _layout_of(path):
    layout = h5py.VirtualLayout((2, 3), "f8")
    layout[...] = h5py.VirtualSource(str(path), "contact_time_s", (2, 3))
    return layout


def test_a_value_that_was_changed_is_named(tmp_path):
    import hashlib

    session = tmp_path / "session.h5"
    _write_session(session)
    with h5py.File(session, "r+") as file:
        sums = {}

        def seal(name, entry):
            if isinstance(entry, h5py.Dataset):
                sums[name] = hashlib.sha256(entry[...].tobytes()).hexdigest()
                entry.attrs["sha256"] = np.bytes_(sums[name])

        file.visititems(seal)
        lines = "".join(f"{name} {digest}\n" for name, digest in sorted(sums.items()))
        file.attrs["checksums"] = np.bytes_(hashlib.sha256(lines.encode()).hexdigest())
    assert touchstone_mcap.export(session, tmp_path / "session.mcap")
    with h5py.File(session, "r+") as file:
        file["start_unix_s"][0] += 1
    with pytest.raises(touchstone_mcap.ExportError, match="start_unix_s is damaged or was changed"):
        touchstone_mcap.export(session, tmp_path / "again.mcap")
