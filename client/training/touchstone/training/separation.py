"""That nothing is tested which was trained on: poses as numbers, seeds of poses that never coincide, and the check."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from typing import Any

import numpy as np


class Leak(ValueError):
    """A pose that is tested lies in training."""


def pose_seed(use: str, *words: Any) -> int:
    """The seed of a dataset's poses. The same source draws the same poses for the same seed, whatever they are for: seeds of
    another `use` ("training", "testing", "rig") are other ones."""
    text = json.dumps([use, *map(str, words)])
    return int.from_bytes(hashlib.sha256(text.encode()).digest()[:6], "little")


def pose_numbers(commands: np.ndarray) -> np.ndarray:
    """(N,) a number for each row of (N, K) commanded values; equal rows have the same one, in every call."""
    rows = np.ascontiguousarray(np.round(commands, 5) + 0.0, "<f8")  # + 0.0: no negative zero
    return np.array([int.from_bytes(hashlib.blake2b(row.tobytes(), digest_size=8).digest(), "little", signed=True) for row in rows],
                    np.int64)


def command_numbers(objects: Sequence[str], index: np.ndarray, *vectors: np.ndarray) -> np.ndarray:
    """(N,) a number for what was commanded: the object by its name, and (N, 3) vectors, as target, approach and lateral. Equal
    for every round, source and experiment."""
    names = np.array([int.from_bytes(hashlib.blake2b(name.encode(), digest_size=8).digest(), "little", signed=True) for name in objects])
    return pose_numbers(np.column_stack(vectors)) ^ names[index]


def check(trained: np.ndarray, tested: np.ndarray) -> None:
    """Leak if a pose is among both."""
    both = np.intersect1d(trained, tested)
    if len(both):
        raise Leak(f"{len(both)} of {len(np.unique(tested))} poses that are tested are trained on")
