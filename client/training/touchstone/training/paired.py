"""Comparisons over the same seeds: what is said of an order is computed from the interval of the paired difference."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from .result import Estimate
from .statistics import estimate


def difference(first: Sequence[float], second: Sequence[float]) -> Estimate:
    """Of first - second, seed by seed."""
    return estimate(np.asarray(first, float) - np.asarray(second, float))


def order(first_name: str, first: Sequence[float], second_name: str, second: Sequence[float]) -> str:
    """"A is better than B by ...", the other way round, or that the data do not tell; without a full stop."""
    found = difference(first, second)
    size = f"{100 * found.value:+.1f} points, {100 * found.low:+.1f} to {100 * found.high:+.1f} over {len(first)} seeds"
    if found.low > 0:
        return f"{first_name} is better than {second_name} ({size})"
    if found.high < 0:
        return f"{first_name} is worse than {second_name} ({size})"
    return f"{first_name} and {second_name} cannot be told apart ({size})"
