"""Plans and measurement files: CSV, one touch a row, millimetres, microseconds, mm/s."""

from __future__ import annotations

import csv
import dataclasses
import functools
import math
import os
import re
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from . import arguments
from .batch import Batch
from .errors import InvalidRequest
from .plain_csv import read_csv
from .plans import Touches, touches as make_touches
from .printable import printable
from .whole_file import check_target, whole_file

VECTORS = {"target_mm": ("target_x_mm", "target_y_mm", "target_z_mm"),
            "approach": ("approach_x", "approach_y", "approach_z"),
            "lateral": ("lateral_x", "lateral_y", "lateral_z")}
_HEAD = ["touch", "object", "speed_mm_s", "standoff_mm", *(name for names in VECTORS.values() for name in names)]
# The covariate that marks what an emulator made.
EMULATED = "cov_emulated"
_MORE = ("session_time_s", "round", "face")
# Lowest and highest value of a column, and what that is in words.
_RANGES = {"target_mm": (-1e5, 1e5, "a coordinate within 100000 mm of the object's origin"), "standoff_mm": (0, 1e4, "a distance from 0 to 10000 mm"),
           "speed_mm_s": (0, 1e4, "a speed above 0 and at most 10000 mm/s"), "session_time_s": (0, 1e9, "seconds from 0 to 1e9")}
_UNIT_WITHIN = 1e-3
_MAX_TIME_US = 1e12


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
      round: the number of the repeat; None: unknown.
      face: the number of the face of the object's box; None: unknown.
    """

    touch: int
    object: str
    command: Touches
    time_us: tuple[float, ...] = ()
    session_time_s: float | None = None
    result: Batch | None = None
    round: int | None = None
    face: int | None = None


@arguments.checked
def read_plan(path: str | os.PathLike[str]) -> list[Row]:
    """The rows of a plan or measurement file that has poses: CSV with the columns of client/python/README.md, mm, us, mm/s.

    Read as the command line reads it: semicolons, tabs, decimal commas and UTF-16 as spreadsheets write them are as good.

    Raises:
      InvalidRequest: the file cannot be read, or is none; the message names file, line and column.
    """
    header, lines = read_csv(path)
    return rows_of(header, lines, os.fspath(path))


def rows_of(header: Sequence[str], lines: Sequence[tuple[int, list[str]]], origin: str) -> list[Row]:
    """The rows of what plain_csv read, checked as server/session/measurements checks them; `origin` begins every error."""
    times = _checked_header(header, f"{origin}:1")
    covariates = [name for name in header if name.startswith("cov_")]
    if not lines:
        raise InvalidRequest(f"{origin}:2: the file has a header but no touch; rows were expected.")
    rows: list[Row] = []
    seen: dict[int, int] = {}
    for line, cells in lines:
        place, row = f"{origin}:{line}", dict(zip(header, cells))
        number = functools.partial(number_in, place, row)
        touch = _whole(place, row, "touch")
        if touch in seen:
            raise InvalidRequest(f"{place}: touch {touch} stands on line {seen[touch]} already; every touch needs a number of its own.")
        seen[touch] = line
        if not row["object"]:
            raise InvalidRequest(f"{place}: object is empty; a name was expected.")
        columns: dict[str, Any] = {name: [_within(place, row, part, *_RANGES.get(name, (-1.001, 1.001, ""))) for part in parts]
                                   for name, parts in VECTORS.items()}
        columns.update({name: _within(place, row, name, -math.inf, math.inf, "") for name in covariates if row[name]})
        session_time_s = _within(place, row, "session_time_s", *_RANGES["session_time_s"]) if "session_time_s" in row else None
        if session_time_s is not None:
            columns["session_time_s"] = session_time_s
        speed = _within(place, row, "speed_mm_s", *_RANGES["speed_mm_s"])
        if speed == 0:
            raise InvalidRequest(f"{place}: speed_mm_s is 0; a speed above 0 and at most 10000 mm/s was expected.")
        _check_vectors(place, columns)
        command = make_touches(standoff_mm=_within(place, row, "standoff_mm", *_RANGES["standoff_mm"]), speed_mm_s=speed, **columns)
        for name in times:
            if row[name] and not 0 <= number(name) <= _MAX_TIME_US:
                raise InvalidRequest(f"{place}: {name} is '{row[name]}'; a time from 0 to {_MAX_TIME_US:g} us was expected, or nothing where the "
                                     "finger reported "
                                     "nothing.")
        rows.append(Row(touch, row["object"], command, tuple(number(name, float("nan")) for name in times), session_time_s,
                        round=_whole(place, row, "round") if "round" in row else None,
                        face=_whole(place, row, "face") if "face" in row else None))
    return rows


def _checked_header(header: Sequence[str], place: str) -> list[str]:
    """Columns of times, in the order of the fingers; every column is known and stands once, and none is missing."""
    for name in _HEAD:
        if name not in header:
            raise InvalidRequest(f"{place}: column '{name}' is missing; a plan needs the poses.")
    for at, name in enumerate(header):
        if name in header[:at]:
            raise InvalidRequest(f"{place}: column '{name}' stands twice in the header.")
        if name not in _HEAD and name not in _MORE and not re.fullmatch(r"cov_\w+|t_([lmr]|\d+)_us", name, re.ASCII):
            raise InvalidRequest(f"{place}: column '{printable(name)}' is no column of a measurement file (further numbers have names that begin "
                                 "with cov_).")
    times = [name for name in header if name.startswith("t_")]
    wanted = ["t_l_us", "t_m_us", "t_r_us"] if "t_l_us" in times else [f"t_{k}_us" for k in range(len(times))]
    if sorted(times) != sorted(wanted):
        raise InvalidRequest(f"{place}: time columns must be t_l_us,t_m_us,t_r_us or t_0_us,t_1_us,... without a gap; there are "
                             f"{', '.join(times)}.")
    return wanted if times else []


def _within(place: str, row: Mapping[str, str], name: str, low: float, high: float, expected: str) -> float:
    value = number_in(place, row, name)
    if not math.isfinite(value):
        raise InvalidRequest(f"{place}: {name} is '{row[name]}', not a finite number.")
    if not low <= value <= high:
        raise InvalidRequest(f"{place}: {name} is {row[name]}, out of range; {expected or 'a part of a unit vector'} was expected.")
    return value


def _whole(place: str, row: Mapping[str, str], name: str) -> int:
    value = number_in(place, row, name)
    if not (0 <= value <= 9e15 and value == math.floor(value)):
        raise InvalidRequest(f"{place}: {name} is {row[name]}, not a whole number from 0 on.")
    return int(value)


def _check_vectors(place: str, columns: Mapping[str, Any]) -> None:
    """approach and lateral are unit vectors, perpendicular to each other: within 0.001, as everywhere."""
    for name in ("approach", "lateral"):
        length = math.hypot(*columns[name])
        if abs(length - 1) > _UNIT_WITHIN:
            raise InvalidRequest(f"{place}: {name}_x, {name}_y, {name}_z have length {length:.6g}; a unit vector was expected (within 0.001).")
    dot = sum(a * b for a, b in zip(columns["approach"], columns["lateral"]))
    if abs(dot) > _UNIT_WITHIN:
        raise InvalidRequest(f"{place}: lateral is not perpendicular to approach: their dot product is {dot:.6g}; 0 was expected (within 0.001).")


def number_in(place: str, row: Mapping[str, str], name: str, empty: float | None = None) -> float:
    """The number in a row's column; `empty` where nothing is written, if that may be."""
    text = row[name]
    try:
        if "_" in text:  # which Python reads over
            raise ValueError(text)
        return empty if not text and empty is not None else float(text)
    except ValueError:
        raise InvalidRequest(f"{place}: {name} is '{printable(text)}', not a number.") from None


