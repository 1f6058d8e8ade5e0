"""Late fusion of two senses: what each says of an object, as probabilities, becomes one statement."""

from __future__ import annotations

import numpy as np

# Weights of touch that are tried.
WEIGHTS = np.linspace(0, 1, 21)
_LEAST = 1e-12


def product(touch: np.ndarray, image: np.ndarray) -> np.ndarray:
    """(N, classes) of two such: their product, scaled so that each row adds up to 1."""
    # Logarithms: the product of two rows that exclude each other's favourite would be 0 everywhere.
    joint = np.log(np.maximum(touch, _LEAST)) + np.log(np.maximum(image, _LEAST))
    joint = np.exp(joint - joint.max(1, keepdims=True))
    return joint / joint.sum(1, keepdims=True)


def weighted_sum(touch: np.ndarray, image: np.ndarray, touch_weight: float) -> np.ndarray:
    """(N, classes): touch_weight * touch + (1 - touch_weight) * image; weight from 0 to 1."""
    if not 0 <= touch_weight <= 1:
        raise ValueError(f"a weight of touch of {touch_weight} is not from 0 to 1")
    return touch_weight * touch + (1 - touch_weight) * image


def log_loss(probabilities: np.ndarray, objects: np.ndarray) -> float:
    """Mean of -log of the true object's probability, nats."""
    return float(-np.log(np.maximum(probabilities[np.arange(len(objects)), objects], _LEAST)).mean())


def choose_weight(touch: np.ndarray, image: np.ndarray, objects: np.ndarray) -> float:
    """The weight of touch with the least log loss on validation data; accuracy would leave too many weights equal."""
    return float(min(WEIGHTS, key=lambda weight: log_loss(weighted_sum(touch, image, weight), objects)))


def pairs(touch_objects: np.ndarray, image_objects: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Rows of touch sets and of pictures: every set of touches with every picture of the same object."""
    touch, image = np.nonzero(touch_objects[:, None] == image_objects[None, :])
    return touch, image
