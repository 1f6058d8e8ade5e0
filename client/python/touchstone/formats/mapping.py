"""Which topic or column of a recording is what of a touch: the mapping file, and the questions where that is not said.

    touchstone: mapping/1
    touches: /touch                                    # each message is a touch; of a table left out
    object: {field: object}                            # or {value: lat20}
    contact_time: {field: times, unit: s}              # or {fields: [t_l, t_m, t_r], unit: us}
    pose: {topic: /tool_pose, position: pose.position, unit: m, orientation: pose.orientation, order: xyzw,
           is: start, approach_axis: +z, lateral_axis: +x}
    standoff: {value: 60, unit: mm}
    speed: {field: speed, unit: m/s}

Instead of `pose`: `target`, `approach`, `lateral`, each a field of three numbers or three fields. Optional: `touch` (a number),
`time` (else the time at which the message was logged), `joints`, and `covariates: {NAME: {field: ...}}`. A field of another topic
has `topic:`; its last message before the touch counts. Instead of `contact_time` a recording may have one topic per finger:
`contacts: {topics: [/l, /m, /r], field: data}`, in which the first message that is true, or above `threshold`, after a touch's own
time is the contact.
"""

from __future__ import annotations

import dataclasses
import pathlib
from typing import Any

from ..command import did_you_mean
from ..errors import InvalidRequest
from .recordings import Recording, Topic
from .table import need

# How much of the file's unit each is.
LENGTHS = {"mm": 1.0, "cm": 10.0, "m": 1e3, "um": 1e-3}
TIMES = {"us": 1.0, "ms": 1e3, "s": 1e6, "ns": 1e-3}
SPEEDS = {"mm/s": 1.0, "m/s": 1e3, "cm/s": 10.0}
ANGLES = {"rad": 57.29577951308232, "deg": 1.0}
SECONDS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}
ORDERS = ("xyzw", "wxyz")
AXES = ("+x", "-x", "+y", "-y", "+z", "-z")
# A unit vector or quaternion is one within what four digits leave; it is then made exact.
UNIT_WITHIN = 1e-3
# Ends of names that say the unit.
_UNIT_ENDS = (("_mm_s", "mm/s"), ("_m_s", "m/s"), ("_mm", "mm"), ("_cm", "cm"), ("_us", "us"), ("_ms", "ms"), ("_ns", "ns"), ("_deg", "deg"),
              ("_rad", "rad"), ("_m", "m"), ("_s", "s"))
_ENTRIES = ("touchstone", "touches", "touch", "object", "contact_time", "contacts", "pose", "target", "approach", "lateral", "standoff", "speed",
            "time", "joints", "covariates")
_MOST_CANDIDATES = 6
# How this program itself names the fields of a touch, by the kind of the topic: in the messages of a session's export, and in tables
# and the channel /touch of other exports. They can mean one thing only.
_RECORDED_TOUCH = "touchstone.v1.RecordedTouch"
_OWN_TOPICS = (_RECORDED_TOUCH, "touchstone.Touch")
_OWN_MESSAGES = {"object": ("object",), "contact_time": ("result.contact_time_s",), "target": ("command.target_m",),
                 "approach": ("command.approach",), "lateral": ("command.lateral",), "standoff": ("command.standoff_m",),
                 "speed": ("command.speed_m_s",), "time": ("result.measured.session_time_s",)}
_OWN_COLUMNS = {"object": ("object_name",), "contact_time": ("contact_time_us",), "target": ("target_mm",), "approach": ("approach",),
                "lateral": ("lateral",), "standoff": ("standoff_mm",), "speed": ("speed_mm_s",), "touch": ("touch",),
                "time": ("session_time_s",)}


@dataclasses.dataclass
class Questions:
    """What a mapping leaves open, in words, with what is in the recording."""

    asked: list[str] = dataclasses.field(default_factory=list)

    def ask(self, text: str) -> None:
        if text not in self.asked:
            self.asked.append(text)

    def __bool__(self) -> bool:
        return bool(self.asked)


@dataclasses.dataclass
class Source:
    """Where a value of a touch comes from: fields of a topic with a factor, or a constant."""

    topic: str
    fields: tuple[str, ...]
    factor: float
    value: Any = None


