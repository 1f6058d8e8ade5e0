"""Controls with shuffled labels: what a recogniser knows that was told nothing, and the range in which that is chance.

Objects are exchanged in training alone, each is as frequent as the others, and recognisers treat all alike: whatever the
data, the mean over shuffles is 1 / objects, and shuffles of the same data are independent. One shuffle scatters by far more than as many
independent tests would, since all of a test is judged by one recogniser: one shuffle a seed, which is what was made here before,
leaves the mean of ten seeds uncertain by 2 to 4 points. So several are made for every seed. Several controls stand in one report: the range
is that in which all of them lie with a probability of 95 % if there is nothing but chance.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import numpy as np
from scipy import stats

from .result import Estimate

CONTROLS = 12  # of a whole report, which are judged together (Bonferroni)
_LEVEL = 1 - 0.05 / CONTROLS


@dataclasses.dataclass(frozen=True)
class Control:
    """Attributes:
      found: mean over seeds and shuffles, with the range that all controls of a report share.
      chance: 1 / objects.
      shuffles: how many, of all seeds together.
    """

    found: Estimate
    chance: float
    shuffles: int

    @property
    def is_chance(self) -> bool:
        return bool(self.found.low <= self.chance <= self.found.high)

    def words(self) -> str:
        """Without a full stop."""
        told = "which is chance" if self.is_chance else "WHICH IS NOT CHANCE: something tells the answer"
        return f"with shuffled labels ({self.shuffles} shuffles) {self.found.words()}, chance is {self.chance:.0%}: {told}"


def control(accuracies: Sequence[Sequence[float]] | np.ndarray, chance: float) -> Control:
    """Of (seeds, shuffles) accuracies, all independent."""
    values = np.asarray(accuracies, float)
    mean = float(values.mean())
    half = float(stats.t.ppf(0.5 + _LEVEL / 2, values.size - 1) * values.std(ddof=1) / np.sqrt(values.size))
    return Control(Estimate(mean, mean - half, mean + half), chance, values.size)
