"""Recognition touch by touch: what each touch says of the objects, and which touch would say most.

An observation is the contact times of one touch less the first finger's, NaN for a finger that met nothing within the
stroke: that a finger passed is evidence as well.
"""

from __future__ import annotations

import dataclasses

import numpy as np

# How often a touch is like none of the simulated ones (an edge missed by a hair, a stuck finger), and then over what range
# its times lie, microseconds. Without it one odd touch would rule out the right object for good.
ODD = 0.02
ODD_RANGE_US = 2e6


@dataclasses.dataclass(frozen=True)
class Expected:
    """What candidate touches give by a model, simulated once.

    Attributes:
      times_us: (candidates, objects, fingers) without noise; NaN: no contact.
      scatter_us: of a finger's time about it: the sensor's noise and the model's error.
      free_space: False: touches of which a finger's time is missing say nothing.
    """

    times_us: np.ndarray
    scatter_us: float
    free_space: bool = True

    def log_likelihood(self, candidate: np.ndarray, observed_us: np.ndarray) -> np.ndarray:
        """(..., objects) natural logarithms, for (...) indices of candidates and (..., fingers) observations.

        With m of the fingers reporting: where the same ones are expected, a normal density of the m - 1 contrasts among
        them; a share ODD is spread evenly over every pattern of reporting fingers and ODD_RANGE_US of each contrast.
        """
        expected = self.times_us[candidate]  # (..., objects, fingers)
        observed = np.asarray(observed_us, float)[..., None, :]
        seen = np.isfinite(observed)
        same = (seen == np.isfinite(expected)).all(-1)
        difference = np.where(seen & np.isfinite(expected), observed - np.nan_to_num(expected), 0)
        contrasts = np.maximum(seen.sum(-1) - 1, 0)
        mean = difference.sum(-1, keepdims=True) / np.maximum(seen.sum(-1, keepdims=True), 1)
        square = (np.where(seen, difference - mean, 0) ** 2).sum(-1)
        normal = np.log1p(-ODD) - square / (2 * self.scatter_us**2) - contrasts * np.log(self.scatter_us * np.sqrt(2 * np.pi))
        odd = np.log(ODD) - observed.shape[-1] * np.log(2) - contrasts * np.log(ODD_RANGE_US)
        said = np.where(same, np.logaddexp(normal, odd), odd)
        return said if self.free_space else np.where(seen.all(-1), said, 0.0)

    def outcomes(self, rng: np.random.Generator, draws: int = 16) -> np.ndarray:
        """(candidates, objects, draws, objects) log-likelihoods of what might be observed of each object."""
        candidates, objects, fingers = self.times_us.shape
        noise = rng.normal(0, self.scatter_us, (candidates, objects, draws, fingers))
        return self.log_likelihood(np.arange(candidates)[:, None, None], self.times_us[:, :, None] + noise)


def posterior(log_posterior: np.ndarray) -> np.ndarray:
    """(..., objects) probabilities from logarithms up to a constant."""
    shares = np.exp(log_posterior - log_posterior.max(-1, keepdims=True))
    return shares / shares.sum(-1, keepdims=True)


def expected_information(log_posterior: np.ndarray, outcomes: np.ndarray) -> np.ndarray:
    """(candidates,) how much less uncertain, in nats, each touch is expected to leave which object it is: the mutual
    information of object and observation, over the draws of `outcomes` (Lindley 1956)."""
    now = posterior(log_posterior)
    then = posterior(log_posterior + outcomes)  # (candidates, true object, draws, objects)
    left = -(then * np.log(np.maximum(then, 1e-300))).sum(-1).mean(-1)
    return -(now * np.log(np.maximum(now, 1e-300))).sum() - (left * now).sum(-1)


@dataclasses.dataclass(frozen=True)
class Episode:
    """How one recognition went: the answer, its probability, whether that reached what was asked, touches made."""

    answer: int
    certainty: float
    sure: bool
    touches: int


def recognise(expected: Expected, observed_us: np.ndarray, reachable: np.ndarray, policy: str, rng: np.random.Generator, *,
              outcomes: np.ndarray | None = None, certainty: float = 0.95) -> Episode:
    """Touches until one object has this probability, or everything within reach was touched.

    observed_us: (candidates, fingers) what each touch gives. reachable: candidates, each made once at most. policy:
    "information" (needs `outcomes`), "random" or "fixed" (in the order of `reachable`).
    """
    left = list(rng.permutation(reachable) if policy == "random" else reachable)
    log_posterior = np.zeros(expected.times_us.shape[1])
    made = 0
    while True:
        now = posterior(log_posterior)
        if now.max() >= certainty or not left:
            return Episode(int(now.argmax()), float(now.max()), bool(now.max() >= certainty), made)
        place = 0
        if policy == "information":
            assert outcomes is not None, "this policy needs them"
            place = int(expected_information(log_posterior, outcomes[left]).argmax())
        chosen = left.pop(place)
        log_posterior = log_posterior + expected.log_likelihood(chosen, observed_us[chosen])
        made += 1
