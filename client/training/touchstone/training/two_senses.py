"""Touch and sight of the same objects: recognisers with what chooses the weight of their sum, and both joined on pairs."""

from __future__ import annotations

import dataclasses

import numpy as np

from . import fusion_rules, image_head, recognisers
from .features import FeatureSets, drawn_sets
from .image_head import Head
from .measured_sets import split
from .touch_data import TouchData

METHODS = ("touch", "image", "product", "weighted sum")
_VALIDATION_SETS = 100
_HELD = 0.2  # of virtual touches, by poses: validation


@dataclasses.dataclass(frozen=True)
class Said:
    """Probabilities of objects, and which is true: of sets of touches, or of pictures."""

    probabilities: np.ndarray
    objects: np.ndarray


@dataclasses.dataclass(frozen=True)
class Sense:
    """What one sense says of what is tested, and of validation data that it was not trained on."""

    test: Said
    validation: Said


def virtual_sets(touches: TouchData, per_set: int, rng: np.random.Generator) -> tuple[FeatureSets, FeatureSets]:
    """(sets for training, sets for validation) of `per_set` touches; no touch is in both."""
    rows, held = split(touches, _HELD, rng)
    return drawn_sets(touches[rows], per_set, len(touches), rng), drawn_sets(touches[held], per_set, _VALIDATION_SETS, rng)


def by_touch(seed: int, train: FeatureSets, validation: FeatureSets, test: FeatureSets) -> Sense:
    """XGBoost on feature sets."""
    recogniser = recognisers.Trained(recognisers.SEEDS["XGBoost"](seed), train)
    return Sense(*(Said(recogniser.probabilities(sets), sets.objects) for sets in (test, validation)))


def by_image(head: Head, validation: FeatureSets, test: FeatureSets) -> Sense:
    """`validation`: pictures that the head was not trained on."""
    return Sense(*(Said(head.probabilities(pictures), pictures.objects) for pictures in (test, validation)))


def by_pictures(train: FeatureSets, classes: int, seed: int, test: FeatureSets) -> Sense:
    """A head trained on these pictures, validated on a fifth of them that it kept."""
    head = image_head.train(train, classes, seed)
    return by_image(head, train[head.validation], test)


@dataclasses.dataclass(frozen=True)
class Fused:
    """Attributes:
      accuracy: of each of METHODS on the same pairs.
      weight: of touch in the sum, chosen on validation pairs alone.
      sweep: accuracy of the sum for each of fusion_rules.WEIGHTS.
      confusion: (true, recognised) counts of each of METHODS.
    """

    accuracy: dict[str, float]
    weight: float
    sweep: list[float]
    confusion: dict[str, list[list[int]]]


def fused(touch: Sense, image: Sense) -> Fused:
    """Every set of touches is paired with every picture of the same object."""
    rows, columns = fusion_rules.pairs(touch.validation.objects, image.validation.objects)
    weight = fusion_rules.choose_weight(touch.validation.probabilities[rows], image.validation.probabilities[columns],
                                        touch.validation.objects[rows])
    rows, columns = fusion_rules.pairs(touch.test.objects, image.test.objects)
    felt, seen, objects = touch.test.probabilities[rows], image.test.probabilities[columns], touch.test.objects[rows]
    sums = [fusion_rules.weighted_sum(felt, seen, each) for each in fusion_rules.WEIGHTS]
    said = dict(zip(METHODS, (felt, seen, fusion_rules.product(felt, seen), fusion_rules.weighted_sum(felt, seen, weight))))
    classes = felt.shape[1]
    counts = {name: np.bincount(objects * classes + each.argmax(1), minlength=classes**2).reshape(classes, classes) for name, each in said.items()}
    right = lambda each: float(np.mean(each.argmax(1) == objects))
    return Fused({name: right(each) for name, each in said.items()}, weight, [right(each) for each in sums],
                 {name: matrix.tolist() for name, matrix in counts.items()})
