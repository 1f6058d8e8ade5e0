"""Are stated probabilities true, and answers that are sets of objects, with a coverage that is stated beforehand."""

from __future__ import annotations

import numpy as np

BINS = 10


def reliability(probabilities: np.ndarray, objects: np.ndarray, bins: int = BINS) -> np.ndarray:
    """(bins, 3) answers, mean stated certainty and share right, by the certainty of the answer (M, objects); NaN where none."""
    certainty, right = probabilities.max(1), probabilities.argmax(1) == objects
    place = np.minimum((certainty * bins).astype(int), bins - 1)
    count = np.bincount(place, minlength=bins)
    with np.errstate(invalid="ignore"):
        return np.stack([count, np.bincount(place, certainty, bins) / count, np.bincount(place, right, bins) / count], 1)


def expected_calibration_error(probabilities: np.ndarray, objects: np.ndarray, bins: int = BINS) -> float:
    """Mean distance of stated certainty and share right over the answers (Naeini et al. 2015; Guo et al. 2017). Few answers
    a bin make it larger than it is: even perfect probabilities do not give 0."""
    count, stated, right = reliability(probabilities, objects, bins).T
    used = count > 0
    return float((count[used] * np.abs(stated[used] - right[used])).sum() / count.sum())


def conformal_threshold(scores: np.ndarray, coverage: float) -> float:
    """The ceil((n + 1) coverage)-th smallest of n calibration scores; infinite where n is too small. A new score that is
    exchangeable with them lies at or below it with at least this probability (split conformal prediction; Vovk et al. 2005;
    Angelopoulos and Bates, arXiv:2107.07511, theorem 1)."""
    place = int(np.ceil((len(scores) + 1) * coverage))
    return float("inf") if place > len(scores) else float(np.sort(scores)[place - 1])


def conformal_sets(probabilities: np.ndarray, calibration: np.ndarray, objects: np.ndarray, coverage: float) -> np.ndarray:
    """(M, objects) which objects belong to each answer: those whose score 1 - probability is no larger than the threshold of
    the calibration answers (n, objects) with their true objects (n,)."""
    scores = 1 - calibration[np.arange(len(objects)), objects]
    return 1 - probabilities <= conformal_threshold(scores, coverage)


class Novelty:
    """"None of these": how far a set's features are from those of the objects that were trained on.

    The distance is the mean over the NEIGHBOURS nearest training sets, in standard deviations of each feature.
    """

    NEIGHBOURS = 5

    def __init__(self, features: np.ndarray):
        self._mean = features.mean(0)
        spread = features.std(0)
        self._scale = np.where(spread > 0, spread, 1)
        self._known = (features - self._mean) / self._scale

    def distance(self, features: np.ndarray) -> np.ndarray:
        """(M,) of (M, F)."""
        given = (features - self._mean) / self._scale
        square = ((given**2).sum(1)[:, None] + (self._known**2).sum(1) - 2 * given @ self._known.T).clip(0)
        return np.sqrt(np.partition(square, self.NEIGHBOURS - 1, 1)[:, : self.NEIGHBOURS]).mean(1)
