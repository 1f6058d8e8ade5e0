"""Parquet files that pandas, polars, DuckDB, Spark and the library `datasets` read."""

from __future__ import annotations

import json
import pathlib

from . import arrow
from .card import write_card
from .table import ROWS_OF_A_BATCH, Table

_ROWS_OF_A_FILE = 100_000


def write_parquet(table: Table, folder: pathlib.Path) -> None:
    pa, pq = arrow.import_arrow("export to Parquet")
    features = {column.name: arrow.feature(column) for column in table.columns}
    metadata = {"huggingface": json.dumps({"info": {"features": features}}), "touchstone": json.dumps(table.provenance)}
    fields = [pa.field(column.name, arrow.arrow_type(pa, column), metadata={"unit": column.unit} if column.unit else None)
              for column in table.columns]
    schema = pa.schema(fields, metadata=metadata)
    files = max(1, -(-table.rows // _ROWS_OF_A_FILE))
    (folder / "data").mkdir()
    written, writer, number = 0, None, 0
    try:
        for batch in arrow.record_batches(pa, schema, table.columns, table.batches()):
            if writer is None or written >= (number * _ROWS_OF_A_FILE):
                if writer is not None:
                    writer.close()
                writer = pq.ParquetWriter(folder / "data" / f"train-{number:05d}-of-{files:05d}.parquet", schema)
                number += 1
            writer.write_batch(batch, row_group_size=16 * ROWS_OF_A_BATCH)
            written += batch.num_rows
    finally:
        if writer is not None:
            writer.close()
    (folder / "README.md").write_text(write_card(
        table, "The rows are in `data/*.parquet`; pictures are structs of `bytes` and `path`, as the library `datasets` stores them. Each "
        "file has the provenance in its metadata, key `touchstone`, and each field its unit.",
        {"configs": [{"config_name": "default", "data_files": "data/*.parquet"}]}), encoding="utf-8")
