"""What recognisers see of touches: feature sets, each made of several touches of one object.

The seed gives recognisers histograms of local curvature. How many bins, over which range, and what belongs to one set
is left open by it; it is chosen here, once for all experiments.
"""

from __future__ import annotations

from typing import Callable

import numpy as np

from .touch_data import TouchData

# 1/m. Most curvatures of the shipped objects, and most of the seed's noise, lie between; the outer bins hold the rest.
RANGE_PER_M = 60.0
BINS = 16


def histogram(curvature: np.ndarray, bins: int = BINS, reach: float = RANGE_PER_M) -> np.ndarray:
    """(sets, bins) shares of the touches of each set, from (sets, touches) curvatures in 1/m."""
    places = np.clip(np.floor((curvature + reach) / (2 * reach) * bins), 0, bins - 1).astype(int)
    return (places[:, :, None] == np.arange(bins)).mean(1)


def quantiles(curvature: np.ndarray) -> np.ndarray:
    """(sets, 9) quantiles of the curvatures, 10 to 90 %, in units of RANGE_PER_M."""
    return np.quantile(curvature, np.linspace(0.1, 0.9, 9), axis=1).T / RANGE_PER_M


def moments(curvature: np.ndarray) -> np.ndarray:
    """(sets, 4): mean, standard deviation, mean size and largest size, in units of RANGE_PER_M."""
    size = np.abs(curvature)
    return np.stack([curvature.mean(1), curvature.std(1), size.mean(1), size.max(1)], 1) / RANGE_PER_M


# What the sensitivity table varies; the first is what every experiment uses.
FEATURES: dict[str, Callable[[np.ndarray], np.ndarray]] = {
    "histogram": histogram, "quantiles": quantiles, "moments": moments,
}


def feature_sets(data: TouchData, touches: int, rng: np.random.Generator, *, sets: int | None = None,
                 features: Callable[[np.ndarray], np.ndarray] = histogram) -> tuple[np.ndarray, np.ndarray]:
    """(M, F) features and (M,) objects of sets of `touches` touches each.

    Each touch belongs to one set at most; touches of an object are dealt out at random and what is left over is dropped.
    `sets`: as many of all objects together, the objects in turn; ValueError if there are not so many touches.
    """
    groups = []
    for k in range(len(data.objects)):
        mine = rng.permutation(np.flatnonzero(data.object == k))
        groups.append(mine[: len(mine) // touches * touches].reshape(-1, touches))
    if sets is not None:
        wanted = [sets // len(groups) + (k < sets % len(groups)) for k in range(len(groups))]
        for name, group, count in zip(data.objects, groups, wanted):
            if len(group) < count:
                raise ValueError(f"{count} sets of {touches} touches of {name} are wanted, there are {len(group)}")
        groups = [group[:count] for group, count in zip(groups, wanted)]
    rows = np.concatenate(groups)
    return features(data.curvature()[rows]), data.object[rows[:, 0]]
