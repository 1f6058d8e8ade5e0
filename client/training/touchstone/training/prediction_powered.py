"""What simulated predictions add to a few measurements: prediction-powered inference."""

from __future__ import annotations

import dataclasses

import numpy as np
from scipy import stats


@dataclasses.dataclass(frozen=True)
class PoweredMean:
    """Attributes:
      value: of the mean, low and high of its 95 % interval.
      std_error: of value.
      classical_std_error: of the mean of the measurements alone.
      weight: lambda, how much the predictions count: 0 not at all, 1 as much as in the first paper.
      effective_over_measured: how many measurements alone would give the same certainty, per measurement made.
    """

    value: float
    low: float
    high: float
    std_error: float
    classical_std_error: float
    weight: float
    effective_over_measured: float


def powered_mean(measured: np.ndarray, predicted: np.ndarray, more_predicted: np.ndarray,
                 weight: float | None = None) -> PoweredMean:
    """Mean of what is measured, by (n,) measurements, (n,) predictions of the same, and (N,) predictions of more.

    Angelopoulos, Bates, Fannjiang, Jordan, Zrnic: Prediction-powered inference, Science 382 (2023) 669-674: with weight 1
    the predictions' mean, corrected by the mean error that the measurements show. Angelopoulos, Duchi, Zrnic: PPI++,
    arXiv:2311.01453 (2023), example 6.1: weight = cov(measured, predicted) / ((1 + n/N) var(predicted)) has the smallest
    variance, var(measured - weight predicted) / n + weight^2 var(predicted) / N. None: that weight, kept within 0 and 1
    as there.
    """
    n = len(measured)
    weight, variance, classical = (float(x) for x in _variances(measured, predicted, more_predicted, weight))
    value = float(weight * more_predicted.mean() + (measured - weight * predicted).mean())
    error = float(np.sqrt(variance))
    # Student's quantile: the papers' intervals are for many measurements, and a rig gives few.
    half = float(stats.t.ppf(0.975, n - 1)) * error
    return PoweredMean(value, value - half, value + half, error, float(np.sqrt(classical)), weight,
                       classical / variance if variance > 0 else 1.0)


def _variances(measured, predicted, more_predicted, weight=None):
    """Weight, and variances of the powered and of the classical mean; (..., n) and (..., N)."""
    n, more = measured.shape[-1], more_predicted.shape[-1]
    if weight is None:
        pooled = np.var(np.concatenate([predicted, more_predicted], -1), axis=-1, ddof=1)
        centred = measured - measured.mean(-1, keepdims=True)
        covariance = (centred * predicted).sum(-1) / (n - 1)
        weight = np.clip(covariance / np.where(pooled > 0, (1 + n / more) * pooled, np.inf), 0, 1)
    weight = np.asarray(weight, float)
    corrected = measured - weight[..., None] * predicted
    variance = np.var(corrected, axis=-1, ddof=1) / n + weight**2 * np.var(more_predicted, axis=-1, ddof=1) / more
    return weight, variance, np.var(measured, axis=-1, ddof=1) / n


def bootstrap_gain(measured: np.ndarray, predicted: np.ndarray, more_predicted: np.ndarray, rng: np.random.Generator,
                   repeats: int = 500) -> tuple[float, float, float]:
    """effective_over_measured with its 95 % interval (value, low, high): measurements with their predictions are drawn
    again together, the others by themselves."""
    value = powered_mean(measured, predicted, more_predicted).effective_over_measured
    gains = []
    for _ in range(0, repeats, 50):  # fifty at once: fast, and little memory
        rows = rng.integers(len(measured), size=(50, len(measured)))
        others = rng.integers(len(more_predicted), size=(50, len(more_predicted)))
        _, variance, classical = _variances(measured[rows], predicted[rows], more_predicted[others])
        # Where nothing varies nothing can be saved, and nothing can be said.
        gains += list(classical[variance > 0] / variance[variance > 0])
    low, high = np.quantile(gains, [0.025, 0.975]) if gains else (float("nan"), float("nan"))
    return value, float(low), float(high)


def simulated_per_measured(gain: float, n: int, more: int) -> float:
    """How many simulated touches one measured one is worth: `more` of them stand for (gain - 1) n measured ones; infinite
    where they save nothing."""
    saved = (gain - 1) * n
    return more / saved if saved > 0 else float("inf")
