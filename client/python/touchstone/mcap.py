"""A session as an MCAP file, the log format of Foxglove and ROS 2 (https://mcap.dev).

    touchstone session export session.db -o session.h5
    python -m touchstone.mcap session.h5 -o session.mcap

Needs the extra `touchstone-sim[mcap]` (mcap, h5py). The HDF5 file is what a session is exported to: every row of the
journal was checked on its way there.

Channels, each with its schema in the file, times in Unix nanoseconds:
  /touch       touchstone.v1.RecordedTouch (protobuf), one per touch, at the time at which its approach began
  /arm_state   touchstone.v1.RecordedArmState (protobuf), the states of approaches made with --series
  /tip         foxglove.PoseInFrame (JSON), the tip in the arm's base frame: at each contact, and at each state
  /camera      foxglove.CompressedImage (JSON), pictures as PNG
  /camera_pose foxglove.PoseInFrame (JSON), where each was taken from: measured, or as commanded where that is unknown
"""

from __future__ import annotations

import base64
import hashlib
import json
import math
import os
from collections.abc import Iterator
from typing import Any

from . import command
from .errors import InvalidRequest
from .measurements import EMULATED
from .v1 import types_pb2
from .whole_file import check_target, whole_file

SECOND_NS = 1_000_000_000

TIME = {"type": "object", "properties": {"sec": {"type": "integer"}, "nsec": {"type": "integer"}}}
_XYZ = {"type": "object", "properties": {axis: {"type": "number"} for axis in "xyz"}}
_XYZW = {"type": "object", "properties": {axis: {"type": "number"} for axis in "xyzw"}}
# As https://docs.foxglove.dev/docs/visualization/message-schemas publishes them.
_POSE_IN_FRAME = {
    "title": "foxglove.PoseInFrame", "type": "object",
    "properties": {
        "timestamp": TIME, "frame_id": {"type": "string"},
        "pose": {"type": "object", "properties": {"position": _XYZ, "orientation": _XYZW}},
    },
}
COMPRESSED_IMAGE = {
    "title": "foxglove.CompressedImage", "type": "object",
    "properties": {
        "timestamp": TIME, "frame_id": {"type": "string"},
        "data": {"type": "string", "contentEncoding": "base64"}, "format": {"type": "string"},
    },
}


class ExportError(InvalidRequest):
    """What is wrong with the session's file, and what would be right."""


