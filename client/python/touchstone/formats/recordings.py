"""Recordings of other tools as what they have in common: topics, whose messages have a time and fields.

A field is named by its path in the message, "pose.position.x". A table (Parquet, LeRobot) is one topic without a name, a row a
message, a column a field.
"""

from __future__ import annotations

import dataclasses
import json
import pathlib
import sqlite3
from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import InvalidRequest, Refused
from .table import need

# Arrays of a message that are longer are pictures, clouds and scans, of which no field of a touch is made.
_MAX_VALUES = 64
_WHAT_IS_READ = "an MCAP file, a ROS 2 bag (its folder), a LeRobot dataset (its folder) or Parquet was expected"


@dataclasses.dataclass
class Topic:
    """Attributes:
      name: "" for a table.
      kind: the type of its messages, as the recording names it.
      times_ns: when each was logged; of a table empty.
      fields: what each message has, None where one lacks the field.
    """

    name: str
    kind: str
    times_ns: list[int] = dataclasses.field(default_factory=list)
    fields: dict[str, list[Any]] = dataclasses.field(default_factory=dict)
    rows: int = 0
    _numbers: dict[str, NDArray[np.float64] | None] = dataclasses.field(default_factory=dict)

    def add(self, time_ns: int | None, message: Any) -> None:
        if time_ns is not None:
            self.times_ns.append(time_ns)
        for path, value in _flat(message, ""):
            self.fields.setdefault(path, [None] * self.rows).append(value)
        self.rows += 1
        for values in self.fields.values():
            if len(values) < self.rows:
                values.append(None)

    def numbers(self, path: str) -> NDArray[np.float64] | None:
        """(rows,) or (rows, values) of a field of numbers, NaN where there is none; None if it is no such field."""
        if path not in self._numbers:
            self._numbers[path] = _as_numbers(self.fields[path])
        return self._numbers[path]

    def describe(self, path: str) -> str:
        """"3 numbers, 0.1 to 2.5" and the like."""
        values = self.numbers(path)
        if values is None:
            texts = [str(value) for value in self.fields[path] if value is not None]
            return f"text, for instance {texts[0][:40]!r}" if texts and isinstance(self.fields[path][0], str) else "no numbers"
        count = "a number" if values.ndim == 1 else f"{values.shape[1]} numbers"
        known = values[np.isfinite(values)]
        return f"{count}, {known.min():.6g} to {known.max():.6g}" if known.size else count


def _as_numbers(values: list[Any]) -> NDArray[np.float64] | None:
    first = next((value for value in values if value is not None), None)
    if isinstance(first, (bool, int, float, np.number, np.bool_)):
        return np.array(values, np.float64)  # None becomes NaN
    if isinstance(first, list) and first and isinstance(first[0], (int, float, np.number, type(None))):
        if any(value is not None and len(value) != len(first) for value in values):
            return None
        blank = [np.nan] * len(first)
        return np.array([blank if value is None else value for value in values], np.float64)
    return None


@dataclasses.dataclass
class Recording:
    path: pathlib.Path
    kind: str
    topics: dict[str, Topic]


def _flat(value: Any, path: str) -> Iterator[tuple[str, Any]]:
    """Paths and values of a message: numbers, texts, and lists of numbers."""
    if isinstance(value, dict):
        for name, part in value.items():
            yield from _flat(part, f"{path}.{name}" if path else str(name))
    elif isinstance(value, np.ndarray):
        yield from _flat(value.tolist(), path)
    elif isinstance(value, (list, tuple)):
        if len(value) > _MAX_VALUES:
            return
        if value and not isinstance(value[0], (bool, int, float, type(None))):
            for k, part in enumerate(value):
                yield from _flat(part, f"{path}.{k}")
        else:
            yield path, list(value)
    elif value is None or isinstance(value, (bool, int, float, str, np.number, np.bool_)):
        yield path, value
    elif hasattr(value, "DESCRIPTOR"):
        for field in value.DESCRIPTOR.fields:
            if field.message_type is None or field.label == field.LABEL_REPEATED or value.HasField(field.name):
                part = getattr(value, field.name)
                if field.message_type is not None and field.message_type.GetOptions().map_entry:
                    yield from _flat(dict(part), f"{path}.{field.name}" if path else field.name)
                    continue
                yield from _flat(list(part) if field.label == field.LABEL_REPEATED else part, f"{path}.{field.name}" if path else field.name)
    elif not isinstance(value, (bytes, bytearray, memoryview)):
        names = getattr(value, "__slots__", None) or getattr(value, "__dict__", {})
        for name in names:
            if not name.startswith("_"):
                yield from _flat(getattr(value, name), f"{path}.{name}" if path else name)


