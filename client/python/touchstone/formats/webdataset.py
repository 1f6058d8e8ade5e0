"""WebDataset: tar files whose members KEY.json, KEY.COLUMN.npy and KEY.image.png belong to one sample, as `touchstone stream`
writes them."""

from __future__ import annotations

import io
import json
import pathlib
import shutil
import tarfile
from typing import Any

import numpy as np

from .card import write_card
from .datasets import DatasetFolder
from .table import Table, file_of

_ROWS_OF_A_SHARD = 10_000
_IN_JSON = ("index", "object", "target_mm", "approach", "lateral", "standoff_mm", "speed_mm_s")


def write_webdataset(table: Table, folder: pathlib.Path) -> None:
    copied = isinstance(table, DatasetFolder) and table.format == "webdataset"
    if isinstance(table, DatasetFolder) and copied:
        for _ in table.batches():
            pass  # every shard is read and checked
        for shard in table.shards:
            shutil.copyfile(table.folder / shard["name"], folder / shard["name"])
    else:
        _write_shards(table, folder)
    (folder / "README.md").write_text(write_card(
        table, "The rows are in `shard-*.tar`: `KEY.json` has what is one number, a name or a pose, `KEY.COLUMN.npy` the other columns, "
        "`KEY.image.png` the picture.", {"configs": [{"config_name": "default", "data_files": "shard-*.tar"}]}, shards=copied), encoding="utf-8")


def _write_shards(table: Table, folder: pathlib.Path) -> None:
    width = max(6, len(str(table.rows - 1)))
    row, archive = 0, None
    try:
        for batch in table.batches():
            for k in range(len(next(iter(batch.values())))):
                if row % _ROWS_OF_A_SHARD == 0:
                    if archive is not None:
                        archive.close()
                    archive = tarfile.open(folder / f"shard-{row // _ROWS_OF_A_SHARD:06d}.tar", "w", format=tarfile.USTAR_FORMAT)  # noqa: SIM115 (closed below)
                assert archive is not None
                for place, data in _members(table, {name: values[k] for name, values in batch.items()}):
                    member = tarfile.TarInfo(f"{row:0{width}d}.{place}")
                    member.size = len(data)
                    archive.addfile(member, io.BytesIO(data))
                row += 1
    finally:
        if archive is not None:
            archive.close()


def _members(table: Table, sample: dict[str, Any]) -> list[tuple[str, bytes]]:
    described: dict[str, Any] = {}
    files = []
    for column in table.columns:
        value = sample[column.name]
        if column.is_image:
            ending = {"jpeg": "jpg"}.get(column.encoding, "png")
            files.append((f"{column.name}.{ending}", file_of(value)))
        elif column.name == "object":
            described["object"] = sample["object_name"]
        elif column.dtype == "text":
            if table.column("object") is None or column.name != "object_name":
                described[column.name.removesuffix("_name")] = value
        elif (column.shape == () or column.name in _IN_JSON) and np.all(np.isfinite(value)):
            described[column.name] = _number(value)
        else:
            buffer = io.BytesIO()
            np.save(buffer, value)
            files.append((f"{column.name}.npy", buffer.getvalue()))
    return [*files, ("json", json.dumps(described, separators=(",", ":")).encode())]


def _number(value: Any) -> Any:
    """The shortest decimals that are the same float32 or float64."""
    if isinstance(value, np.ndarray):
        return [_number(part) for part in value]
    return float(str(value)) if isinstance(value, np.floating) else int(value)
