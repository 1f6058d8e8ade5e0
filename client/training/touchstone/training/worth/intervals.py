"""Intervals over the poses of a measured set and over repetitions of simulation and training: a bootstrap of both."""

from __future__ import annotations

import dataclasses

import numpy as np

from ..result import Estimate

REPEATS = 2000


class Resampling:
    """Draws of repetitions and of groups of poses, with replacement, the same for every recogniser that is compared.

    Both are drawn at once (Owen: The pigeonhole bootstrap, Annals of Applied Statistics 1 (2007) 386-411: for crossed
    factors, errs on the side of wide intervals); groups within each object, whose number stays. `cells` are (seeds, groups)
    numbers of a recogniser: the share of a group's sets that it knows.
    """

    def __init__(self, objects: np.ndarray, seeds: int, rng: np.random.Generator, repeats: int = REPEATS):
        """`objects`: (groups,) whose groups they are."""
        self.groups = len(objects)
        groups = np.zeros((repeats, self.groups))
        for each in np.unique(objects):
            mine = np.flatnonzero(objects == each)
            groups[:, mine] = rng.multinomial(len(mine), np.full(len(mine), 1 / len(mine)), repeats)
        self._groups = groups / self.groups
        self._seeds = rng.multinomial(seeds, np.full(seeds, 1 / seeds), repeats) / seeds

    def means(self, cells: np.ndarray) -> np.ndarray:
        """(repeats,) the mean of each draw."""
        return np.einsum("bs,bg,sg->b", self._seeds, self._groups, cells, optimize=True)

    def difference(self, cells: np.ndarray, other: np.ndarray) -> Estimate:
        """Of cells - other, by the same draws."""
        return self.estimate(cells - other, lowest=-1.0)

    def estimate(self, cells: np.ndarray, lowest: float = 0.0) -> Estimate:
        """Mean and 95 % interval of shares, which are `lowest` at least.

        Where all cells are alike no draw differs: then the interval holds what one group in 40 sets like these would still
        hide, 1 - 0.025^(1/groups), the exact binomial bound.
        """
        value = float(np.mean(cells))
        if np.ptp(cells) == 0:
            hidden = 1 - 0.025 ** (1 / self.groups)
            low, high = value - hidden, value + hidden
        else:
            low, high = (float(x) for x in np.quantile(self.means(cells), [0.025, 0.975]))
        return Estimate(value, max(low, lowest), min(high, 1.0))


@dataclasses.dataclass(frozen=True)
class Exchange:
    """How many simulated touches teach a recogniser as much as one measured touch does.

    Attributes:
      value, low, high: with a 95 % interval; infinite beyond `largest`, 0 below `smallest`.
      smallest, largest: what was tried, simulated touches per measured one.
    """

    value: float
    low: float
    high: float
    smallest: float
    largest: float

    def words(self) -> str:
        if self.value == 0:
            return f"{self.smallest:.2g} or fewer" + (f" (up to {self._end(self.high)})" if self.high else "")
        if np.isinf(self.value):
            return f"more than {self.largest:.3g}" + (f" (from {self._end(self.low)})" if np.isfinite(self.low) else "")
        return f"{self.value:.3g} ({self._end(self.low)} to {self._end(self.high)})"

    def _end(self, value: float) -> str:
        return f"below {self.smallest:.2g}" if value == 0 else f"above {self.largest:.3g}" if np.isinf(value) else f"{value:.3g}"


def exchange(measured: np.ndarray, touches: int, curve: list[tuple[int, np.ndarray]], draws: Resampling) -> Exchange:
    """Where the learning curve of simulated touches, [(touches, cells)] from few to many, reaches what `touches` measured ones
    teach, `measured` cells. Between points it is linear in the logarithm; a curve that falls is held."""
    sizes = np.log([size for size, _ in curve])
    points = np.maximum.accumulate(np.stack([draws.means(cells) for _, cells in curve], 1), 1)
    values = [_reached(goal, sizes, row) for goal, row in zip(draws.means(measured), points)]
    best = np.maximum.accumulate([cells.mean() for _, cells in curve])
    found = np.array([_reached(measured.mean(), sizes, best), *np.quantile(values, [0.025, 0.975], method="nearest")])
    value, low, high = (float(x) for x in np.where(found == 0, 0.0, found / touches))
    return Exchange(value, min(low, value), max(high, value), curve[0][0] / touches, curve[-1][0] / touches)


def _reached(goal: float, sizes: np.ndarray, points: np.ndarray) -> float:
    """Touches at which rising points reach the goal; 0: the first is beyond it, infinite: the last is below."""
    if points[0] >= goal:
        return 0.0
    if points[-1] < goal:
        return float("inf")
    k = int(np.searchsorted(points, goal))
    share = (goal - points[k - 1]) / (points[k] - points[k - 1])
    return float(np.exp(sizes[k - 1] + share * (sizes[k] - sizes[k - 1])))