def open_recording(path: pathlib.Path) -> Recording:
    """Reads it; errors say what is wrong with it, or what was expected."""
    if not path.exists():
        raise InvalidRequest(f"{path} is not there; {_WHAT_IS_READ}.")
    if (path / "meta/info.json").is_file():
        return _lerobot(path)
    if (path / "metadata.yaml").is_file():
        return _bag(path)
    if path.is_dir() and any(path.rglob("*.parquet")):
        return _parquet(path, sorted(path.rglob("*.parquet")))
    if path.suffix == ".parquet":
        return _parquet(path, [path])
    if path.suffix == ".mcap":
        return _mcap(path)
    if path.suffix == ".db3":
        raise InvalidRequest(f"{path}: give the folder of the bag, in which metadata.yaml names its topics' types.")
    raise InvalidRequest(f"{path}: {_WHAT_IS_READ}.")


def _parquet(path: pathlib.Path, files: list[pathlib.Path]) -> Recording:
    need("pyarrow", "import of Parquet")
    parquet = need("pyarrow.parquet", "import of Parquet")
    topic = Topic("", "table")
    for file in files:
        try:
            opened = parquet.ParquetFile(file)
        except Exception as error:  # noqa: BLE001 (pyarrow's errors have no common base)
            raise InvalidRequest(f"{file} cannot be read as Parquet: {error}. A file that was cut off has lost its footer, and with it all "
                                 "rows.") from None
        kept = [field.name for field in opened.schema_arrow if "binary" not in str(field.type) and not str(field.type).startswith("extension")]
        for batch in opened.iter_batches(columns=kept):
            _add_columns(topic, batch)
    return Recording(path, "Parquet", {"": topic})


def _add_columns(topic: Topic, batch: Any) -> None:
    """A batch of rows; columns of messages field by field."""
    columns = {name: batch.column(name) for name in batch.schema.names}
    if any("struct" in str(column.type) for column in columns.values()):
        for row in batch.to_pylist():
            topic.add(None, row)
        return
    for name, column in columns.items():
        values = column.to_pylist()
        first = next((value for value in values if value is not None), None)
        if not isinstance(first, list) or (len(first) <= _MAX_VALUES and not (first and isinstance(first[0], list))):
            topic.fields.setdefault(name, []).extend(values)
    topic.rows += batch.num_rows


def _lerobot(path: pathlib.Path) -> Recording:
    info = json.loads((path / "meta/info.json").read_text(encoding="utf-8"))
    version = str(info.get("codebase_version"))
    if not version.startswith("v3."):
        raise InvalidRequest(f"{path}: a LeRobot dataset of version {version}; v3.0 was expected, which LeRobot's own converter makes of it.")
    found = _parquet(path, sorted((path / "data").glob("*/*.parquet")))
    topic = found.topics[""]
    if topic.rows != info["total_frames"]:
        raise Refused(f"{path}: {topic.rows} frames in data/, but meta/info.json says {info['total_frames']}; the dataset is not whole.")
    tasks = {row["task_index"]: row.get("task") or row.get("__index_level_0__")
             for row in need("pyarrow.parquet", "import of LeRobot").read_table(path / "meta/tasks.parquet").to_pylist()}
    topic.fields["task"] = [tasks.get(index) for index in topic.fields["task_index"]]
    return Recording(path, "LeRobot", found.topics)


