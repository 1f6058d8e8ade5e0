"""What recognisers see of touches: feature sets, each made of several touches of one object.

The seed gives recognisers the contact times or the local curvatures of a set's touches themselves and shows histograms of
them to people only. In which order a set's touches stand is left open by it; here they stand in the order of their
curvature, since a set has none of its own.
"""

from __future__ import annotations

import dataclasses
from typing import Any, Callable

import numpy as np

from .touch_data import TouchData

# 1/m. Most curvatures of the shipped objects, and most of the seed's noise, lie between; the outer bins hold the rest.
RANGE_PER_M = 60.0
BINS = 16
_UNIT_US = 1e5  # of contact times: most differences between fingers are of that size

# (data, (sets, touches) rows) -> (sets, F).
Features = Callable[[TouchData, np.ndarray], np.ndarray]


def curvatures(data: TouchData, rows: np.ndarray) -> np.ndarray:
    """(sets, touches) local curvatures from the smallest to the largest, in units of RANGE_PER_M."""
    return np.sort(data.curvature()[rows], 1) / RANGE_PER_M


def curvatures_as_touched(data: TouchData, rows: np.ndarray) -> np.ndarray:
    """The same in the order in which the touches were drawn."""
    return data.curvature()[rows] / RANGE_PER_M


def triples(data: TouchData, rows: np.ndarray) -> np.ndarray:
    """(sets, touches x fingers) contact times less the first finger's, touch by touch, in tenths of a second."""
    return data.times_us[rows].reshape(len(rows), -1) / _UNIT_US


def histogram(data: TouchData, rows: np.ndarray, bins: int = BINS, reach: float = RANGE_PER_M) -> np.ndarray:
    """(sets, bins) shares of the touches of each set by local curvature, `bins` of -reach to reach 1/m."""
    places = np.clip(np.floor((data.curvature()[rows] + reach) / (2 * reach) * bins), 0, bins - 1).astype(int)
    return (places[:, :, None] == np.arange(bins)).mean(1)


def moments(data: TouchData, rows: np.ndarray) -> np.ndarray:
    """(sets, 4): mean, standard deviation, mean size and largest size of the curvatures, in units of RANGE_PER_M."""
    curvature = data.curvature()[rows]
    size = np.abs(curvature)
    return np.stack([curvature.mean(1), curvature.std(1), size.mean(1), size.max(1)], 1) / RANGE_PER_M


@dataclasses.dataclass(frozen=True)
class FeatureSets:
    """Of touches, or of pictures, each of which is a set of its own.

    Attributes:
      values: (M, F) what a recogniser sees.
      objects: (M,) what it is to say.
      poses: (M, touches), of pictures (M,), a number for each commanded pose; the same for every round, source and scaled copy.
    """

    values: np.ndarray
    objects: np.ndarray
    poses: np.ndarray

    def __len__(self) -> int:
        return len(self.objects)

    def __getitem__(self, rows: Any) -> FeatureSets:
        """Those sets: a slice, a mask or an array of indices."""
        return FeatureSets(self.values[rows], self.objects[rows], self.poses[rows])


def joined(*parts: FeatureSets) -> FeatureSets:
    return FeatureSets(*(np.concatenate([getattr(part, name) for part in parts]) for name in ("values", "objects", "poses")))


def of_rows(data: TouchData, rows: np.ndarray, features: Features = curvatures) -> FeatureSets:
    """The sets whose touches are these (sets, touches) rows, those of a set of one object."""
    return FeatureSets(features(data, rows), data.object[rows[:, 0]], data.poses()[rows])


def dealt_rows(data: TouchData, touches: int, rng: np.random.Generator) -> np.ndarray:
    """(M, touches) rows: each touch is in one set at most; an object's touches are dealt out at random, the rest is dropped."""
    mine = [rng.permutation(np.flatnonzero(data.object == k)) for k in range(len(data.objects))]
    return np.concatenate([rows[: len(rows) // touches * touches].reshape(-1, touches) for rows in mine])


def dealt_sets(data: TouchData, touches: int, rng: np.random.Generator, features: Features = curvatures) -> FeatureSets:
    """Sets of `touches` touches that share none."""
    return of_rows(data, dealt_rows(data, touches, rng), features)


def some(sets: FeatureSets, count: int, rng: np.random.Generator) -> FeatureSets:
    """`count` of them, at random; ValueError if there are fewer."""
    if len(sets) < count:
        raise ValueError(f"{count} sets are wanted, there are {len(sets)}")
    return sets[rng.permutation(len(sets))[:count]]


def drawn_sets(data: TouchData, touches: int, sets: int, rng: np.random.Generator, features: Features = curvatures) -> FeatureSets:
    """`sets` sets, the objects in turn: each of `touches` different touches of one object, drawn at random; a touch may be
    in several sets.

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
    return of_rows(data, rows, features)
