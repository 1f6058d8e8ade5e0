"""A recording of another tool as a measured set."""

from __future__ import annotations

import dataclasses
import os
import pathlib
import tempfile
from typing import Any

import numpy as np

from ..errors import InvalidRequest, NotFound
from ..measurements import Row, write_measurements
from ..plans import touches as make_touches
from ..whole_file import check_target, whole_file
from . import mapping as mappings, sessions
from .mapping import UNIT_WITHIN, Mapping
from .recordings import Recording, open_recording
from .touch_columns import Array, TouchColumns


class OpenQuestions(InvalidRequest):
    """The mapping leaves something open.

    Attributes:
      questions: each in words, with the candidates.
    """

    def __init__(self, path: pathlib.Path, questions: list[str]):
        self.questions = questions
        super().__init__(f"{path}: what is not said is not guessed. Answer in the mapping file (mapping=FILE):\n" + "\n".join(
            f"  - {question}" for question in questions))


@dataclasses.dataclass(frozen=True)
class Imported:
    """A recording as a measured set.

    Attributes:
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

    Args:
      source: an MCAP file, the folder of a ROS 2 bag, a LeRobot dataset v3, a Parquet file or a folder of them.
      out: a measurement file (.csv) or a journal (.db).
      mapping: the mapping file, or its entries; what this program itself named needs none.
      force: replace `out` if it exists.

    Raises:
      OpenQuestions: the mapping leaves something open.
      InvalidRequest: with entry, field and what would be right.
    """
    path, target = pathlib.Path(source), pathlib.Path(out)
    if target.suffix not in (".csv", ".db"):
        raise InvalidRequest(f"out: '{target}' does not say the format; a name that ends in .csv or .db was expected.")
    check_target(target, force)
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
            raise InvalidRequest(f"{source}: what the mapping makes of it is no measured set: {str(error).replace(f'{csv}:', 'line ')}") from None
        if target.suffix == ".db":
            with whole_file(target, "wb") as file:
                file.write(journal.read_bytes())
        else:
            write_measurements(target, rows, force=True)


def _rows(recording: Recording, mapping: Mapping) -> tuple[list[Row], list[str]]:
    read = TouchColumns(recording, mapping)
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
    if abs(length - 1) > UNIT_WITHIN:
        raise InvalidRequest(f"message {k}: {name} {vector.tolist()} has length {length:.4g}; a unit vector was expected.")
    return vector / length