def _bag(path: pathlib.Path) -> Recording:
    highlevel = need("rosbags.highlevel", "import of a ROS 2 bag", "rosbags")
    stores = need("rosbags.typesys", "import of a ROS 2 bag", "rosbags")
    topics: dict[str, Topic] = {}
    try:
        with highlevel.AnyReader([path], default_typestore=stores.get_typestore(stores.Stores.ROS2_HUMBLE)) as reader:
            for connection, time_ns, raw in reader.messages():
                topic = topics.setdefault(connection.topic, Topic(connection.topic, connection.msgtype))
                topic.add(time_ns, reader.deserialize(raw, connection.msgtype))
    except (highlevel.AnyReaderError, sqlite3.Error, OSError, KeyError, AssertionError) as error:
        raise InvalidRequest(f"{path} cannot be read as a ROS 2 bag: {error}.") from None
    return Recording(path, "ROS 2 bag", topics)


def _mcap(path: pathlib.Path) -> Recording:
    reader_module = need("mcap.reader", "import of MCAP", "mcap")
    exceptions = need("mcap.exceptions", "import of MCAP", "mcap")
    decoders = _Decoders(path)
    topics: dict[str, Topic] = {}
    with open(path, "rb") as stream:
        try:
            for schema, channel, message in reader_module.make_reader(stream).iter_messages():
                topic = topics.setdefault(channel.topic, Topic(channel.topic, schema.name if schema else channel.message_encoding))
                decoded = decoders.decode(schema, channel, message.data)
                if decoded is not None:
                    topic.add(message.log_time, decoded)
        except (exceptions.McapError, EOFError, ValueError) as error:
            raise InvalidRequest(f"{path} is no whole MCAP file: {type(error).__name__} {error}. `mcap recover`, of the MCAP project, saves "
                                 "what there is.") from None
    return Recording(path, "MCAP", {name: topic for name, topic in topics.items() if topic.rows})


class _Decoders:
    """Of the messages of an MCAP file, by the schemas in it; what has another encoding is left out."""

    def __init__(self, path: pathlib.Path):
        self._path, self._of_schema = path, dict[int, Any]()

    def decode(self, schema: Any, channel: Any, data: bytes) -> Any:
        if channel.message_encoding == "json":
            return json.loads(data)
        if schema is None:
            return None
        if schema.id not in self._of_schema:
            self._of_schema[schema.id] = self._make(schema, channel.message_encoding)
        decode = self._of_schema[schema.id]
        return decode(data) if decode else None

    def _make(self, schema: Any, encoding: str) -> Any:
        if encoding == "cdr":
            ros = need("mcap_ros2.decoder", "import of ROS 2 messages", "mcap-ros2-support")
            return ros.DecoderFactory().decoder_for(encoding, schema)
        if encoding == "protobuf":
            return _protobuf_class(schema).FromString
        return None


def _protobuf_class(schema: Any) -> Any:
    """The class of messages that a schema with its .proto files describes."""
    from google.protobuf import descriptor_pb2, descriptor_pool, message_factory

    pool, left = descriptor_pool.DescriptorPool(), {file.name: file for file in descriptor_pb2.FileDescriptorSet.FromString(schema.data).file}

    def add(name: str) -> None:
        if name in left:
            file = left.pop(name)
            for dependency in file.dependency:
                add(dependency)
            pool.Add(file)

    for name in list(left):
        add(name)
    descriptor = pool.FindMessageTypeByName(schema.name)
    if hasattr(message_factory, "GetMessageClass"):
        return message_factory.GetMessageClass(descriptor)
    return message_factory.MessageFactory(pool).GetPrototype(descriptor)  # type: ignore[attr-defined]  # protobuf before 4.22