@arguments.checked
def write_measurements(path: str | os.PathLike[str], rows: Sequence[Row], *, force: bool = False) -> None:
    """Writes a measurement file atomically: it is written beside the path and renamed.

    Args:
      force: replace a file that is there.

    Raises:
      InvalidRequest: there is no row, one has another number of times than the first one, or the file is there.
      NotFound: the folder that it would stand in is not there.
      OSError: the file cannot be written; what was there stays.
    """
    rows = list(rows)
    if not rows:
        raise InvalidRequest(f"{os.fspath(path)}: there is no touch to write; what is there stays.")
    fingers = len(rows[0].time_us)
    names = ["l", "m", "r"] if fingers == 3 else [str(k) for k in range(fingers)]
    covariates = sorted({name for row in rows for name in row.command.covariates})
    has_time = any(row.session_time_s is not None for row in rows)
    more = [name for name in ("round", "face") if all(getattr(row, name) is not None for row in rows)]
    for row in rows:
        if len(row.time_us) != fingers:
            raise InvalidRequest(f"Touch {row.touch} has {len(row.time_us)} times, but the first one has {fingers}.")

    check_target(path, force)
    with whole_file(path, newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow([*_HEAD, *(f"t_{name}_us" for name in names), *(["session_time_s"] if has_time else []),
                         *more, *covariates])
        writer.writerows(_cells(row, has_time, more, covariates) for row in rows)


def _cells(row: Row, has_time: bool, more: Sequence[str], covariates: Sequence[str]) -> Iterator[str]:
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
    for name in more:
        yield str(getattr(row, name))
    for name in covariates:
        yield text(row.command.covariates[name][0]) if name in row.command.covariates else ""
