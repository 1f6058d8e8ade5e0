"""A dataset as a data source of Ray Data, read by all of a cluster's workers.

    import ray
    import touchstone
    from touchstone.ray import TouchstoneDatasource

    samples = touchstone.connect("server:50051").samples(["lat00", "lat20"], samples=1_000_000, seed=1)
    dataset = ray.data.read_datasource(TouchstoneDatasource(samples))

Imported on its own, since Ray is optional: pip install touchstone-sim[ray].
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
from ray.data import Datasource, ReadTask
from ray.data.block import Block, BlockAccessor, BlockMetadata

from . import checks
from .batch import EncodedImages
from .samples import Samples

__all__ = ["TouchstoneDatasource"]


class TouchstoneDatasource(Datasource):
    """Every sample of a dataset once, and which it is in the column "index".

    Sample i depends on nothing but the specification and i: what a worker that died had read is read again, the same
    bytes, and the result does not depend on the number of workers.
    """

    def __init__(self, samples: Samples, *, rows_per_block: int = 4096):
        """
        Args:
          samples: of Client.samples(), at a server that every worker reaches.
          rows_per_block: samples of one request and one block, 1 to 50,000.
        """
        super().__init__()
        self._samples = samples
        self._rows = checks.whole_number("rows_per_block", rows_per_block, 1, 50_000)
        first = _block(samples, range(1))
        self._bytes_per_row = BlockAccessor.for_block(first).size_bytes()
        self._schema = BlockAccessor.for_block(first).schema()

    def get_name(self) -> str:
        """As Ray shows it."""
        return "Touchstone"

    def estimate_inmemory_data_size(self) -> int | None:
        """Bytes of all samples in memory."""
        return int(self._bytes_per_row * len(self._samples))

    def get_read_tasks(self, parallelism: int, per_task_row_limit: int | None = None, *_: Any, **__: Any) -> list[ReadTask]:
        """At most `parallelism` tasks, each of which reads samples that follow one another."""
        blocks = -(-len(self._samples) // self._rows)
        tasks = max(1, min(parallelism, blocks))
        edges = [len(self._samples) * k // tasks for k in range(tasks + 1)]
        return [self._task(range(begin, end), per_task_row_limit) for begin, end in zip(edges, edges[1:])]

    def _task(self, indices: range, row_limit: int | None) -> ReadTask:
        samples, rows = self._samples, self._rows

        def read() -> Iterable[Block]:
            for begin in range(indices.start, indices.stop, rows):
                yield _block(samples, range(begin, min(begin + rows, indices.stop)))

        metadata = BlockMetadata(num_rows=len(indices), size_bytes=self._bytes_per_row * len(indices), input_files=None,
                                 exec_stats=None)
        return ReadTask(read, metadata, schema=self._schema, per_task_row_limit=row_limit)


def _block(samples: Samples, indices: range) -> Block:
    """Those samples as Ray keeps them, with their index as the first column."""
    batch = samples[indices.start:indices.stop]
    columns = {"index": np.asarray(batch.indices)}
    for name, values in batch.items():
        columns[name] = np.array(list(values), object) if isinstance(values, EncodedImages) else values
    return BlockAccessor.batch_to_block(columns)
