"""A table as an MCAP file. Recordings of a rig, with their own channels, are written by touchstone.mcap.

Channels: /touch, a row's numbers and names as JSON; /camera, foxglove.CompressedImage; /depth, /mask: foxglove.RawImage. A row is
at its session time or, where it has none, at the plan's interval, else one second after the row before it.
"""

from __future__ import annotations

import base64
import json
import math
import pathlib
from collections.abc import Iterator
from typing import Any

import numpy as np

from ..mcap import COMPRESSED_IMAGE, SECOND_NS, TIME, time_of
from ..version import __version__
from .card import write_card
from .table import Column, Table, file_of, need

_RAW_IMAGE = {
    "title": "foxglove.RawImage", "type": "object",
    "properties": {"timestamp": TIME, "frame_id": {"type": "string"}, "width": {"type": "integer"}, "height": {"type": "integer"},
                   "encoding": {"type": "string"}, "step": {"type": "integer"}, "data": {"type": "string", "contentEncoding": "base64"}},
}
_RAW_ENCODINGS = {"float32": "32FC1", "uint8": "mono8"}


def write_mcap(table: Table, folder: pathlib.Path) -> None:
    writer_module = need("mcap.writer", "export to MCAP", "mcap")
    pictures = {column.name: column for column in table.columns
                if column.is_image or (len(column.shape) == 2 and column.name in ("depth_mm", "mask"))}
    with open(folder / "data.mcap", "wb") as stream:
        writer = writer_module.Writer(stream)
        writer.start(profile="", library=f"touchstone {__version__}")
        writer.add_metadata("touchstone", {name: value if isinstance(value, str) else json.dumps(value)
                                           for name, value in table.provenance.items()})
        channels = {}
        for topic, schema in _channels(table, pictures):
            schema_id = writer.register_schema(name=schema["title"], encoding="jsonschema", data=json.dumps(schema).encode())
            channels[topic] = writer.register_channel(topic=topic, message_encoding="json", schema_id=schema_id)
        for row, (at_s, sample) in enumerate(_samples(table)):
            for topic, message in _messages(table, pictures, at_s, sample):
                at_ns = round(at_s * SECOND_NS)
                writer.add_message(channel_id=channels[topic], log_time=at_ns, publish_time=at_ns, sequence=row,
                                   data=json.dumps(message, allow_nan=False).encode())
        writer.finish()
    (folder / "README.md").write_text(write_card(
        table, "The rows are in `data.mcap`: channel `/touch` is JSON (a finger that reported nothing is null), `/camera`, `/depth` and "
        "`/mask` are Foxglove's images."), encoding="utf-8")


def _channels(table: Table, pictures: dict[str, Column]) -> Iterator[tuple[str, dict[str, Any]]]:
    properties = {}
    for column in table.columns:
        if column.name not in pictures:
            one = {"type": "string" if column.dtype == "text" else "number" if column.dtype.startswith("float") else "integer"}
            for length in reversed(column.shape):
                one = {"type": "array", "items": one, "minItems": length, "maxItems": length}  # type: ignore[dict-item]  # JSON
            properties[column.name] = {**one, "description": " ".join(filter(None, [column.meaning, f"[{column.unit}]" * bool(column.unit)]))}
    yield "/touch", {"title": "touchstone.Touch", "type": "object", "properties": properties}
    for column in pictures.values():
        yield _topic(column), COMPRESSED_IMAGE if column.is_image else _RAW_IMAGE


def _topic(column: Column) -> str:
    return {"image": "/camera", "depth_mm": "/depth"}.get(column.name, f"/{column.name}")


def _samples(table: Table) -> Iterator[tuple[float, dict[str, Any]]]:
    interval_s = table.provenance.get("specification", {}).get("plan", {}).get("touch_interval_s", 0) or 1
    row = 0
    for batch in table.batches():
        for k in range(len(next(iter(batch.values())))):
            sample = {name: values[k] for name, values in batch.items()}
            at_s = float(sample.get("session_time_s", math.nan))
            yield (at_s if math.isfinite(at_s) and at_s >= 0 else row * interval_s), sample
            row += 1


def _messages(table: Table, pictures: dict[str, Column], at_s: float, sample: dict[str, Any]) -> Iterator[tuple[str, dict[str, Any]]]:
    yield "/touch", {column.name: _plain(sample[column.name]) for column in table.columns if column.name not in pictures}
    for column in pictures.values():
        value = sample[column.name]
        head = {"timestamp": time_of(at_s), "frame_id": "camera"}
        if column.is_image:
            yield _topic(column), {**head, "format": column.encoding or "png", "data": base64.b64encode(file_of(value)).decode()}
        else:
            height, width = column.shape
            yield _topic(column), {**head, "width": width, "height": height, "encoding": _RAW_ENCODINGS[column.dtype],
                                   "step": width * value.itemsize, "data": base64.b64encode(np.ascontiguousarray(value).tobytes()).decode()}


def _plain(value: Any) -> Any:
    """As JSON takes it: every float32 is a double, which Python writes with as many digits as tell it from all others."""
    if isinstance(value, np.ndarray):
        return [_plain(part) for part in value]
    if isinstance(value, (float, np.floating)):
        return float(value) if math.isfinite(value) else None
    return value if isinstance(value, str) else int(value)
