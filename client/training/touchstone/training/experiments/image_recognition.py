"""Recognition of five objects by photographs: trained on simulated ones, tested on simulated and on measured ones."""

from __future__ import annotations

import dataclasses
import itertools

import numpy as np

from .. import controls, figures, image_head, paired
from ..context import Context
from ..experiment import Experiment
from ..features import FeatureSets
from ..picture_data import FeatureCache, Pictures, measured, split, virtual
from ..result import Comparison, Result
from ..settings import SUPERSHAPES
from ..statistics import estimate_share

CLASSES = len(SUPERSHAPES)


@dataclasses.dataclass(frozen=True)
class Sizes:
    """How many pictures; the seed's in a whole run: 400 an object, 400 virtual and 75 measured for testing, 74 for training, which
    three scaled copies of each make 296."""

    train_per_object: int
    test_per_object: int
    measured_per_object: int
    measured_test: int
    measured_train: int


def sizes(context: Context) -> Sizes:
    return context.settings.pick(Sizes(30, 10, 10, 25, 24), Sizes(400, 80, 30, 75, 74))


def measured_split(context: Context, pool: Pictures, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Rows of the measured pictures for training and for testing, of every object as many; drawn anew for each seed."""
    size = sizes(context)
    training, testing = split(pool, size.measured_test, seed)
    return np.random.default_rng([seed, 296]).permutation(training)[: size.measured_train], testing


def pooled(pictures: FeatureSets, maps: int) -> FeatureSets:
    """The mean of each map instead of its pixels."""
    means = pictures.values.reshape(len(pictures), maps, -1).mean(2)
    return dataclasses.replace(pictures, values=means)


def run(context: Context) -> Result:
    settings, size, cache = context.settings, sizes(context), FeatureCache(context)
    kind = settings.measured_kind
    pool = measured(context, size.measured_per_object)
    pool_features = cache(pool)
    found = {"virtual": [], kind: [], "virtual, pooled": [], f"{kind}, pooled": [], "shuffled": []}
    confused = {"virtual": np.zeros((CLASSES, CLASSES)), kind: np.zeros((CLASSES, CLASSES))}
    for step, seed in enumerate(settings.runs):
        context.progress(step / settings.seeds, f"seed {seed}")
        train = cache(virtual(context, size.train_per_object, seed))
        tests = {"virtual": cache(virtual(context, size.test_per_object, seed, use="testing")),
                 kind: pool_features[measured_split(context, pool, seed)[1]]}
        heads = {"": image_head.train(train, CLASSES, seed)}
        maps = cache.backbone.maps
        if maps:
            heads[", pooled"] = image_head.train(pooled(train, maps), CLASSES, seed)
        for (suffix, head), (name, test) in itertools.product(heads.items(), tests.items()):
            guessed = head.probabilities(pooled(test, maps) if suffix else test).argmax(1)
            found[name + suffix].append(float(np.mean(guessed == test.objects)))
            if not suffix:
                np.add.at(confused[name], (test.objects, guessed), 1)
        # The pooled features: a head on them is trained in a second, on all pixels in many.
        few, few_test = (pooled(each, maps) if maps else each for each in (train, tests["virtual"]))
        rng = context.rng("shuffled", seed)
        found["shuffled"].append([image_head.train(
            dataclasses.replace(few, objects=rng.permutation(few.objects)), CLASSES, seed).accuracy(few_test) for _ in range(settings.pick(10, 40))])
    return _result(context, cache, found, confused)


def _result(context, cache, found, confused):
    settings, size, kind = context.settings, sizes(context), context.settings.measured_kind
    on_virtual, on_measured = estimate_share(found["virtual"]), estimate_share(found[kind])
    control = controls.control(found["shuffled"], 1 / CLASSES)
    made_on = [
        (f"{size.train_per_object * CLASSES:,} virtual pictures for training (20 % of them for validation) and "
         f"{size.test_per_object * CLASSES:,} for testing, other poses for every seed"),
        (f"{size.measured_test} of {size.measured_per_object * CLASSES} {kind} pictures for testing, drawn anew for every seed; "
         "the pool is photographed once, so the intervals hold for these pictures"),
        "all pictures are normalised at their source: dark objects on white",
        f"features of {cache.backbone}, frozen; the head is trained anew for every seed"]
    why = (f"the backbone is {cache.backbone.path.name}, the seed's a ResNet-50; views, light and camera are ours; "
           f"the pictures for testing are {kind}")
    result = Result("", "", made_on=made_on, words=[
        (f"A head on a frozen image network recognises {on_virtual.words()} of the virtual and {on_measured.words()} of the {kind} "
         f"pictures; {paired.order('the virtual test', found['virtual'], f'the {kind} one', found[kind])}."),
        f"Virtual pictures by the means of the maps, {control.words()}.", cache.rate()])
    if found["virtual, pooled"]:
        result.words.insert(1, f"The mean of each map instead of its pixels: {estimate_share(found['virtual, pooled']).words()} of the virtual, "
                               f"{estimate_share(found[f'{kind}, pooled']).words()} of the {kind} pictures; on the latter "
                               f"{paired.order('flattened maps', found[kind], 'their means', found[f'{kind}, pooled'])}.")
    result.comparisons = [
        Comparison("tested on virtual pictures", on_virtual, 0.97, f"trained and tested on {made_on[0]}", why),
        Comparison(f"tested on {kind} pictures", on_measured, 0.583, f"trained on virtual ones; tested on {made_on[1]}", why)]
    result.figures = [figures.confusion(context.figure_path("confusion"), f"Trained on virtual pictures, all {settings.seeds} seeds "
                                        "together: percent of each true object.", SUPERSHAPES,
                                        {f"tested on {name}": matrix for name, matrix in confused.items()})]
    result.data = {"accuracy": found, "confusion": {name: matrix.tolist() for name, matrix in confused.items()},
                   "features": {"pictures": cache.pictures, "seconds": cache.seconds}, "control": vars(control.found)}
    return result


EXPERIMENT = Experiment("image_recognition", "Recognition by photographs",
                        "image recogniser (ResNet-50, frozen) trained on 400 virtual images an object: 97 % of 400 virtual and "
                        "58.3 % of 75 measured ones", run, (40, 900), needs_backbone=True)
