"""Feature sets of what a rig measured, so that nothing of a test is in training.

A rig measures every pose in several rounds. Whoever has one round of a pose in training and another in a test has seen the
answer, so a split parts poses. A rig's touches are few: where more sets are asked for than its touches make, each set is
drawn anew and a touch may be in several of them, always on one side of the split.
"""

from __future__ import annotations

from typing import Callable

import numpy as np

from .features import histogram
from .touch_data import TouchData


def poses(data: TouchData) -> np.ndarray:
    """(N,) a number for each commanded pose of each object; rounds of one pose have the same."""
    command = np.column_stack([data.object, data.target_mm, data.approach, data.lateral])
    return np.unique(np.round(command, 6), axis=0, return_inverse=True)[1].ravel()


def split(data: TouchData, share: float, rng: np.random.Generator, *, by_pose: bool = True) -> tuple[np.ndarray, np.ndarray]:
    """Rows for training and rows for testing, `share` of each object's poses in the latter. `by_pose` False parts touches
    whatever their pose: what that makes of an accuracy is in the sensitivity table."""
    group = poses(data) if by_pose else np.arange(len(data))
    testing = np.zeros(len(data), bool)
    for k in range(len(data.objects)):
        mine = rng.permutation(np.unique(group[data.object == k]))
        testing |= np.isin(group, mine[: max(1, round(share * len(mine)))]) & (data.object == k)
    return np.flatnonzero(~testing), np.flatnonzero(testing)


def drawn_sets(data: TouchData, touches: int, sets: int, rng: np.random.Generator, *,
               features: Callable[[np.ndarray], np.ndarray] = histogram) -> tuple[np.ndarray, np.ndarray]:
    """(sets, F) features and (sets,) objects, in turn: each of `touches` different touches of one object, drawn at random.

    ValueError if an object has fewer touches than a set.
    """
    objects = np.arange(sets) % len(data.objects)
    rows = np.empty((sets, touches), int)
    for k, name in enumerate(data.objects):
        mine = np.flatnonzero(data.object == k)
        if len(mine) < touches:
            raise ValueError(f"sets of {touches} touches of {name} are wanted, there are {len(mine)} touches")
        for row in np.flatnonzero(objects == k):
            rows[row] = rng.choice(mine, touches, replace=False)
    return features(data.curvature()[rows]), objects
