"""LeRobotDataset v3.0, the format of Hugging Face's LeRobot.

Samples are independent of one another, so each touch is an episode of one frame, and its task names the object. What is
commanded is the `action`, what the fingers report the `observation.state`; every column stands there too, under
`observation.`, pictures under `observation.images.`.
"""

from __future__ import annotations

import json
import math
import pathlib
from typing import Any

import numpy as np

from . import arrow
from .card import write_card
from .table import Column, Table, Values, file_of, pixels_of

# As the format has them: most frames of a file by its size, most files of a folder.
_FILE_BYTES = 100 * 2**20
_FILES_OF_A_CHUNK = 1000
_FPS = 1
_DEFAULTS = (Column("timestamp", "float32"), Column("frame_index", "int64"), Column("episode_index", "int64"), Column("index", "int64"),
             Column("task_index", "int64"))
_COMMANDED = ("target_mm", "approach", "lateral", "standoff_mm", "speed_mm_s")
_SENSED = ("descriptor_us", "contact_time_us")
# Statistics of pictures are of as many as LeRobot's own tools would take.
_PICTURES_OF_STATISTICS = 1000


def write_lerobot(table: Table, folder: pathlib.Path) -> None:
    pa, pq = arrow.import_arrow("export to LeRobot")
    state = next((column for name in _SENSED if (column := table.column(name))), None)
    commanded = [column for name in _COMMANDED if (column := table.column(name))]
    features = _Features(table, state, commanded)
    schema = pa.schema([pa.field(column.name, arrow.arrow_type(pa, column, fixed=False)) for column in features.columns],
                       metadata={"huggingface": json.dumps({"info": {"features": features.of_datasets()}})})
    episodes = _Episodes()
    statistics = {column.name: _Statistics(column) for column in features.columns if column.dtype != "text"}
    files = _DataFiles(folder, pq, schema)
    row = 0
    every = max(1, table.rows // _PICTURES_OF_STATISTICS)
    try:
        for batch in table.batches():
            rows = len(next(iter(batch.values())))
            frames = features.frames(batch, row, rows, episodes)
            (record,) = arrow.record_batches(pa, schema, features.columns, [frames], fixed=False)
            episodes.placed(row, rows, files.write(record))
            for name, found in statistics.items():
                found.add(frames[name], row, every)
            row += rows
    finally:
        files.close()
    _write_meta(pa, pq, folder, table, features, episodes, {name: found.result() for name, found in statistics.items()})


class _Features:
    def __init__(self, table: Table, state: Column | None, commanded: list[Column]):
        self.state, self.commanded = state, commanded
        self.task_of = "object_name" if table.column("object_name") else ""
        self.sources: dict[str, Column] = {}
        for column in table.columns:
            pictures = column.is_image or column.name == "mask"
            name = "sample_index" if column.name == "index" else f"observation.{'images.' if pictures else ''}{column.name}"
            self.sources[name] = column
        self.columns = [Column(name, column.dtype, column.shape, column.unit, column.encoding or ("png" if "images." in name else ""))
                        for name, column in self.sources.items()]
        if state:
            self.columns.append(Column("observation.state", state.dtype, state.shape, state.unit))
        if commanded:
            self.columns.append(Column("action", commanded[0].dtype, (sum(math.prod(column.shape) for column in commanded),)))
        self.columns += _DEFAULTS

    def frames(self, batch: dict[str, Values], first: int, rows: int, episodes: _Episodes) -> dict[str, Any]:
        """The batch by the names of the format, with what it wants of every frame."""
        frames: dict[str, Any] = {name: batch[column.name] for name, column in self.sources.items()}
        if self.state:
            frames["observation.state"] = batch[self.state.name]
        if self.commanded:
            frames["action"] = np.concatenate([np.asarray(batch[column.name]).reshape(rows, -1) for column in self.commanded], 1)
        index = np.arange(first, first + rows, dtype=np.int64)
        tasks = [f"touch {name}" for name in batch[self.task_of]] if self.task_of else ["touch"] * rows
        frames |= {"timestamp": np.zeros(rows, np.float32), "frame_index": np.zeros(rows, np.int64), "episode_index": index, "index": index,
                   "task_index": np.array([episodes.task(task) for task in tasks], np.int64)}
        return frames

    def names(self, column: Column) -> list[str] | None:
        if column.is_image:
            return ["height", "width", "channels"][: len(column.shape)]
        if column.name == "action":
            return [f"{part.name}.{k}" if part.shape else part.name for part in self.commanded for k in range(math.prod(part.shape))]
        return None

    def of_info(self) -> dict[str, Any]:
        """For meta/info.json."""
        found = {}
        for column in self.columns:
            kind = "image" if column.is_image else "string" if column.dtype == "text" else column.dtype
            shape = [*column.shape, 1] if column.is_image and len(column.shape) == 2 else list(column.shape) or [1]
            found[column.name] = {"dtype": kind, "shape": shape, "names": self.names(column), **({"unit": column.unit} if column.unit else {})}
        return found

    def of_datasets(self) -> dict[str, Any]:
        """For the metadata of the Parquet files."""
        found = {}
        for column in self.columns:
            if len(column.shape) < 2 or column.is_image:
                found[column.name] = arrow.feature(column)
            else:
                found[column.name] = {"shape": list(column.shape), "dtype": column.dtype, "_type": f"Array{len(column.shape)}D"}
        return found


class _Episodes:
    """One per touch: its task, and the file that it lies in."""

    def __init__(self) -> None:
        self.tasks: dict[str, int] = {}
        self._of_episode: list[int] = []
        self._places: list[tuple[int, int, int]] = []  # rows, chunk, file

    def task(self, name: str) -> int:
        number = self.tasks.setdefault(name, len(self.tasks))
        self._of_episode.append(number)
        return number

    def placed(self, first: int, rows: int, file: int) -> None:
        self._places.append((rows, *divmod(file, _FILES_OF_A_CHUNK)))
        assert first + rows == len(self._of_episode)

    def table(self, pa: Any) -> Any:
        count = len(self._of_episode)
        index = np.arange(count, dtype=np.int64)
        names = list(self.tasks)
        rows, chunks, files = (np.array(part, np.int64) for part in zip(*self._places))
        nothing = np.zeros(count, np.int64)
        return pa.table({
            "episode_index": index, "tasks": pa.array([[names[task]] for task in self._of_episode], pa.list_(pa.string())),
            "length": nothing + 1, "data/chunk_index": np.repeat(chunks, rows), "data/file_index": np.repeat(files, rows),
            "dataset_from_index": index, "dataset_to_index": index + 1, "meta/episodes/chunk_index": nothing,
            "meta/episodes/file_index": nothing})


class _DataFiles:
    """data/chunk-000/file-000.parquet, ..., each of about 100 MB."""

    def __init__(self, folder: pathlib.Path, pq: Any, schema: Any):
        self._folder, self._pq, self._schema = folder, pq, schema
        self._writer: Any = None
        self._number, self._bytes = -1, 0

    def write(self, record: Any) -> int:
        """Writes the rows; the number of their file."""
        if self._writer is None or self._bytes >= _FILE_BYTES:
            self.close()
            self._number, self._bytes = self._number + 1, 0
            chunk, file = divmod(self._number, _FILES_OF_A_CHUNK)
            path = self._folder / f"data/chunk-{chunk:03d}/file-{file:03d}.parquet"
            path.parent.mkdir(parents=True, exist_ok=True)
            self._writer = self._pq.ParquetWriter(path, self._schema, compression="snappy")
        self._writer.write_batch(record)
        self._bytes += record.nbytes
        return self._number

    def close(self) -> None:
        if self._writer is not None:
            self._writer.close()
            self._writer = None


class _Statistics:
    """Smallest, largest, mean and standard deviation of a feature; of a picture per channel, from 0 to 1."""

    def __init__(self, column: Column):
        self._column = column
        self._min: Any = math.inf
        self._max: Any = -math.inf
        self._sum: Any = 0.0
        self._squares: Any = 0.0
        self._count: Any = 0
        self._rows = 0

    def add(self, values: Values, first: int, every: int) -> None:
        column = self._column
        if column.is_image:
            shape = column.shape if len(column.shape) == 3 else (*column.shape, 1)
            kept = [pixels_of(file_of(value), shape) for k, value in enumerate(values, first) if k % every == 0]
            if not kept:
                return
            self._rows += len(kept)
            found = np.stack(kept).reshape(-1, shape[-1]) / 255.0
        else:
            found = np.asarray(values, np.float64).reshape(len(values), *(column.shape or (1,)))
            self._rows += len(values)
        known = np.isfinite(found)
        self._min = np.minimum(self._min, np.where(known, found, math.inf).min(0))
        self._max = np.maximum(self._max, np.where(known, found, -math.inf).max(0))
        found = np.where(known, found, 0.0)
        self._sum, self._squares, self._count = self._sum + found.sum(0), self._squares + (found**2).sum(0), self._count + known.sum(0)

    def result(self) -> dict[str, Any]:
        count = np.maximum(self._count, 1)
        mean = self._sum / count
        spread = np.sqrt(np.maximum(self._squares / count - mean**2, 0.0))
        # Where no row has a value there is nothing to normalize.
        known = np.asarray(self._count) > 0
        parts = {"min": np.where(known, self._min, 0.0), "max": np.where(known, self._max, 0.0), "mean": mean, "std": spread}
        shape = (-1, 1, 1) if self._column.is_image else np.shape(mean)
        return {**{name: np.reshape(part, shape).tolist() for name, part in parts.items()}, "count": [self._rows]}


def _write_meta(pa: Any, pq: Any, folder: pathlib.Path, table: Table, features: _Features, episodes: _Episodes,
                statistics: dict[str, Any]) -> None:
    info = {"codebase_version": "v3.0", "robot_type": "touchstone", "total_episodes": table.rows, "total_frames": table.rows,
            "total_tasks": len(episodes.tasks), "chunks_size": _FILES_OF_A_CHUNK, "data_files_size_in_mb": _FILE_BYTES >> 20,
            "video_files_size_in_mb": 500, "fps": _FPS, "splits": {"train": f"0:{table.rows}"},
            "data_path": "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet", "video_path": None, "features": features.of_info()}
    meta = folder / "meta"
    (meta / "episodes/chunk-000").mkdir(parents=True)
    pq.write_table(episodes.table(pa), meta / "episodes/chunk-000/file-000.parquet", compression="snappy")
    (meta / "info.json").write_text(json.dumps(info, indent=4), encoding="utf-8")
    (meta / "stats.json").write_text(json.dumps(statistics, indent=4), encoding="utf-8")
    names = list(episodes.tasks)
    # As pandas writes a frame whose index is the task.
    tasks = pa.table({"task_index": np.arange(len(names), dtype=np.int64), "task": names}).replace_schema_metadata({"pandas": json.dumps({
        "index_columns": ["task"], "column_indexes": [], "columns": [
            {"name": "task_index", "field_name": "task_index", "pandas_type": "int64", "numpy_type": "int64", "metadata": None},
            {"name": "task", "field_name": "task", "pandas_type": "unicode", "numpy_type": "object", "metadata": None}],
        "creator": {"library": "touchstone", "version": "1"}, "pandas_version": "1.5.3"})})
    pq.write_table(tasks, meta / "tasks.parquet")
    (folder / "README.md").write_text(write_card(
        table, "A LeRobotDataset v3.0: each touch is an episode of one frame, its task names the object. The columns below stand under "
        "`observation.`, pictures under `observation.images.`; `observation.state` is "
        f"{features.state.name if features.state else 'missing'}, `action` is {', '.join(column.name for column in features.commanded)}.",
        {"tags": ["LeRobot", "touchstone", "robotics", "tactile"],
         "configs": [{"config_name": "default", "data_files": "data/*/*.parquet"}]}), encoding="utf-8")
