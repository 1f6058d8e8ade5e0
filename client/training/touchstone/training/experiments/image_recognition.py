"""Recognition of five objects by photographs: trained on simulated ones, tested on simulated and on measured ones."""

from __future__ import annotations

import dataclasses

import numpy as np

from .. import figures, image_head, paired
from ..context import Context
from ..experiment import Experiment
from ..picture_data import FeatureCache, Pictures, measured, split, virtual
from ..result import Comparison, Result
from ..settings import SUPERSHAPES
from ..statistics import estimate_share

# Tested on other poses than those trained on.
TEST_SEEDS = 500_000
CLASSES = len(SUPERSHAPES)


@dataclasses.dataclass(frozen=True)
class Sizes:
    """How many pictures; the seed's in a whole run: 400 an object, 400 virtual and 75 measured for testing, 296 for training."""

    train_per_object: int
    test_per_object: int
    measured_per_object: int
    measured_test: int
    measured_train: int


def sizes(context: Context) -> Sizes:
    return context.settings.pick(Sizes(30, 10, 15, 25, 50), Sizes(400, 80, 75, 75, 296))


def measured_split(context: Context, pool: Pictures, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Rows of the measured pictures for training and for testing, of every object as many; drawn anew for each seed."""
    size = sizes(context)
    training, testing = split(pool, size.measured_test, seed)
    return np.random.default_rng([seed, 296]).permutation(training)[: size.measured_train], testing


def run(context: Context) -> Result:
    settings, size, cache = context.settings, sizes(context), FeatureCache(context)
    pool = measured(context, size.measured_per_object)
    pool_features = cache(pool)
    found = {"virtual": [], settings.measured_kind: [], "shuffled": []}
    confused = {"virtual": np.zeros((CLASSES, CLASSES)), settings.measured_kind: np.zeros((CLASSES, CLASSES))}
    for step, seed in enumerate(settings.runs):
        context.progress(step / settings.seeds, f"seed {seed}")
        train, test = virtual(context, size.train_per_object, seed), virtual(context, size.test_per_object, TEST_SEEDS + seed)
        features, test_features = cache(train), cache(test)
        head = image_head.train(features, train.object, CLASSES, seed)
        _, rows = measured_split(context, pool, seed)
        for kind, values, objects in (("virtual", test_features, test.object),
                                      (settings.measured_kind, pool_features[rows], pool.object[rows])):
            guessed = head.probabilities(values).argmax(1)
            found[kind].append(float(np.mean(guessed == objects)))
            np.add.at(confused[kind], (objects, guessed), 1)
        shuffled = context.rng("shuffled", seed).permutation(train.object)
        found["shuffled"].append(image_head.train(features, shuffled, CLASSES, seed).accuracy(test_features, test.object))
    return _result(context, cache, found, confused)


def _result(context, cache, found, confused):
    settings, size, kind = context.settings, sizes(context), context.settings.measured_kind
    on_virtual, on_measured, shuffled = estimate_share(found["virtual"]), estimate_share(found[kind]), estimate_share(found["shuffled"])
    chance = 1 / CLASSES
    made_on = [
        (f"{size.train_per_object * CLASSES:,} virtual pictures for training (20 % of them for validation) and "
         f"{size.test_per_object * CLASSES:,} for testing, other poses for every seed"),
        (f"{size.measured_test} of {size.measured_per_object * CLASSES} {kind} pictures for testing, drawn anew for every seed; "
         "the pool is photographed once, so the intervals hold for these pictures"),
        f"features of {cache.backbone}, frozen; the head is trained anew for every seed"]
    why = (f"the backbone is {cache.backbone.path.name}, the seed's a ResNet-50; views, light and camera are ours; "
           f"the pictures for testing are {kind}")
    told = "so the labels are what it learns from" if shuffled.low <= chance <= shuffled.high else "which is not what chance gives"
    result = Result("", "", made_on=made_on, words=[
        (f"A head on a frozen image network recognises {on_virtual.words()} of the virtual and {on_measured.words()} of the {kind} "
         f"pictures; {paired.order('the virtual test', found['virtual'], f'the {kind} one', found[kind])}."),
        f"With shuffled labels it recognises {shuffled.words()} of the virtual pictures, chance is {chance:.0%}: {told}.",
        cache.rate()])
    result.comparisons = [
        Comparison("tested on virtual pictures", on_virtual, 0.97, f"trained and tested on {made_on[0]}", why),
        Comparison(f"tested on {kind} pictures", on_measured, 0.583, f"trained on virtual ones; tested on {made_on[1]}", why)]
    result.figures = [figures.confusion(context.figure_path("confusion"), f"Trained on virtual pictures, all {settings.seeds} seeds "
                                        "together: percent of each true object.", SUPERSHAPES,
                                        {f"tested on {name}": matrix for name, matrix in confused.items()})]
    result.data = {"accuracy": found, "confusion": {name: matrix.tolist() for name, matrix in confused.items()},
                   "features": {"pictures": cache.pictures, "seconds": cache.seconds}, "chance": chance}
    return result


EXPERIMENT = Experiment("image_recognition", "Recognition by photographs",
                        "image recogniser (ResNet-50, frozen) trained on 400 virtual images an object: 97 % of 400 virtual and "
                        "58.3 % of 75 measured ones", run, (40, 900), needs_backbone=True)
