"""Plans and measurement files: CSV, one touch a row, millimetres, microseconds, mm/s."""

from __future__ import annotations

import csv
import dataclasses
import functools
import os
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from .batch import Batch
from .errors import InvalidRequest
from .plans import Touches, touches as make_touches
from .whole_file import check_target, whole_file

VECTORS = {"target_mm": ("target_x_mm", "target_y_mm", "target_z_mm"),
            "approach": ("approach_x", "approach_y", "approach_z"),
            "lateral": ("lateral_x", "lateral_y", "lateral_z")}
_HEAD = ["touch", "object", "speed_mm_s", "standoff_mm", *(name for names in VECTORS.values() for name in names)]


@dataclasses.dataclass(frozen=True)
class Row:
    """One touch of a plan or of a measured set.

    Attributes:
      touch: its number in the file.
      object: what is touched.
      command: the touch, as Touches of one row.
      time_us: contact times, one per finger, NaN where it reported nothing; empty in a plan.
      session_time_s: when the approach began since the session did; None: unknown.
      result: what the source said of it, as a Batch of one row; None in a file.
    """

    touch: int
    object: str
    command: Touches
    time_us: tuple[float, ...] = ()
    session_time_s: float | None = None
    result: Batch | None = None


def read_plan(path: str | os.PathLike[str]) -> list[Row]:
    """The rows of a plan or measurement file that has poses: CSV with the columns of client/python/README.md, mm, us, mm/s.

    Raises:
      InvalidRequest: the file cannot be read, or is none; the message names file, line and column.
    """
    try:
        with open(path, newline="", encoding="utf-8") as file:
            reader = csv.reader(file)
            header = next(reader, [])
            lines = [(reader.line_num, row) for row in reader if row]
    except OSError as error:
        raise InvalidRequest(f"{os.fspath(path)}: {error.strerror}.") from None
    except UnicodeDecodeError:
        raise InvalidRequest(f"{os.fspath(path)} is not UTF-8 text.") from None
    for name in _HEAD[1:]:
        if name not in header:
            raise InvalidRequest(f"{os.fspath(path)}:1: column '{name}' is missing; a plan needs the poses.")
    times = [name for name in header if name.startswith("t_") and name.endswith("_us")]
    covariates = [name for name in header if name.startswith("cov_")]
    rows: list[Row] = []
    for line, cells in lines:
        if len(cells) != len(header):
            raise InvalidRequest(f"{os.fspath(path)}:{line}: {len(cells)} fields, but the header has {len(header)}.")
        row = dict(zip(header, cells))
        number = functools.partial(number_in, f"{os.fspath(path)}:{line}", row)
        columns: dict[str, Any] = {name: [number(part) for part in parts] for name, parts in VECTORS.items()}
        columns.update({name: number(name) for name in covariates if row[name]})
        session_time_s = number("session_time_s") if row.get("session_time_s") else None
        if session_time_s is not None:
            columns["session_time_s"] = session_time_s
        command = make_touches(standoff_mm=number("standoff_mm"), speed_mm_s=number("speed_mm_s"), **columns)
        touch = int(number("touch")) if "touch" in row else len(rows)
        rows.append(Row(touch, row["object"], command, tuple(number(name, float("nan")) for name in times),
                        session_time_s))
    return rows


def number_in(place: str, row: Mapping[str, str], name: str, empty: float | None = None) -> float:
    """The number in a row's column; `empty` where nothing is written, if that may be."""
    text = row[name]
    try:
        return empty if not text and empty is not None else float(text)
    except ValueError:
        raise InvalidRequest(f"{place}: {name} is '{text}', not a number.") from None


def write_measurements(path: str | os.PathLike[str], rows: Sequence[Row], *, force: bool = False) -> None:
    """Writes a measurement file atomically: it is written beside the path and renamed.

    Args:
      force: replace a file that is there.

    Raises:
      InvalidRequest: a row has another number of times than the first one, or the file is there.
      NotFound: the folder that it would stand in is not there.
      OSError: the file cannot be written; what was there stays.
    """
    rows = list(rows)
    fingers = len(rows[0].time_us) if rows else 0
    names = ["l", "m", "r"] if fingers == 3 else [str(k) for k in range(fingers)]
    covariates = sorted({name for row in rows for name in row.command.covariates})
    has_time = any(row.session_time_s is not None for row in rows)
    for row in rows:
        if len(row.time_us) != fingers:
            raise InvalidRequest(f"Touch {row.touch} has {len(row.time_us)} times, but the first one has {fingers}.")

    check_target(path, force)
    with whole_file(path, newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow([*_HEAD, *(f"t_{name}_us" for name in names), *(["session_time_s"] if has_time else []),
                         *covariates])
        writer.writerows(_cells(row, has_time, covariates) for row in rows)


def _cells(row: Row, has_time: bool, covariates: Sequence[str]) -> Iterator[str]:
    # Three units in the last place of a double are lost in converting; 15 digits are what was meant.
    def text(value: float) -> str:
        return "" if np.isnan(value) else repr(float(f"{value:.15g}"))

    yield str(row.touch)
    yield row.object
    yield text(row.command.speed_mm_s[0])
    yield text(row.command.standoff_mm[0])
    for name in VECTORS:
        # Directions keep every digit: their length is checked.
        for value in getattr(row.command, name)[0]:
            yield text(value) if name == "target_mm" else repr(float(value))
    for value in row.time_us:
        yield text(value)
    if has_time:
        yield text(float("nan") if row.session_time_s is None else row.session_time_s)
    for name in covariates:
        yield text(row.command.covariates[name][0]) if name in row.command.covariates else ""