def time_of(unix_s: float) -> dict[str, int]:
    """Unix seconds as Foxglove's schemas write a time: whole seconds and nanoseconds."""
    ns = _ns(unix_s)
    return {"sec": ns // SECOND_NS, "nsec": ns % SECOND_NS}


def _ns(unix_s: float) -> int:
    # MCAP has no time before 1970; a session whose times are unknown begins there.
    return max(0, round(unix_s * SECOND_NS)) if math.isfinite(unix_s) else 0


def _pose(position: Any, rotation: Any) -> dict[str, dict[str, float]]:
    """Of a position and a rotation vector, as a quaternion."""
    angle = math.sqrt(sum(float(part) ** 2 for part in rotation))
    share = math.sin(angle / 2) / angle if angle > 0 else 0.5
    x, y, z = (share * float(part) for part in rotation)
    return {
        "position": dict(zip("xyz", map(float, position))),
        "orientation": {"x": x, "y": y, "z": z, "w": math.cos(angle / 2)},
    }


def _base_pose(position: Any, rotation: Any) -> types_pb2.BasePose:
    return types_pb2.BasePose(position_m=_vector(position), rotation_rad=_vector(rotation))


def _vector(values: Any) -> types_pb2.Vector3:
    x, y, z = map(float, values)
    return types_pb2.Vector3(x=x, y=y, z=z)


def _file_descriptor_set(message: Any) -> bytes:
    """The message's .proto file and all that it imports, as MCAP's protobuf schemas want them."""
    from google.protobuf import descriptor_pb2

    files, wanted = descriptor_pb2.FileDescriptorSet(), [message.DESCRIPTOR.file]
    seen: set[str] = set()
    while wanted:
        file = wanted.pop()
        if file.name not in seen:
            seen.add(file.name)
            file.CopyToProto(files.file.add())
            wanted.extend(file.dependencies)
    return bytes(files.SerializeToString())


def _texts(dataset: Any) -> list[str]:
    return [value.decode() if isinstance(value, bytes) else str(value) for value in dataset[...]]


def _byte_strings(group: Any, name: str) -> list[bytes]:
    data, offsets = group[name][...].tobytes(), [int(offset) for offset in group[name + "_offset"][...]]
    return [data[begin:end] for begin, end in zip(offsets, offsets[1:])]


def _check(path: str | os.PathLike[str], group: Any, checksums: bool, sums: dict[str, str]) -> None:
    """Everything lies in this file, and is what was written: no links, nothing from other files, sums as they should be; `sums` gets
    each dataset's."""
    import h5py

    for name in group:
        entry = group[name] if isinstance(group.get(name, getlink=True), h5py.HardLink) else None
        where = f"{path}: {group.name.rstrip('/')}/{name}"
        if isinstance(entry, h5py.Group) and group.name == "/":
            _check(path, entry, checksums, sums)
        elif not isinstance(entry, h5py.Dataset) or entry.is_virtual or entry.external:
            raise ExportError(f"{where} is a link, or has its values in another place; export the session again.")
        elif checksums and "sha256" in entry.attrs:
            sums[entry.name.lstrip("/")] = digest = entry.attrs["sha256"].decode()
            if hashlib.sha256(entry[...].tobytes()).hexdigest() == digest:
                continue
            raise ExportError(f"{where} is damaged or was changed: its values are not those of its checksum; export the session again.")


class SessionFile:
    """An HDF5 file of `touchstone session export`, opened for reading; `with` closes it."""

    def __init__(self, path: str | os.PathLike[str]):
        import h5py

        try:
            self._file = h5py.File(path, "r")
        except OSError as error:
            raise ExportError(f"{path}: cannot be read as HDF5 ({error}). Make one with: touchstone session export "
                              f"SESSION.db -o SESSION.h5") from None
        found = _texts(self._file["session/format"])[0] if "session/format" in self._file else "none"
        if found != "touchstone: session/1":
            raise ExportError(f"{path}: its format is {found!r}, and 'touchstone: session/1' was expected.")
        sums: dict[str, str] = {}
        _check(path, self._file, "checksums" in self._file.attrs, sums)
        lines = "".join(f"{name} {digest}\n" for name, digest in sorted(sums.items()))
        if "checksums" in self._file.attrs and hashlib.sha256(lines.encode()).hexdigest() != self._file.attrs["checksums"].decode():
            raise ExportError(f"{path} is damaged or was changed: its datasets are not those that were written; export the session again.")
        self.name = _texts(self._file["session/name"])[0]
        self.provenance = _texts(self._file["session/source"])[0]
        self.calibration = _texts(self._file["session/calibration"])[0]
        self.emulated = "session/emulated" in self._file and bool(self._file["session/emulated"][0])
        self.fingers, self.touches, self.images = map(int, self._file["session/fingers_touches_images"][...])

    def __enter__(self) -> SessionFile:
        return self

    def __exit__(self, *_: Any) -> None:
        self._file.close()

    def recorded_touches(self) -> Iterator[types_pb2.RecordedTouch]:
        """Every touch of the journal, in its order, SI. ExportError where a row cannot be read."""
        file = self._file
        ids, objects, up_faces = (_texts(file[name]) for name in ("id", "object", "placement"))
        commands = _byte_strings(file, "command")
        columns = {name: file[name][...] for name in (
            "contact_time_s", "base_from_tip_position_m", "base_from_tip_rotation_rad", "measured_speed_m_s",
            "session_time_s", "start_unix_s", "time_uncertainty_s", "synchronisation_uncertainty_s", "effector_drift",
            "recovered")}
        for k in range(self.touches):
            touch = types_pb2.RecordedTouch(object=objects[k], up_face=up_faces[k])
            touch.command.ParseFromString(commands[k])
            if self.emulated:
                touch.command.covariates[EMULATED] = 1.0
            times = [float(time) for time in columns["contact_time_s"][k]]
            reported = [time for time in times if math.isfinite(time)]
            touch.result.contact_time_s.extend(times)
            touch.result.complete = len(reported) == len(times)
            touch.result.descriptor_s.extend(time - min(reported) if reported else math.nan for time in times)
            measured = touch.result.measured
            measured.touch_id, measured.session = ids[k], self.name
            for position, rotation in zip(columns["base_from_tip_position_m"][k],
                                          columns["base_from_tip_rotation_rad"][k]):
                pose = measured.base_from_tip_at_contact.add()
                if math.isfinite(position[0]):
                    pose.CopyFrom(_base_pose(position, rotation))
            for name, field in (("measured_speed_m_s", "speed_m_s"), ("session_time_s", "session_time_s"),
                                ("start_unix_s", "start_unix_s"), ("time_uncertainty_s", "time_uncertainty_s"),
                                ("synchronisation_uncertainty_s", "synchronisation_uncertainty_s"),
                                ("effector_drift", "effector_drift")):
                setattr(measured, field, float(columns[name][k]))
            measured.recovered = bool(columns["recovered"][k])
            yield touch

    def arm_states(self) -> Iterator[tuple[int, types_pb2.RecordedArmState]]:
        """The states of every touch that has a series, with the touch's row."""
        if "series" not in self._file:
            return
        series, ids = self._file["series"], _texts(self._file["id"])
        columns = {name: series[name][...] for name in (
            "time_s", "joints_rad", "base_from_tip_position_m", "base_from_tip_rotation_rad", "tip_force_n")}
        state = 0
        for row, count in enumerate(int(count) for count in series["states"][...]):
            for k in range(state, state + count):
                yield row, types_pb2.RecordedArmState(
                    touch_id=ids[row], time_s=float(columns["time_s"][k]),
                    joints_rad=[float(joint) for joint in columns["joints_rad"][k]],
                    base_from_tip=_base_pose(columns["base_from_tip_position_m"][k],
                                             columns["base_from_tip_rotation_rad"][k]),
                    tip_force_n=_vector(columns["tip_force_n"][k]))
            state += count

    def photographs(self) -> Iterator[tuple[float, bytes, Any]]:
        """Unix time, PNG, and base_from_camera (position, rotation vector) of each picture."""
        if self.images == 0:
            return
        images = self._file["images"]
        poses = images["base_from_camera_m_rad"][...]
        measured = (images["measured_base_from_camera_m_rad"][...] if "measured_base_from_camera_m_rad" in images
                    else [[math.nan] * 6] * self.images)
        times = images["unix_s"][...]
        for k, png in enumerate(_byte_strings(images, "png")):
            pose = measured[k] if math.isfinite(measured[k][0]) else poses[k]
            yield float(times[k]), png, (pose[:3], pose[3:])


def export(session: str | os.PathLike[str], output: str | os.PathLike[str], *, force: bool = False) -> dict[str, int]:
    """Writes the MCAP file, whole or not at all; how many messages each channel got. ExportError for a file that is no session,
    InvalidRequest for an output that exists or cannot be.

    force: replace a file that is there.
    """
    check_target(output, force)
    try:
        from mcap.writer import Writer
    except ImportError as error:
        raise ExportError(f"{error}; install them with: pip install 'touchstone-sim[mcap]'") from None
    with SessionFile(session) as source, whole_file(output, "wb") as stream:
        return _write(source, Writer(stream))


def _write(source: SessionFile, writer: Any) -> dict[str, int]:
    from . import __version__

    writer.start(profile="", library=f"touchstone {__version__}")
    writer.add_metadata("touchstone", {"session": source.name, "source": source.provenance,
                                       "calibration": source.calibration, "fingers": str(source.fingers)})
    counts: dict[str, int] = {}
    channels: dict[str, int] = {}

    def add_channel(topic: str, name: str, encoding: str, message_encoding: str, schema: bytes) -> None:
        schema_id = writer.register_schema(name=name, encoding=encoding, data=schema)
        channels[topic] = writer.register_channel(topic=topic, message_encoding=message_encoding, schema_id=schema_id)
        counts[topic] = 0

    for topic, message in (("/touch", types_pb2.RecordedTouch), ("/arm_state", types_pb2.RecordedArmState)):
        add_channel(topic, message.DESCRIPTOR.full_name, "protobuf", "protobuf", _file_descriptor_set(message))
    for topic, schema in (("/tip", _POSE_IN_FRAME), ("/camera", COMPRESSED_IMAGE), ("/camera_pose", _POSE_IN_FRAME)):
        add_channel(topic, str(schema["title"]), "jsonschema", "json", json.dumps(schema).encode())

    def add(topic: str, unix_s: float, data: Any) -> None:
        encoded = json.dumps(data).encode() if isinstance(data, dict) else data.SerializeToString()
        writer.add_message(channel_id=channels[topic], log_time=_ns(unix_s), publish_time=_ns(unix_s), data=encoded,
                           sequence=counts[topic])
        counts[topic] += 1

    began: list[float] = []
    for touch in source.recorded_touches():
        measured = touch.result.measured
        began.append(measured.start_unix_s)
        add("/touch", measured.start_unix_s, touch)
        for time_s, pose in zip(touch.result.contact_time_s, measured.base_from_tip_at_contact):
            if math.isfinite(time_s) and pose.HasField("position_m"):
                at_s = measured.start_unix_s + time_s
                p, r = pose.position_m, pose.rotation_rad
                add("/tip", at_s, {"timestamp": time_of(at_s), "frame_id": "base",
                                   "pose": _pose((p.x, p.y, p.z), (r.x, r.y, r.z))})
    for row, state in source.arm_states():
        at_s = began[row] + state.time_s
        add("/arm_state", at_s, state)
        p, r = state.base_from_tip.position_m, state.base_from_tip.rotation_rad
        add("/tip", at_s, {"timestamp": time_of(at_s), "frame_id": "base",
                           "pose": _pose((p.x, p.y, p.z), (r.x, r.y, r.z))})
    for unix_s, png, (position, rotation) in source.photographs():
        add("/camera", unix_s, {"timestamp": time_of(unix_s), "frame_id": "camera", "format": "png",
                                "data": base64.b64encode(png).decode()})
        add("/camera_pose", unix_s, {"timestamp": time_of(unix_s), "frame_id": "base", "pose": _pose(position, rotation)})
    writer.finish()
    return counts


def main(words: list[str]) -> None:
    """The command `python -m touchstone.mcap`."""
    parser = command.CommandParser(
        "mcap", "Writes an exported session as an MCAP file, the log format of Foxglove and ROS 2 (https://mcap.dev).",
        "touchstone session export session.db -o session.h5\npython -m touchstone.mcap session.h5 -o session.mcap")
    parser.prog = "python -m touchstone.mcap"
    parser.add_argument("session", metavar="SESSION", help="An HDF5 file of touchstone session export")
    parser.add_argument("-o", "--output", metavar="FILE", required=True, help="The MCAP file")
    parser.add_output_options(force=True)
    options = parser.parse(words)
    counts = export(options.session, options.output, force=options.force)
    if options.json:
        print(json.dumps(counts, indent=2))
    command.log(options.quiet, f"{options.output}: " + ", ".join(f"{count} {topic}" for topic, count in counts.items()))


if __name__ == "__main__":
    command.run(main)
