"""Table 1 and figure 16 of the seed: touch and sight together, by product and by weighted sum, for all training sets."""

from __future__ import annotations

import itertools

import matplotlib.pyplot as plt
import numpy as np

from .. import features, figures, fusion_rules, image_head, paired, plans, recognisers
from ..context import Context
from ..experiment import Experiment
from ..picture_data import FeatureCache, virtual
from ..result import Comparison, Result, Table
from ..statistics import estimate_share
from ..touch_data import TouchData
from .image_augmentation import COPIES, MeasuredFeatures, train_with
from .image_recognition import CLASSES, TEST_SEEDS, measured_split, sizes

METHODS = ("touch", "image", "product", "weighted sum")
# The seed's.
_SETS = 640


def _per_set(context: Context) -> int:
    """Touches of a set; a quick run has too few measured ones for the seed's 15."""
    return context.settings.pick(12, 15)


class TouchRecogniser:
    """XGBoost on sets of touches, 20 % of which are kept for validation.

    Attributes:
      validation: (probabilities (V, classes), objects (V,)) of sets that it was not trained on; of the last source alone.
    """

    def __init__(self, seed: int, *sources: tuple[np.ndarray, np.ndarray]):
        """`sources`: (sets, objects) of each: virtual, then measured where there are any."""
        kept = [self._held(objects, [seed, place]) for place, (_, objects) in enumerate(sources)]
        sets, objects = (np.concatenate([source[part][~held] for source, held in zip(sources, kept)]) for part in range(2))
        self._recogniser = recognisers.SEEDS["XGBoost"](seed).fit(sets, objects)
        self.validation = self.probabilities(sources[-1][0][kept[-1]]), sources[-1][1][kept[-1]]

    @staticmethod
    def _held(objects: np.ndarray, seed: list[int]) -> np.ndarray:
        """(N,) whether a set is kept for validation: at least one of every object."""
        held, rng = np.zeros(len(objects), bool), np.random.default_rng(seed)
        for k in range(CLASSES):
            mine = rng.permutation(np.flatnonzero(objects == k))
            held[mine[: max(1, round(image_head.VALIDATION * len(mine)))]] = True
        return held

    def probabilities(self, sets: np.ndarray) -> np.ndarray:
        """(N, classes)."""
        return self._recogniser.predict_proba(sets).astype(float)


def fused(touch: tuple[np.ndarray, np.ndarray], image: tuple[np.ndarray, np.ndarray],
          touch_validation: tuple[np.ndarray, np.ndarray], image_validation: tuple[np.ndarray, np.ndarray]) -> dict[str, float]:
    """Accuracy of each of METHODS, and "weight" of touch in the sum.

    Each argument: (N, classes) probabilities and (N,) true objects. Every set of touches is paired with every picture of
    the same object; all methods are tested on the same pairs. The weight is chosen on the validation pairs alone.
    """
    rows, columns = fusion_rules.pairs(touch_validation[1], image_validation[1])
    weight = fusion_rules.choose_weight(touch_validation[0][rows], image_validation[0][columns], touch_validation[1][rows])
    rows, columns = fusion_rules.pairs(touch[1], image[1])
    by_touch, by_image, objects = touch[0][rows], image[0][columns], touch[1][rows]
    said = dict(zip(METHODS, (by_touch, by_image, fusion_rules.product(by_touch, by_image),
                              fusion_rules.weighted_sum(by_touch, by_image, weight))))
    return {"weight": weight, **{name: float(np.mean(each.argmax(1) == objects)) for name, each in said.items()}}


