"""A recording of another tool as a measured set."""

from __future__ import annotations

import dataclasses
import os
import pathlib
import shutil
import tempfile
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import InvalidRequest, NotFound
from ..measurements import Row, write_measurements
from ..plans import touches as make_touches
from . import mapping as mappings, sessions
from .mapping import Mapping, Source
from .recordings import Recording, Topic, open_recording

Array = NDArray[np.float64]
_FINGERS = tuple(range(1, 17))
# A unit vector is one within what four digits leave; it is then made exact.
_UNIT_WITHIN = 1e-3


class OpenQuestions(InvalidRequest):
    """The mapping leaves something open. `questions`: each in words, with the candidates."""

    def __init__(self, path: pathlib.Path, questions: list[str]):
        self.questions = questions
        super().__init__(f"{path}: what is not said is not guessed. Answer in the mapping file (--map):\n" + "\n".join(
            f"  - {question}" for question in questions))


@dataclasses.dataclass(frozen=True)
class Imported:
    """Attributes:
      path: the measured set.
      rows: touches in it.
      left_out: messages that are no whole touch, a reason each.
    """

    path: pathlib.Path
    rows: int
    left_out: tuple[str, ...]


def import_recording(source: str | os.PathLike[str], out: str | os.PathLike[str], mapping: str | os.PathLike[str] | dict[str, Any] | None = None, *,
                     force: bool = False) -> Imported:
    """Writes the touches of a recording as a measured set that compare and diagnose read: whole or not at all.

    source: an MCAP file, the folder of a ROS 2 bag, a LeRobot dataset v3, a Parquet file or a folder of them.
    out: a measurement file (.csv) or a journal (.db).
    mapping: the mapping file, or its entries; what this program itself named needs none.

    OpenQuestions where the mapping leaves something open; InvalidRequest with entry, field and what would be right.
    """
    path, target = pathlib.Path(source), pathlib.Path(out)
    if target.suffix not in (".csv", ".db"):
        raise InvalidRequest(f"out: '{target}' does not say the format; a name that ends in .csv or .db was expected.")
    if target.exists() and not force:
        raise InvalidRequest(f"{target} exists; replace it with --force, or choose another name.")
    if isinstance(mapping, dict) or mapping is None:
        entries, origin = dict(mapping or {}), "mapping"
    else:
        entries, origin = mappings.read_mapping(pathlib.Path(mapping)), str(mapping)
    recording = open_recording(path)
    rows, left_out = _rows(recording, Mapping(recording, entries, origin))
    _write(target, rows, path)
    return Imported(target, len(rows), tuple(left_out))


def _write(target: pathlib.Path, rows: list[Row], source: pathlib.Path) -> None:
    with tempfile.TemporaryDirectory(prefix="touchstone-import-") as folder:
        csv = pathlib.Path(folder) / f"{target.stem}.csv"
        write_measurements(csv, rows)
        journal = csv.with_suffix(".db")
        try:
            # The program's own checks, row by row.
            sessions.run_program("session", "import", csv, "-o", journal)
        except NotFound:
            if target.suffix == ".db":
                raise
        except InvalidRequest as error:
            raise InvalidRequest(f"{source}: what the mapping makes of it is no measured set: {str(error).replace(str(csv), 'row')}") from None
        if target.suffix == ".db":
            shutil.copyfile(journal, target)
        else:
            write_measurements(target, rows)


def _rows(recording: Recording, mapping: Mapping) -> tuple[list[Row], list[str]]:
    read = _Reader(recording, mapping)
    columns = read.columns()
    if mapping.questions:
        raise OpenQuestions(recording.path, mapping.questions.asked)
    assert mapping.touches is not None
    rows, left_out = [], []
    for k in range(mapping.touches.rows):
        values = {name: column[k] for name, column in columns.items()}
        lacking = [name for name in ("target_mm", "approach", "lateral", "standoff_mm", "speed_mm_s") if not np.all(np.isfinite(values[name]))]
        if lacking or not values["object"]:
            left_out.append(f"message {k}: {', '.join(lacking) or 'object'} is missing")
            continue
        number = int(values["touch"]) if "touch" in values else k
        more = {name: [value] for name, value in values.items() if name.startswith("cov_") and np.isfinite(value)}
        time_s = float(values["session_time_s"]) if "session_time_s" in values else None
        command = make_touches(target_mm=[values["target_mm"]], approach=[_unit(k, "approach", values["approach"])],
                               lateral=[_unit(k, "lateral", values["lateral"])], standoff_mm=[values["standoff_mm"]],
                               speed_mm_s=[values["speed_mm_s"]], **more)
        rows.append(Row(number, values["object"], command, tuple(float(time) for time in values["time_us"]), time_s))
    if not rows:
        raise InvalidRequest(f"{recording.path}: no message is a whole touch; {left_out[0] if left_out else 'there are none'}.")
    return rows, left_out


def _unit(k: int, name: str, vector: Array) -> Array:
    length = float(np.linalg.norm(vector))
    if abs(length - 1) > _UNIT_WITHIN:
        raise InvalidRequest(f"message {k}: {name} {vector.tolist()} has length {length:.4g}; a unit vector was expected.")
    return vector / length