class Mapping:
    """A mapping file together with the recording that it is about."""

    def __init__(self, recording: Recording, entries: dict[str, Any], origin: str):
        self.recording, self.entries, self.origin = recording, entries, origin
        self.questions = Questions()
        for name in entries:
            if name not in _ENTRIES:
                raise InvalidRequest(f"{origin}: unknown entry '{name}'{did_you_mean(name, list(_ENTRIES))}.")
        self.touches = self._touches()

    def _touches(self) -> Topic | None:
        names = list(self.recording.topics)
        if names == [""]:
            return self.recording.topics[""]
        wanted = self.entries.get("touches")
        own = [name for name, topic in self.recording.topics.items() if topic.kind in _OWN_TOPICS]
        if wanted is None and len(own) == 1:
            return self.recording.topics[own[0]]
        if wanted is None:
            described = [f"{name} ({topic.kind}, {topic.rows} messages)" for name, topic in self.recording.topics.items()]
            self.questions.ask("touches: which topic has one message per touch? There are " + "; ".join(described) + ".")
            return None
        return self.topic("touches", wanted)

    def topic(self, entry: str, name: str) -> Topic:
        if name not in self.recording.topics:
            raise InvalidRequest(f"{self.origin}: {entry}: the recording has no topic '{name}'{did_you_mean(name, list(self.recording.topics))}.")
        return self.recording.topics[name]

    # --- Entries

    def source(self, entry: str, what: str, units: dict[str, float] | None, counts: tuple[int, ...], words: tuple[str, ...], *,
               required: bool = True, text: bool = False) -> Source | None:
        """The entry's fields and factor; a question where it is missing or leaves something open.

        what: what is asked for, in words; counts: numbers that it may have in all, () for any; words: names of such fields contain
        one; text: it may be a text.
        """
        said = self.entries.get(entry)
        if said is None:
            said = self._found(entry, what, units, counts, words, required, text)
            if said is None:
                return None
        if isinstance(said, str):
            said = {"field": said}
        if not isinstance(said, dict):
            raise InvalidRequest(f"{self.origin}: {entry}: {said!r}; {{field: NAME}} or {{value: ...}} was expected.")
        unknown = [name for name in said if name not in ("topic", "field", "fields", "value", "unit", "threshold")]
        if unknown:
            raise InvalidRequest(f"{self.origin}: {entry}: unknown entry '{unknown[0]}'"
                                 f"{did_you_mean(unknown[0], ['topic', 'field', 'fields', 'value', 'unit'])}.")
        if "value" in said:
            return Source("", (), self.factor(entry, what, units, said, ()), said["value"])
        topic = self.topic(entry, said["topic"]) if "topic" in said else self.touches
        if topic is None:
            return None
        names = said.get("fields") or ([said["field"]] if said.get("field") else [])
        if not names:
            self._ask_field(entry, what, topic, counts, words, text)
            return None
        fields = tuple(self.field(entry, topic, part) for name in names for part in self.expanded(topic, name))
        count = sum(_width(topic, field) for field in fields)
        if counts and count not in counts and not text:
            raise InvalidRequest(f"{self.origin}: {entry}: {', '.join(fields)} has {count} numbers; {' or '.join(map(str, counts))} were expected.")
        return Source(topic.name, fields, self.factor(entry, what, units, said, fields))

    def field(self, entry: str, topic: Topic, name: str) -> str:
        if name in topic.fields:
            return name
        where = f"topic {topic.name}" if topic.name else "the table"
        raise InvalidRequest(f"{self.origin}: {entry}: {where} has no field '{name}'{did_you_mean(name, list(topic.fields))}.")

    def expanded(self, topic: Topic, name: str) -> tuple[str, ...]:
        """The field itself, or its parts x, y, z (and w) where it is a message."""
        if name in topic.fields:
            return (name,)
        return tuple(f"{name}.{part}" for part in ("x", "y", "z", "w") if f"{name}.{part}" in topic.fields) or (name,)

    def _found(self, entry: str, what: str, units: dict[str, float] | None, counts: tuple[int, ...], words: tuple[str, ...], required: bool,
               text: bool) -> dict[str, Any] | None:
        """What is named exactly as this program itself names it can mean one thing only."""
        if self.touches is None:
            return None
        own = (_OWN_MESSAGES if self.touches.kind == _RECORDED_TOUCH else _OWN_COLUMNS).get(entry, ())
        for name in own:
            for spelled in (name, f"observation.{name}"):
                if all(part in self.touches.fields for part in self.expanded(self.touches, spelled)):
                    return {"field": spelled, **({"unit": unit} if (unit := _unit_of(spelled)) and units else {})}
        if required:
            self._ask_field(entry, what, self.touches, counts, words, text)
        return None

    def _ask_field(self, entry: str, what: str, topic: Topic, counts: tuple[int, ...], words: tuple[str, ...], text: bool) -> None:
        found = _candidates(topic, counts, words, text)
        where = f"topic {topic.name}" if topic.name else "the table"
        if found:
            self.questions.ask(f"{entry}: which field of {where} is {what}? It may be " + "; ".join(
                f"{name} ({topic.describe(name)})" for name in found) + ".")
        else:
            self.questions.ask(f"{entry}: which field of {where} is {what}? None looks like it; give it as {{value: ...}}, or a field of another "
                               f"topic. There are {', '.join(list(topic.fields)[:12])}{' ...' if len(topic.fields) > 12 else ''}.")

    def factor(self, entry: str, what: str, units: dict[str, float] | None, said: dict[str, Any], fields: tuple[str, ...]) -> float:
        if units is None:
            return 1.0
        if "unit" in said:
            if said["unit"] not in units:
                raise InvalidRequest(f"{self.origin}: {entry}: unit '{said['unit']}'{did_you_mean(str(said['unit']), list(units))}.")
            return units[said["unit"]]
        ends = {_unit_of(field) for field in fields}
        if len(ends) == 1 and (unit := ends.pop()) in units:
            return units[unit]
        of = ", ".join(fields) if fields else f"the value {said.get('value')}"
        self.questions.ask(f"{entry}: in which unit is {of}, {what}? It may be {', '.join(units)}; write it as `unit: {next(iter(units))}`.")
        return 1.0

    def choice(self, entry: str, said: dict[str, Any], name: str, question: str, known: tuple[str, ...]) -> str:
        """One of a few words; asked where it is not said."""
        if name not in said:
            self.questions.ask(f"{entry}.{name}: {question} It may be {', '.join(known)}.")
            return known[0]
        if said[name] not in known:
            raise InvalidRequest(f"{self.origin}: {entry}.{name}: '{said[name]}'{did_you_mean(str(said[name]), list(known))}.")
        return str(said[name])


