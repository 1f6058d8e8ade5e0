"""Finished datasets of `touchstone stream`, read from their shards: every byte that is exported was checked before."""

from __future__ import annotations

import csv
import dataclasses
import hashlib
import io
import json
import pathlib
import tarfile
from collections.abc import Collection, Iterator
from typing import Any

import numpy as np

from ..errors import InvalidRequest, NotFound, Refused
from ..measurements import VECTORS
from ..units import lab_array, si_value
from .table import ROWS_OF_A_BATCH, Column, Table, Values, need, sha256_of

_SI_NAMES = {"contact_time_us": "contact_time_s", "descriptor_us": "descriptor_s", "target_mm": "target_m",
             "standoff_mm": "standoff_m", "speed_mm_s": "speed_m_s"}
_IN_TEXT = ("target_mm", "approach", "lateral", "standoff_mm", "speed_mm_s")
_VERIFY = "`touchstone dataset verify` says what is wrong"


@dataclasses.dataclass(frozen=True)
class DatasetFolder(Table):
    folder: pathlib.Path = pathlib.Path()
    format: str = "webdataset"
    shards: tuple[dict[str, Any], ...] = ()

    def batches(self) -> Iterator[dict[str, Values]]:
        read = {"webdataset": self._from_tar, "folder": self._from_folder, "hdf5": self._from_hdf5}[self.format]
        for shard in self.shards:
            path = self.folder / shard["name"]
            _check(path, shard)
            rows = 0
            for batch in read(path):
                batch["object_name"] = [self.objects[k] for k in batch["object"]] if "object" in batch else []
                rows += len(next(iter(batch.values())))
                yield {column.name: batch[column.name] for column in self.columns}
            if rows != shard["samples"]:
                raise Refused(f"{path}: {rows} samples, but dataset.json says {shard['samples']}; {_VERIFY}.")

    def _gathered(self, samples: list[dict[str, Any]], decimals: Collection[str]) -> dict[str, Values]:
        """Samples as columns; those in `decimals` were written as text."""
        batch: dict[str, Values] = {}
        for column in self.columns:
            if column.name == "object_name":
                continue
            values = [sample[column.name] for sample in samples]
            if column.name in decimals:
                values = _as_streamed(column.name, values)
            batch[column.name] = values if column.encoding else np.array(values, column.dtype).reshape(len(values), *column.shape)
        return batch

    def _from_tar(self, path: pathlib.Path) -> Iterator[dict[str, Values]]:
        """Files KEY.json, KEY.COLUMN.npy and KEY.image.png of each sample stand together."""
        samples: list[dict[str, Any]] = []
        key, arrays = None, _NpyReader()
        with tarfile.open(path, "r|") as archive:
            for member in archive:
                file = archive.extractfile(member)
                if file is None:
                    continue
                data = file.read()
                sample, _, place = member.name.partition(".")
                if sample != key:
                    if len(samples) == ROWS_OF_A_BATCH:
                        yield self._gathered(samples, _IN_TEXT)
                        samples = []
                    samples.append({})
                    key = sample
                if place == "json":
                    samples[-1].update(self._described(json.loads(data, parse_int=_whole_number)))
                elif place.endswith(".npy"):
                    samples[-1][place[:-4]] = arrays.read(data)
                else:
                    samples[-1][place.rpartition(".")[0]] = data
        if samples:
            yield self._gathered(samples, _IN_TEXT)

    def _described(self, sample: dict[str, Any]) -> dict[str, Any]:
        if "object" in sample:
            sample["object"] = self.objects.index(sample["object"])
        return sample

    def _from_folder(self, path: pathlib.Path) -> Iterator[dict[str, Values]]:
        arrays = {file.stem: np.load(file, mmap_mode="r", allow_pickle=False) for file in path.glob("*.npy")}
        with open(path / "touches.csv", newline="", encoding="utf-8") as file:
            rows = list(csv.DictReader(file))
        decimals = set(_IN_TEXT)
        # A dataset without contact times has its descriptors in their columns.
        in_csv = "contact_time_us" if self.column("contact_time_us") else "descriptor_us"
        pictures = sorted(file for file in path.iterdir() if file.suffix in (".png", ".jpg", ".jpeg"))
        for begin in range(0, len(rows), ROWS_OF_A_BATCH):
            part, samples = rows[begin : begin + ROWS_OF_A_BATCH], []
            for k, row in enumerate(part, begin):
                sample: dict[str, Any] = {name: array[k] for name, array in arrays.items()}
                sample |= {"index": int(row["touch"]), "object": self.objects.index(row["object"])}
                sample |= {name: [row[part] for part in parts] for name, parts in VECTORS.items() if parts[0] in row}
                sample |= {name: row[name] for name in ("standoff_mm", "speed_mm_s") if name in row}
                times = [row[name] for name in row if name.startswith("t_") and name.endswith("_us")]
                if times and in_csv not in sample:
                    sample[in_csv] = [time or "nan" for time in times]
                    decimals.add(in_csv)
                if pictures:
                    sample["image"] = pictures[k].read_bytes()
                samples.append(sample)
            yield self._gathered(samples, decimals)

    def _from_hdf5(self, path: pathlib.Path) -> Iterator[dict[str, Values]]:
        with need("h5py", "reading HDF5").File(path, "r") as file:
            names = [column.name for column in self.columns if column.name != "object_name"]
            rows = len(file[names[0]])
            for begin in range(0, rows, ROWS_OF_A_BATCH):
                yield {name: file[name][begin : begin + ROWS_OF_A_BATCH] for name in names}


