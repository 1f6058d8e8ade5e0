"""Intervals over seeds."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy import stats

from .result import Estimate


def estimate(values: Sequence[float] | np.ndarray) -> Estimate:
    """Mean of one value a seed, with Student's 95 % interval; of a single value the interval is unknown: nan."""
    sample = np.asarray(values, float)
    mean = float(sample.mean())
    if len(sample) < 2:
        return Estimate(mean, float("nan"), float("nan"))
    half = float(stats.t.ppf(0.975, len(sample) - 1) * sample.std(ddof=1) / np.sqrt(len(sample)))
    return Estimate(mean, mean - half, mean + half)


def estimate_share(values: Sequence[float] | np.ndarray) -> Estimate:
    """The same of shares: Student's interval may leave 0 to 1, which no share can."""
    found = estimate(values)
    return Estimate(found.value, *(float(np.clip(bound, 0, 1)) for bound in (found.low, found.high)))


def estimates(values: np.ndarray) -> list[Estimate]:
    """Of each column of (seeds, points), which are shares."""
    return [estimate_share(column) for column in np.asarray(values, float).T]
