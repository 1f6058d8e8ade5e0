"""One HDF5 file with a dataset per column, laid out as the shards of `touchstone stream --to hdf5`: attribute `unit` on each,
`objects` on the file."""

from __future__ import annotations

import errno
import json
import math
import os
import pathlib
import shutil

import numpy as np

from .card import write_card
from .table import ROWS_OF_A_BATCH, Table, need, pixels_of


def write_hdf5(table: Table, folder: pathlib.Path) -> None:
    h5py = need("h5py", "export to HDF5")
    # Where the disk is full the HDF5 library cannot close a file, and crashes when the process ends.
    needed = table.rows * sum(math.prod(column.shape) * np.dtype(column.dtype).itemsize for column in table.columns
                              if column.dtype != "text" and column.encoding != "jpeg")
    if needed > shutil.disk_usage(folder).free:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
    with h5py.File(folder / "data.h5", "w") as file:
        file.attrs["objects"] = np.array([name.encode() for name in table.objects] or [b""])
        file.attrs["touchstone"] = json.dumps(table.provenance)
        for column in table.columns:
            if column.encoding == "jpeg":
                made = file.create_dataset(column.name, (table.rows,), h5py.vlen_dtype(np.uint8))
                made.attrs["encoding"] = "jpeg"
            elif column.dtype == "text":
                made = file.create_dataset(column.name, (table.rows,), h5py.string_dtype())
            else:
                made = file.create_dataset(column.name, (table.rows, *column.shape), np.dtype(column.dtype),
                                           chunks=(min(table.rows, ROWS_OF_A_BATCH if not column.is_image else 16), *column.shape))
            made.attrs["unit"] = column.unit
        row = 0
        for batch in table.batches():
            for column in table.columns:
                values = batch[column.name]
                rows = len(values)
                if column.encoding == "jpeg":
                    for k, value in enumerate(values):
                        file[column.name][row + k] = np.frombuffer(value, np.uint8)
                elif column.encoding:
                    file[column.name][row : row + rows] = np.stack([pixels_of(value, column.shape) for value in values])
                else:
                    file[column.name][row : row + rows] = values
            row += rows
    (folder / "README.md").write_text(write_card(
        table, "The rows are in `data.h5`, a dataset per column with the attribute `unit`; pictures are arrays (row, height, width, "
        "channels). The attribute `touchstone` of the file is the provenance as JSON."), encoding="utf-8")