class _NpyReader:
    """Arrays of .npy files, most of which begin alike: what a beginning says is read once."""

    def __init__(self) -> None:
        self._kinds: dict[bytes, tuple[np.dtype[Any], tuple[int, ...]]] = {}

    def read(self, data: bytes) -> Any:
        head = data[: 10 + int.from_bytes(data[8:10], "little")]  # of version 1.0
        if head not in self._kinds:
            array = np.load(io.BytesIO(data), allow_pickle=False)
            if data[6:8] != b"\x01\x00" or b"'fortran_order': True" in head:
                return array
            self._kinds[head] = (array.dtype, array.shape)
        dtype, shape = self._kinds[head]
        return np.frombuffer(data, dtype, offset=len(head)).reshape(shape)


def _as_streamed(name: str, decimals: Any) -> Any:
    """The float32 values of which the program wrote the decimals: those of SI, and from them the lab's as other formats have them."""
    si_name = _SI_NAMES.get(name, name)
    return lab_array(si_name, np.asarray(si_value(si_name, np.asarray(decimals, np.float64)), np.float32))


def _whole_number(text: str) -> int | float:
    """Of JSON, where -0 is a float: the program writes every number as short as it can."""
    return -0.0 if text == "-0" else int(text)


def _check(path: pathlib.Path, shard: dict[str, Any]) -> None:
    """The shard's bytes are those that were written."""
    try:
        if path.is_dir():
            files = sorted(path.iterdir())
            listing = "".join(f"{sha256_of(file)}  {file.name}\n" for file in files)
            found = hashlib.sha256(listing.encode()).hexdigest()
        else:
            found = sha256_of(path)
    except FileNotFoundError:
        raise Refused(f"{path} is missing; run the command that made the dataset again: it makes what is missing.") from None
    if found != shard["sha256"]:
        raise Refused(f"{path} is damaged or was changed: its bytes are not those of dataset.json; {_VERIFY}.")


def open_dataset(folder: pathlib.Path) -> DatasetFolder:
    """The dataset in a folder. NotFound without dataset.json, Refused if it is not finished."""
    path = folder / "dataset.json"
    try:
        text = path.read_text(encoding="utf-8")
        manifest = json.loads(text)
    except FileNotFoundError:
        if any(folder.glob("dataset.job-*.json")):
            raise Refused(f"{folder} is written by several jobs and not finished: run `touchstone stream --like` with one of its "
                          "dataset.job-*.json and the same --out, which makes what is missing.") from None
        raise NotFound(f"{folder}: there is no dataset.json; the folder of a finished `touchstone stream`, of photographs (images.csv), "
                       "a measurement file (.csv) or a journal (.db) was expected.") from None
    except ValueError as error:
        raise InvalidRequest(f"{path} is no JSON text: {error}.") from None
    if manifest.get("touchstone") != "dataset/1":
        raise InvalidRequest(f"{path}: its format is {manifest.get('touchstone')!r}, and 'dataset/1' was expected.")
    shards = sorted(manifest["shards"], key=lambda shard: int(shard["first_index"]))
    written = sum(shard["samples"] for shard in shards)
    if manifest["state"] != "complete" or written != manifest["samples"]:
        raise Refused(f"{folder} is not finished: {written} of {manifest['samples']} samples. Run the command that made it again; it "
                      "resumes.")
    columns = []
    for column in manifest["columns"]:
        encoding = {"png": "png", "jpg": "jpeg", "jpeg": "jpeg"}[column["place"].rpartition(".")[2]] if column["type"] == "file" else ""
        columns.append(Column(column["name"], "uint8" if encoding else column["type"], tuple(column["shape"]), column["unit"], encoding))
        if column["name"] == "object":
            columns.append(Column("object_name", "text"))
    kept = {name: manifest[name] for name in ("seed", "specification", "model", "objects", "renderer", "versions") if name in manifest}
    return DatasetFolder(folder.resolve().name, manifest["samples"], tuple(columns), tuple(entry["name"] for entry in manifest["objects"]),
                         {"kind": "dataset", **kept}, text, folder, manifest["format"], tuple(shards))