def halves(touches: TouchData, seed: int) -> tuple[TouchData, TouchData]:
    """Training and test touches: half of every object's poses each. A pose that was repeated is with all its repeats in one."""
    rng, first = np.random.default_rng([seed, 2]), np.zeros(len(touches), bool)
    _, pose = np.unique(np.column_stack([touches.object, touches.target_mm, touches.approach, touches.lateral]).round(6), axis=0,
                        return_inverse=True)
    for k in range(CLASSES):
        mine = rng.permutation(np.unique(pose[touches.object == k]))
        first |= np.isin(pose, mine[: len(mine) // 2])
    return touches[first], touches[~first]


def touch_recognisers(context: Context, seed: int, real: TouchData | None = None) -> list[TouchRecogniser]:
    """Trained on virtual touches; then also one on virtual and on these measured ones, if there are any."""
    per_set, sets = _per_set(context), _SETS
    touches = context.simulated(per_set * sets, model=plans.NOISY, seed=seed)
    data = features.feature_sets(touches, per_set, np.random.default_rng([seed, 3]), sets=sets)
    found = [TouchRecogniser(seed, data)]
    if real is not None:
        more = features.feature_sets(real, per_set, np.random.default_rng([seed, 4]))
        found.append(TouchRecogniser(seed, data, more))
    return found


def all_virtual(context: Context, cache: FeatureCache, seed: int) -> dict[str, float]:
    """Trained and tested on virtual data alone; what is tested on is drawn with another seed."""
    size, per_set = sizes(context), _per_set(context)
    touch = touch_recognisers(context, seed)[0]
    unseen = context.simulated(per_set * 40 * CLASSES, model=plans.NOISY, seed=TEST_SEEDS + seed)
    sets, objects = features.feature_sets(unseen, per_set, np.random.default_rng([seed, 5]))
    train, test = virtual(context, size.train_per_object, seed), virtual(context, size.test_per_object, TEST_SEEDS + seed)
    values = cache(train)
    head = image_head.train(values, train.object, CLASSES, seed)
    return fused((touch.probabilities(sets), objects), (head.probabilities(cache(test)), test.object), touch.validation,
                 (head.probabilities(values[head.validation]), train.object[head.validation]))


def run(context: Context) -> Result:
    settings, cache, size = context.settings, FeatureCache(context), sizes(context)
    real = MeasuredFeatures(context, cache)
    touches = context.measured(plans.measured(settings), options=plans.RIG)
    per_set = _per_set(context)
    names = ("virtual", f"virtual + {settings.measured_kind}")
    found = {(a, b): [] for a, b in itertools.product(names, names)}
    virtual_only = []
    for step, seed in enumerate(settings.runs):
        context.progress(step / settings.seeds, f"seed {seed}")
        touch_training, touch_testing = halves(touches, seed)
        sets, objects = features.feature_sets(touch_testing, per_set, np.random.default_rng([seed, 6]))
        train = virtual(context, size.train_per_object, seed)
        values = cache(train)
        training, testing = measured_split(context, real.pool, seed)
        heads = _image_recognisers(values, train.object, real, training, seed)
        for (touch_name, touch), (image_name, (head, validation)) in itertools.product(
                zip(names, touch_recognisers(context, seed, touch_training)), zip(names, heads)):
            found[touch_name, image_name].append(fused(
                (touch.probabilities(sets), objects), (head.probabilities(real.features[testing]), real.pool.object[testing]),
                touch.validation, validation))
        virtual_only.append(all_virtual(context, cache, seed))
    return _result(context, cache, found, virtual_only)


def _image_recognisers(values, objects, real, rows, seed):
    """(head, its validation) of virtual pictures, and of these and measured ones with their scaled copies; the latter is
    validated on measured ones alone."""
    alone = image_head.train(values, objects, CLASSES, seed)
    both = train_with(values, objects, real, rows, COPIES, seed)
    more, more_objects, _ = real.training(rows, COPIES)
    kept = both.validation[both.validation >= len(values)] - len(values)
    return [(alone, (alone.probabilities(values[alone.validation]), objects[alone.validation])),
            (both, (both.probabilities(more[kept]), more_objects[kept]))]


def _result(context, cache, found, virtual_only):
    settings, size, kind = context.settings, sizes(context), context.settings.measured_kind
    column = lambda runs, name: [each[name] for each in runs]
    cells = {f"{touch} x {image}": runs for (touch, image), runs in found.items()}
    rows = [[*key.split(" x "), kind, *_row(runs)] for key, runs in cells.items()] + [["virtual", "virtual", "virtual", *_row(virtual_only)]]
    best = list(cells.values())[-1]
    made_on = [
        (f"touch: {_SETS} sets of {_per_set(context)} virtual touches, others for every seed; half (by poses) of the "
         f"{plans.measured(settings).samples(CLASSES):,} {kind} touches in training where they are, the other half in testing, divided "
         "anew for every seed, made once"),
        (f"image: {size.train_per_object * CLASSES:,} virtual pictures, others for every seed; {size.measured_train} {kind} ones with "
         f"{COPIES} scaled copies in training where they are, {size.measured_test} others in testing, drawn anew for every seed, made once"),
        ("pairs: every set of touches for testing with every picture for testing of the same object; 20 % of each training set "
         f"({kind} ones alone where there are any), paired in the same way, chose the weight"), f"features of {cache.backbone}, frozen"]
    result = Result("", "", made_on=made_on)
    result.words = [
        f"Trained on virtual and {kind} data, fusion by product recognises {estimate_share(column(best, 'product')).words()} of the {kind} "
        f"pairs, touch alone {estimate_share(column(best, 'touch')).words()}, image alone {estimate_share(column(best, 'image')).words()}: "
        + "; ".join(paired.order("the product", column(best, "product"), f"{alone} alone", column(best, alone))
                    for alone in METHODS[:2]) + ".",
        *(_beaten(method, {**cells, "all virtual": virtual_only}) for method in METHODS[2:])]
    # In short; the whole of it is said once, below.
    touch = f"{_SETS} virtual sets of touches"
    image = f"{size.train_per_object * CLASSES:,} virtual pictures"
    more_touch, more_image = f"{touch} and half of the {kind} touches", f"{image} and {size.measured_train} {kind} ones, scaled"
    why = (f"{cache.backbone.path.name} instead of ResNet-50; features of touches that the seed leaves open; {kind} test data; "
           "every set is paired with every picture")
    result.comparisons = [
        Comparison(f"fusion by product, virtual + {kind} in training", estimate_share(column(best, "product")), 0.957,
                   f"{more_touch}; {more_image}", why),
        Comparison(f"touch alone, virtual + {kind} in training", estimate_share(column(best, "touch")), 0.933, more_touch, why),
        Comparison(f"image alone, virtual + {kind} in training", estimate_share(column(best, "image")), 0.806, more_image, why),
        Comparison(f"fusion by product, virtual in training, tested on {kind}", estimate_share(column(next(iter(cells.values())), "product")), 0.893,
                   f"{touch}; {image}", why)]
    result.tables = [Table("Accuracy of pairs of a touch set and a picture", ["touch trained on", "image trained on", "tested on",
                                                                            *METHODS, "weight of touch"], rows,
                           "Means with 95 % intervals over seeds. The weight of touch in the sum has the least log loss on "
                           "validation pairs of the training data.")]
    result.tables.append(_gains({**cells, "all virtual": virtual_only}))
    result.figures = [_draw(context, {**cells, "all virtual": virtual_only})]
    result.data = {"cells": cells, "all_virtual": virtual_only}
    return result


def _beaten(method: str, groups) -> str:
    """For which training sets the method beats each sense alone, by the intervals of the paired differences."""
    lows = {key: [paired.difference([each[method] for each in runs], [each[alone] for each in runs]) for alone in METHODS[:2]]
            for key, runs in groups.items()}
    better = [key for key, both in lows.items() if all(each.low > 0 for each in both)]
    worse = [key for key, both in lows.items() if any(each.high < 0 for each in both)]
    return (f"Fusion by {method} is better than each sense alone for {len(better)} of {len(groups)} training sets (touch x image)"
            f"{': ' + ', '.join(better) if better else ''}; it is worse than one of them for "
            f"{', '.join(worse) if worse else 'none'}; elsewhere the intervals leave it open.")


def _gains(groups) -> Table:
    """Paired differences over seeds between fusion and each sense."""
    def points(runs, method, alone):
        found = paired.difference([each[method] for each in runs], [each[alone] for each in runs])
        return f"{100 * found.value:+.1f} ({100 * found.low:+.1f} to {100 * found.high:+.1f})"

    ways = [(method, alone) for method in METHODS[2:] for alone in METHODS[:2]]
    return Table("What fusion gains, in points of accuracy", ["training sets (touch x image)", *(f"{m} less {a}" for m, a in ways)],
                 [[key, *(points(runs, *way) for way in ways)] for key, runs in groups.items()],
                 "Paired over seeds, with 95 % intervals.")


def _row(runs):
    return [*(estimate_share([each[name] for each in runs]).words() for name in METHODS), f"{np.mean([each['weight'] for each in runs]):.2f}"]


_LOOKS = {"touch": ("touch", 1.0), "image": ("image", 1.0), "product": ("both", 1.0), "weighted sum": ("both", 0.5)}


def _draw(context, groups):
    figure, axes = plt.subplots(figsize=(9, 4.2))
    for place, name in enumerate(METHODS):
        found = [estimate_share([each[name] for each in runs]) for runs in groups.values()]
        thing, alpha = _LOOKS[name]
        heights = np.array([100 * each.value for each in found])
        reach = [[100 * (each.value - each.low) for each in found], [100 * (each.high - each.value) for each in found]]
        axes.bar(np.arange(len(groups)) + (place - 1.5) * 0.2, heights, 0.18, color=figures.colour(thing), alpha=alpha, label=name,
                 yerr=np.nan_to_num(reach), error_kw={"ecolor": "#1f2933", "elinewidth": 1, "capsize": 2})
    axes.axhline(100 / CLASSES, color="#7b8794", linestyle=":", linewidth=1)
    axes.annotate("chance", (1, 100 / CLASSES), xycoords=("axes fraction", "data"), ha="right", va="bottom", fontsize=8, color="#7b8794")
    labels = [f"touch: {touch}\nimage: {image}" for touch, image in (key.split(" x ") for key in groups if " x " in key)]
    axes.set_xticks(range(len(groups)), [*labels, "all virtual,\ntested on virtual"], fontsize=8)
    axes.set(ylabel="accuracy, %", ylim=(0, 102))
    axes.grid(False, axis="x")
    axes.legend(loc="lower center", ncols=4, bbox_to_anchor=(0.5, 1.0))
    kind = context.settings.measured_kind
    return figures.save(figure, context.figure_path("bars"), f"Accuracy by training sets, tested on {kind} data but for the last "
                        "group. Bars: 95 % intervals over seeds.")


EXPERIMENT = Experiment("fusion", "Fusion of touch and sight",
                        "table 1 and figure 16: 95.7 % by fusion, 93.3 % by touch, 80.6 % by image; 89.3 % with all training virtual",
                        run, (15, 200), needs_backbone=True)