class _Reader:
    """The columns of a measured set, one value per message of the topic of touches."""

    def __init__(self, recording: Recording, mapping: Mapping):
        self._recording, self._mapping = recording, mapping

    def columns(self) -> dict[str, Any]:
        ask = self._mapping.source
        sources = {
            "object": ask("object", "the name of the object", None, (1,), ("object", "task", "part", "name"), text=True),
            "standoff_mm": ask("standoff", "the distance of the middle finger's start from the target", mappings.LENGTHS, (1,),
                               ("standoff", "distance")),
            "speed_mm_s": ask("speed", "the commanded speed", mappings.SPEEDS, (1,), ("speed", "velocity")),
            "touch": ask("touch", "the number of the touch", None, (1,), ("touch", "index"), required=False),
        }
        if "contacts" not in self._mapping.entries:
            sources["time_us"] = ask("contact_time", "the fingers' contact times since the approach began", mappings.TIMES, _FINGERS,
                                     ("contact", "time", "touch", "finger"))
        posed = "pose" in self._mapping.entries
        if not posed:
            sources["target_mm"] = ask("target", "the point that the middle finger aims at (or give `pose`)", mappings.LENGTHS, (3,),
                                       ("target", "position", "point"))
            for name, what in (("approach", "the unit vector of the motion (or give `pose`)"),
                               ("lateral", "the unit vector from the first finger towards the last (or give `pose`)")):
                sources[name] = ask(name, what, None, (3,), (name, "direction", "vector"))
        columns = {name: self._values(source, text=name == "object") for name, source in sources.items() if source}
        columns |= self._covariates()
        if posed:
            columns |= self._pose(columns.get("standoff_mm"))
        if "contacts" in self._mapping.entries:
            columns["time_us"] = self._contacts()
        time_s = self._session_time()
        if time_s is not None:
            columns["session_time_s"] = time_s
        return columns

    # --- Values of fields

    def _values(self, source: Source, *, text: bool = False) -> Any:
        """(rows,) or (rows, n); numbers in the set's unit, or texts."""
        touches = self._mapping.touches
        if touches is None:
            return None
        if not source.fields:
            return [str(source.value)] * touches.rows if text else np.repeat([np.asarray(source.value, float) * source.factor], touches.rows, 0)
        topic = self._recording.topics[source.topic]
        at = self._at(topic)
        if text:
            values = topic.fields[source.fields[0]]
            return [("" if values[k] is None else str(values[k])) if k >= 0 else "" for k in at]
        return self._numbers(topic, source.fields, at) * source.factor

    def _numbers(self, topic: Topic, fields: tuple[str, ...], at: NDArray[np.int64]) -> Array:
        parts = []
        for field in fields:
            numbers = topic.numbers(field)
            if numbers is None:
                raise InvalidRequest(f"{self._mapping.origin}: field '{field}' is {topic.describe(field)}; numbers were expected.")
            found = numbers[np.maximum(at, 0)].astype(float)
            found[at < 0] = np.nan
            parts.append(found)
        return parts[0] if len(parts) == 1 else np.concatenate([part.reshape(len(at), -1) for part in parts], 1)

    def _at(self, topic: Topic) -> NDArray[np.int64]:
        """The message of the topic that counts for each touch: its own, or the last one before it; -1: there is none."""
        touches = self._mapping.touches
        assert touches is not None
        if topic is touches:
            return np.arange(touches.rows)
        return np.searchsorted(np.asarray(topic.times_ns), np.asarray(touches.times_ns), side="right") - 1

    # --- What is made of several fields

    def _pose(self, standoff_mm: Array | None) -> dict[str, Array]:
        mapping, said = self._mapping, self._mapping.entries["pose"]
        topic = mapping.topic("pose", said["topic"]) if "topic" in said else mapping.touches
        if topic is None:
            return {}
        fields = {}
        for name, count in (("position", 3), ("orientation", 4)):
            if name not in said:
                mapping.questions.ask(f"pose.{name}: which field of {topic.name or 'the table'} is it? There are {', '.join(list(topic.fields)[:12])}.")
                return {}
            wanted = said[name] if isinstance(said[name], list) else mapping.expanded(topic, said[name]) or [said[name]]
            fields[name] = tuple(mapping._field(f"pose.{name}", topic, field) for field in wanted)
            numbers = self._numbers(topic, fields[name], self._at(topic)).reshape(-1, count)
            if len(numbers) != (mapping.touches.rows if mapping.touches else len(numbers)):
                raise InvalidRequest(f"{mapping.origin}: pose.{name}: {', '.join(fields[name])} has not {count} numbers.")
            fields[f"{name} values"] = numbers  # type: ignore[assignment]
        factor = mapping._factor("pose", "the tool's position", mappings.LENGTHS, said, fields["position"])
        # Four parts that are named x, y, z and w say their order.
        named = [field.rpartition(".")[2] for field in fields["orientation"]] == ["x", "y", "z", "w"]
        order = "xyzw" if named else mapping.choice("pose", said, "order", "in which order stand the four numbers of the quaternion?", mappings._ORDERS)
        axes = {name: mapping.choice("pose", said, f"{name}_axis", question, mappings._AXES) for name, question in (
            ("approach", "along which axis of the tool does it move towards the object?"),
            ("lateral", "which axis of the tool points from the first finger towards the last?"))}
        where = mapping.choice("pose", said, "is", "is the position the start of the middle finger, or the target point?", ("start", "target"))
        if mapping.questions or standoff_mm is None:
            return {}
        position = np.asarray(fields["position values"]) * factor
        rotation = _rotations(np.asarray(fields["orientation values"]), order)
        vectors = {name: rotation @ _axis(axis) for name, axis in axes.items()}
        target = position if where == "target" else position + vectors["approach"] * np.reshape(standoff_mm, (-1, 1))
        return {"target_mm": target, **vectors}

    def _contacts(self) -> Array | None:
        """Contact times of fingers that have a topic each: the first message after a touch's own that says contact."""
        mapping, said = self._mapping, self._mapping.entries["contacts"]
        touches = mapping.touches
        if touches is None or "topics" not in said or "field" not in said:
            names = [f"{topic.name} ({topic.kind})" for topic in self._recording.topics.values()]
            mapping.questions.ask(f"contacts: which topics, in the order of the fingers (topics: [..]), and which field of theirs says contact? There "
                                  f"are {', '.join(names)}.")
            return None
        began = np.asarray(touches.times_ns, np.int64)
        ends = np.append(began[1:], np.iinfo(np.int64).max)
        found = np.full((touches.rows, len(said["topics"])), np.nan)
        for finger, name in enumerate(said["topics"]):
            topic = mapping.topic("contacts", name)
            values = topic.numbers(mapping._field("contacts", topic, said["field"]))
            if values is None or values.ndim != 1:
                raise InvalidRequest(f"{mapping.origin}: contacts: '{said['field']}' of {name} is {topic.describe(said['field'])}; one number was expected.")
            binary = bool(np.all(np.isin(values[np.isfinite(values)], (0, 1))))
            if "threshold" not in said and not binary:
                mapping.questions.ask(f"contacts.threshold: above which value of {said['field']} does a finger touch? {name} has "
                                      f"{topic.describe(said['field'])}.")
                return None
            times = np.asarray(topic.times_ns, np.int64)[values > float(said.get("threshold", 0.5))]
            first = np.searchsorted(times, began, side="left")
            for k in range(touches.rows):
                if first[k] < len(times) and times[first[k]] < ends[k]:
                    found[k, finger] = (times[first[k]] - began[k]) / 1e3
        return found

    def _covariates(self) -> dict[str, Array]:
        mapping = self._mapping
        columns: dict[str, Array] = {}
        if "joints" in mapping.entries:
            source = mapping.source("joints", "the arm's joints", mappings.ANGLES, (), ("joint", "position"))
            if source is not None:
                values = self._values(source)
                if values is not None:
                    values = np.asarray(values).reshape(len(values), -1)
                    columns |= {f"cov_joint_{k}_deg": values[:, k] for k in range(values.shape[1])}
        said = mapping.entries.get("covariates") or {}
        if not isinstance(said, dict):
            raise InvalidRequest(f"{mapping.origin}: covariates: {said!r}; {{NAME: {{field: ...}}}} was expected.")
        for name, entry in said.items():
            key = f"covariates.{name}"
            mapping.entries[key] = entry
            source = mapping.source(key, name, None, (1,), (name,))
            if source is not None and (values := self._values(source)) is not None:
                columns[f"cov_{name}"] = values
        return columns

    def _session_time(self) -> Array | None:
        mapping = self._mapping
        source = mapping.source("time", "the time of the touch", mappings.SECONDS, (1,), ("time", "stamp"), required=False)
        if source is not None:
            values = self._values(source)
            return None if values is None else values - (0.0 if "time" not in mapping.entries else np.nanmin(values))
        if mapping.touches is None or not mapping.touches.times_ns:
            return None
        times = np.asarray(mapping.touches.times_ns, np.int64)
        return (times - times[0]) / 1e9


def _axis(name: str) -> Array:
    vector = np.zeros(3)
    vector["xyz".index(name[1])] = 1.0 if name[0] == "+" else -1.0
    return vector


def _rotations(quaternions: Array, order: str) -> Array:
    """(n, 3, 3) of unit quaternions."""
    if order == "wxyz":
        quaternions = np.roll(quaternions, -1, axis=1)
    length = np.linalg.norm(quaternions, axis=1)
    wrong = np.flatnonzero(np.abs(length - 1) > _UNIT_WITHIN)
    if len(wrong):
        raise InvalidRequest(f"message {wrong[0]}: the orientation {quaternions[wrong[0]].tolist()} has length {length[wrong[0]]:.4g}; a unit "
                             "quaternion was expected.")
    x, y, z, w = (quaternions / length[:, None]).T
    return np.stack([
        np.stack([1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)], -1),
        np.stack([2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)], -1),
        np.stack([2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)], -1)], 1)
