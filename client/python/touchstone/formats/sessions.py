"""Measured sets as tables: a measurement file, the journal of a rig's session, a folder of photographs."""

from __future__ import annotations

import contextlib
import dataclasses
import functools
import json
import os
import pathlib
import re
import shutil
import subprocess
import tempfile
from collections.abc import Iterator
from typing import Any

import numpy as np

from ..errors import InvalidRequest, NotFound, Refused
from ..measurements import VECTORS, number_in
from ..own_server import find_server
from ..plain_csv import read_csv
from .table import ROWS_OF_A_BATCH, Column, Table, Values, need, sha256_of

_POSES = {f"{when}{name}": tuple(f"{when}{name.removesuffix('_mm')}_{axis}{'_mm' if name.endswith('_mm') else ''}" for axis in "xyz")
          for when in ("", "measured_") for name in ("eye_mm", "at_mm", "up")}
_UNITS = ("mm_s", "mm", "us", "s", "deg")


@dataclasses.dataclass(frozen=True)
class MeasuredSet(Table):
    values: dict[str, Any] = dataclasses.field(default_factory=dict)
    folder: pathlib.Path = pathlib.Path()

    def batches(self) -> Iterator[dict[str, Values]]:
        for begin in range(0, self.rows, ROWS_OF_A_BATCH):
            batch = {name: values[begin : begin + ROWS_OF_A_BATCH] for name, values in self.values.items()}
            if "image" in batch:
                batch["image"] = [(self.folder / file).read_bytes() for file in batch.pop("file")]
            yield {column.name: batch[column.name] for column in self.columns}


def open_measurements(path: pathlib.Path, name: str = "") -> MeasuredSet:
    """A measurement file, checked as far as a table needs it: numbers are numbers."""
    header, lines = _read_csv(path)
    return _as_table(path, name or path.stem, header, lines, "measurement file", {})


def open_photographs(folder: pathlib.Path) -> MeasuredSet:
    """A folder with images.csv."""
    header, lines = _read_csv(folder / "images.csv")
    if "file" not in header:
        raise InvalidRequest(f"{folder / 'images.csv'}:1: column 'file' is missing; it names the pictures.")
    files = [row[header.index("file")] for _, row in lines]
    for (line, _), file in zip(lines, files):
        if not (folder / file).is_file() or not (folder / file).resolve().is_relative_to(folder.resolve()):
            raise InvalidRequest(f"{folder / 'images.csv'}:{line}: file '{file}' is not in the folder.")
    first = need("PIL.Image", "reading pictures", "pillow").open(folder / files[0])
    shape = (first.height, first.width, len(first.getbands()))
    camera = (folder / "camera.yaml").read_text(encoding="utf-8") if (folder / "camera.yaml").exists() else ""
    return _as_table(folder / "images.csv", folder.resolve().name, header, lines, "photographs", {"camera": camera}, shape)


def _read_csv(path: pathlib.Path) -> tuple[list[str], list[tuple[int, list[str]]]]:
    header, lines = read_csv(path)
    if not lines:
        raise InvalidRequest(f"{path} has no rows; a header and a row per touch were expected.")
    return header, lines


def _as_table(path: pathlib.Path, name: str, header: list[str], lines: list[tuple[int, list[str]]], kind: str, more: dict[str, str],
              picture: tuple[int, ...] = ()) -> MeasuredSet:
    columns, values = [], {}
    times = tuple(part for part in header if re.fullmatch(r"t_\w+_us", part))
    groups = {**VECTORS, **_POSES, "contact_time_us": times}
    left = list(header)
    numbers = {}
    for part in header:
        if part not in ("object", "file", "face"):
            at = header.index(part)
            numbers[part] = np.array([functools.partial(number_in, f"{path}:{line}", {part: row[at]})(part, float("nan")) for line, row in lines])
    for group, parts in groups.items():
        if parts and all(part in left for part in parts):
            left = [part for part in left if part not in parts]
            columns.append(Column(group, "float64", (len(parts),), _unit(group)))
            values[group] = np.stack([numbers[part] for part in parts], 1)
    single = []
    for part in left:
        if part in numbers:
            whole = part in ("touch", "image") and bool(np.all(numbers[part] == np.round(numbers[part])))
            label = "image_number" if part == "image" else part
            single.append(Column(label, "int64" if whole else "float64", (), _unit(part)))
            values[label] = numbers[part].astype(np.int64) if whole else numbers[part]
        else:
            label = {"object": "object_name"}.get(part, part)
            if not (picture and part == "file"):
                single.append(Column(label, "text"))
            values[label] = [row[header.index(part)] for _, row in lines]
    columns = single + columns
    if picture:
        columns.append(Column("image", "uint8", picture, "", "png"))
        values["image"] = values["file"]
    found = sha256_of(path)
    return MeasuredSet(name, len(lines), tuple(columns), tuple(dict.fromkeys(values.get("object_name", []))),
                       {"kind": kind, "file": path.name, "sha256": found, **more}, "", values, path.parent)


def _unit(name: str) -> str:
    return next((unit.replace("mm_s", "mm/s") for unit in _UNITS if name.endswith("_" + unit)), "")


# --- Journals, which the program reads

def program() -> str:
    """The command line: TOUCHSTONE_PROGRAM, which it sets where it starts this, else what lies beside the server, else in PATH."""
    named = os.environ.get("TOUCHSTONE_PROGRAM")
    beside = ""
    with contextlib.suppress(ConnectionError):
        beside = str(pathlib.Path(find_server()).parent / "touchstone")
    for found in (named, beside, shutil.which("touchstone")):
        if found and os.access(found, os.X_OK):
            return found
    raise NotFound("The program touchstone is not in PATH, and reads the journals of sessions. Put it there, or name it in TOUCHSTONE_PROGRAM.")


def ask_program(*words: str | os.PathLike[str]) -> dict[str, Any]:
    """What a command with --json says; its own error, if it fails."""
    said: dict[str, Any] = json.loads(run_program(*words, "--json"))
    return said


def run_program(*words: str | os.PathLike[str]) -> str:
    """Runs a command and gives what it prints; its own error, if it fails."""
    done = subprocess.run([program(), *words, "--quiet"], capture_output=True, text=True, check=False)
    if done.returncode != 0:
        message = done.stderr.strip().removeprefix("touchstone: error: ") or f"exit status {done.returncode}"
        raise (InvalidRequest if done.returncode == 2 else Refused)(f"touchstone {words[0]} {words[1]}: {message}")
    return done.stdout


@contextlib.contextmanager
def session_as(path: pathlib.Path, ending: str) -> Iterator[pathlib.Path]:
    """A session's journal, or a measurement file, as the .csv or .h5 of `touchstone session export`."""
    with tempfile.TemporaryDirectory(prefix="touchstone-export-") as folder:
        journal = path
        if path.suffix == ".csv":
            journal = pathlib.Path(folder) / f"{path.stem}.db"
            run_program("session", "import", path, "-o", journal)
        exported = pathlib.Path(folder) / f"{path.stem}{ending}"
        run_program("session", "export", journal, "-o", exported)
        yield exported
