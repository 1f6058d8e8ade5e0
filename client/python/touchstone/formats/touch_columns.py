"""The columns of a measured set, made of a recording's fields as the mapping says."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import InvalidRequest
from . import mapping as mappings
from .mapping import UNIT_WITHIN, Mapping, Source
from .recordings import Recording, Topic

Array = NDArray[np.float64]
_FINGERS = tuple(range(1, 17))


class TouchColumns:
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
                                     ("contact", "descriptor", "touch", "finger", "time"))
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
        return np.asarray(self._numbers(topic, source.fields, at) * source.factor)

    def _numbers(self, topic: Topic, fields: tuple[str, ...], at: NDArray[np.int64]) -> Array:
        parts = []
        for field in fields:
            numbers = topic.numbers(field)
            if numbers is None:
                raise InvalidRequest(f"{self._mapping.origin}: field '{field}' is {topic.describe(field)}; numbers were expected.")
            found = numbers[np.maximum(at, 0)].astype(float)
            found[at < 0] = np.nan
            parts.append(found)
        return np.asarray(parts[0] if len(parts) == 1 else np.concatenate([part.reshape(len(at), -1) for part in parts], 1))

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
        fields, values = {}, {}
        for name, count in (("position", 3), ("orientation", 4)):
            if name not in said:
                mapping.questions.ask(f"pose.{name}: which field of {topic.name or 'the table'} is it? There are "
                                      f"{', '.join(list(topic.fields)[:12])}.")
                return {}
            wanted = said[name] if isinstance(said[name], list) else mapping.expanded(topic, said[name])
            fields[name] = tuple(mapping.field(f"pose.{name}", topic, field) for field in wanted)
            values[name] = self._numbers(topic, fields[name], self._at(topic))
            if values[name].ndim != 2 or values[name].shape[1] != count:
                raise InvalidRequest(f"{mapping.origin}: pose.{name}: {', '.join(fields[name])} has not {count} numbers.")
        factor = mapping.factor("pose", "the tool's position", mappings.LENGTHS, said, fields["position"])
        # Four parts that are named x, y, z and w say their order.
        named = [field.rpartition(".")[2] for field in fields["orientation"]] == ["x", "y", "z", "w"]
        order = "xyzw" if named else mapping.choice("pose", said, "order", "in which order stand the four numbers of the quaternion?",
                                                    mappings.ORDERS)
        axes = {name: mapping.choice("pose", said, f"{name}_axis", question, mappings.AXES) for name, question in (
            ("approach", "along which axis of the tool does it move towards the object?"),
            ("lateral", "which axis of the tool points from the first finger towards the last?"))}
        where = mapping.choice("pose", said, "is", "is the position the start of the middle finger, or the target point?", ("start", "target"))
        if mapping.questions or standoff_mm is None:
            return {}
        position = values["position"] * factor
        rotation = rotations(values["orientation"], order)
        vectors = {name: rotation @ _axis(axis) for name, axis in axes.items()}
        target = position if where == "target" else position + vectors["approach"] * np.reshape(standoff_mm, (-1, 1))
        return {"target_mm": target, **vectors}

    def _contacts(self) -> Array | None:
        """Contact times of fingers that have a topic each: the first message after a touch's own that says contact."""
        mapping, said = self._mapping, self._mapping.entries["contacts"]
        touches = mapping.touches
        if touches is None or "topics" not in said or "field" not in said:
            names = [f"{topic.name} ({topic.kind})" for topic in self._recording.topics.values()]
            mapping.questions.ask("contacts: which topics, in the order of the fingers (topics: [..]), and which field of theirs says contact? "
                                  f"There are {', '.join(names)}.")
            return None
        began = np.asarray(touches.times_ns, np.int64)
        ends = np.append(began[1:], np.iinfo(np.int64).max)
        found = np.full((touches.rows, len(said["topics"])), np.nan)
        for finger, name in enumerate(said["topics"]):
            topic = mapping.topic("contacts", name)
            values = topic.numbers(mapping.field("contacts", topic, said["field"]))
            if values is None or values.ndim != 1:
                raise InvalidRequest(f"{mapping.origin}: contacts: '{said['field']}' of {name} is {topic.describe(said['field'])}; one number was "
                                     "expected.")
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
        # What an export of ours calls a covariate is one, above all cov_emulated.
        touches = mapping.touches
        for field in touches.fields if touches is not None else ():
            name = field.rpartition(".")[2]
            values = touches.numbers(field) if touches is not None and name.startswith("cov_") else None
            if values is not None and values.ndim == 1:
                columns[name] = np.asarray(values, float)
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
            return None if values is None else np.asarray(values - (0.0 if "time" not in mapping.entries else np.nanmin(values)))
        if mapping.touches is None or not mapping.touches.times_ns:
            return None
        times = np.asarray(mapping.touches.times_ns, np.int64)
        return np.asarray((times - times[0]) / 1e9)


def _axis(name: str) -> Array:
    vector = np.zeros(3)
    vector["xyz".index(name[1])] = 1.0 if name[0] == "+" else -1.0
    return vector


def rotations(quaternions: Array, order: str) -> Array:
    """(n, 3, 3) of unit quaternions."""
    if order == "wxyz":
        quaternions = np.roll(quaternions, -1, axis=1)
    length = np.linalg.norm(quaternions, axis=1)
    wrong = np.flatnonzero(np.abs(length - 1) > UNIT_WITHIN)
    if len(wrong):
        raise InvalidRequest(f"message {wrong[0]}: the orientation {quaternions[wrong[0]].tolist()} has length {length[wrong[0]]:.4g}; a unit "
                             "quaternion was expected.")
    x, y, z, w = (quaternions / length[:, None]).T
    return np.stack([
        np.stack([1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)], -1),
        np.stack([2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)], -1),
        np.stack([2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)], -1)], 1)
