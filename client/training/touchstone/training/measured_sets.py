"""Which of a rig's touches are trained on and which are tested.

A rig measures every pose in several rounds. Whoever has one round of a pose in training and another in a test has seen the
answer, so a split parts poses.
"""

from __future__ import annotations

import numpy as np

from .touch_data import TouchData


def split(data: TouchData, share: float, rng: np.random.Generator, *, by_pose: bool = True) -> tuple[np.ndarray, np.ndarray]:
    """Rows for training and rows for testing, `share` of each object's poses in the latter. `by_pose` False parts touches
    whatever their pose: what that makes of an accuracy is in the sensitivity table."""
    group = data.poses() if by_pose else np.arange(len(data))
    testing = np.zeros(len(data), bool)
    for k in range(len(data.objects)):
        mine = rng.permutation(np.unique(group[data.object == k]))
        testing |= np.isin(group, mine[: max(1, round(share * len(mine)))]) & (data.object == k)
    return np.flatnonzero(~testing), np.flatnonzero(testing)


def part(data: TouchData, touches: int, rng: np.random.Generator) -> TouchData:
    """That many of the touches, drawn at random, of every object as many; all of them if there are fewer."""
    objects = len(data.objects)
    mine = [rng.permutation(np.flatnonzero(data.object == k))[: touches // objects + (k < touches % objects)] for k in range(objects)]
    return data[np.sort(np.concatenate(mine))]