def _width(topic: Topic, field: str) -> int:
    values = topic.numbers(field)
    return 1 if values is None or values.ndim == 1 else int(values.shape[1])


def _unit_of(name: str) -> str:
    last = name.rpartition(".")[2]
    return next((unit for end, unit in _UNIT_ENDS if last.endswith(end)), "")


def _candidates(topic: Topic, counts: tuple[int, ...], words: tuple[str, ...], text: bool) -> list[str]:
    """Fields that may be meant: of the right size, those with such a name first."""
    sized = []
    for name in topic.fields:
        numbers = topic.numbers(name)
        if numbers is None:
            if text and isinstance(next((value for value in topic.fields[name] if value is not None), None), str):
                sized.append(name)
        elif not text and (not counts or _width(topic, name) in counts or (max(counts) > 1 and _width(topic, name) == 1)):
            sized.append(name)
    named = [name for name in sized if any(word in name.lower() for word in words)]
    return (named or sized)[:_MOST_CANDIDATES]


def read_mapping(path: pathlib.Path) -> dict[str, Any]:
    """The entries of a mapping file."""
    yaml = need("yaml", "a mapping file", "pyyaml")
    try:
        found = yaml.safe_load(path.read_text(encoding="utf-8"))
    except UnicodeDecodeError:
        raise InvalidRequest(f"{path} is not UTF-8 text.") from None
    except yaml.YAMLError as error:
        raise InvalidRequest(f"{path} is no YAML: {' '.join(str(error).split())}.") from None
    if not isinstance(found, dict) or found.get("touchstone") != "mapping/1":
        said = found.get("touchstone") if isinstance(found, dict) else found
        raise InvalidRequest(f"{path}: its first entry is {said!r}; 'touchstone: mapping/1' was expected.")
    return found
