"""Table 1 and figure 16 of the seed: touch and sight together, by product and by weighted sum, for all training sets."""

from __future__ import annotations

import dataclasses
import itertools

import matplotlib.pyplot as plt
import numpy as np

from .. import figures, fusion_rules, paired, plans
from ..context import Context
from ..experiment import Experiment
from ..features import FeatureSets, dealt_sets, drawn_sets, joined
from ..measured_sets import part, split
from ..picture_data import FeatureCache, virtual
from ..result import Comparison, Result, Table
from ..statistics import estimate_share
from ..touch_data import TouchData
from ..two_senses import METHODS, Fused, Sense, by_image, by_pictures, by_touch, fused, virtual_sets
from .image_augmentation import COPIES, MeasuredFeatures, train_with
from .image_recognition import CLASSES, measured_split, sizes
from .noise_in_training import REAL, TEST_SETS, TEST_SHARE, VIRTUAL

_SWEPT = range(0, len(fusion_rules.WEIGHTS), 2)  # what the table shows: 0, 0.1, ...


def per_set(context: Context) -> int:
    """Touches of a set; a quick run has too few measured ones for the seed's 15."""
    return context.settings.pick(5, 15)


@dataclasses.dataclass(frozen=True)
class MeasuredTouches:
    """Sets of a rig's touches; no pose of one part is in another.

    Attributes:
      train, test: of the seed's 160 touches, and of a fifth of the poses.
      validation: of poses that are in neither.
      touches: of the training.
    """

    train: FeatureSets
    validation: FeatureSets
    test: FeatureSets
    touches: int


def measured_touches(touches: TouchData, count: int, rng: np.random.Generator) -> MeasuredTouches:
    """`count` touches a set."""
    rows, tested = split(touches, TEST_SHARE, rng)
    rest = touches[rows]
    rows, kept = split(rest, TEST_SHARE / (1 - TEST_SHARE), rng)
    train = part(rest[rows], REAL, rng)
    return MeasuredTouches(drawn_sets(train, count, len(train), rng), drawn_sets(rest[kept], count, 100, rng),
                           drawn_sets(touches[tested], count, TEST_SETS, rng), len(train))


def all_virtual(context: Context, cache: FeatureCache, seed: int) -> Fused:
    """Trained and tested on virtual data alone; what is tested on is drawn with another seed."""
    size, count = sizes(context), per_set(context)
    train, validation = virtual_sets(context.simulated(VIRTUAL, model=plans.NOISY, seed=seed), count, np.random.default_rng([seed, 3]))
    unseen = context.simulated(count * 40 * CLASSES, model=plans.NOISY, seed=seed, use="testing")
    touch = by_touch(seed, train, validation, dealt_sets(unseen, count, np.random.default_rng([seed, 5])))
    image = by_pictures(cache(virtual(context, size.train_per_object, seed)), CLASSES, seed,
                        cache(virtual(context, size.test_per_object, seed, use="testing")))
    return fused(touch, image)


def run(context: Context) -> Result:
    settings, cache, size = context.settings, FeatureCache(context), sizes(context)
    real = MeasuredFeatures(context, cache)
    touches = context.measured(plans.measured(settings), options=plans.RIG)
    count = per_set(context)
    names = ("virtual", f"virtual + {settings.measured_kind}")
    found: dict[tuple[str, str], list[Fused]] = {(a, b): [] for a, b in itertools.product(names, names)}
    virtual_only, trained = [], 0
    for step, seed in enumerate(settings.runs):
        context.progress(step / settings.seeds, f"seed {seed}")
        measured = measured_touches(touches, count, np.random.default_rng([seed, 2]))
        trained = measured.touches
        sets, kept = virtual_sets(context.simulated(VIRTUAL, model=plans.NOISY, seed=seed), count, np.random.default_rng([seed, 3]))
        felt = [by_touch(seed, sets, kept, measured.test),
                by_touch(seed, joined(sets, measured.train), measured.validation, measured.test)]
        seen = _by_images(cache(virtual(context, size.train_per_object, seed)), real, *measured_split(context, real.pool, seed), seed)
        for (touch_name, touch), (image_name, image) in itertools.product(zip(names, felt), zip(names, seen)):
            found[touch_name, image_name].append(fused(touch, image))
        virtual_only.append(all_virtual(context, cache, seed))
    return _result(context, cache, found, virtual_only, trained)


def _by_images(features, real: MeasuredFeatures, training, testing, seed) -> list[Sense]:
    """Of virtual pictures, and of these and measured ones with their scaled copies; the latter is validated on measured ones
    alone."""
    test = real.seen[testing]
    both = train_with(features, real, training, COPIES, seed)
    kept = both.validation[both.validation >= len(features)] - len(features)
    return [by_pictures(features, CLASSES, seed, test), by_image(both, real.training(training, COPIES)[kept], test)]


def _result(context, cache, found, virtual_only, trained):
    settings, size, kind = context.settings, sizes(context), context.settings.measured_kind
    column = lambda runs, name: [each.accuracy[name] for each in runs]
    cells = {f"{touch} x {image}": runs for (touch, image), runs in found.items()}
    rows = [[*key.split(" x "), kind, *_row(runs)] for key, runs in cells.items()] + [["virtual", "virtual", "virtual", *_row(virtual_only)]]
    best = list(cells.values())[-1]
    made_on = [
        (f"touch: {VIRTUAL} virtual touches, others for every seed, a fifth of them for validation, and {trained} {kind} ones where they "
         f"are; {TEST_SHARE:.0%} of the poses of the {plans.measured(settings).samples(CLASSES):,} {kind} touches, made once, for testing, parted "
         f"anew for every seed; sets of {per_set(context)}"),
        (f"image: {size.train_per_object * CLASSES:,} virtual pictures, others for every seed; {size.measured_train} {kind} ones with "
         f"{COPIES} scaled copies in training where they are, {size.measured_test} others in testing, drawn anew for every seed, made once"),
        ("pairs: every set of touches for testing with every picture for testing of the same object; the weight was chosen on data that are "
         f"neither trained on nor tested ({kind} ones alone where there are any), paired in the same way"), f"features of {cache.backbone}, frozen"]
    result = Result("", "", made_on=made_on)
    result.words = [
        f"Trained on virtual and {kind} data, fusion by product recognises {estimate_share(column(best, 'product')).words()} of the {kind} "
        f"pairs, touch alone {estimate_share(column(best, 'touch')).words()}, image alone {estimate_share(column(best, 'image')).words()}: "
        + "; ".join(paired.order("the product", column(best, "product"), f"{alone} alone", column(best, alone))
                    for alone in METHODS[:2]) + ".",
        *(_beaten(method, {**cells, "all virtual": virtual_only}) for method in METHODS[2:])]
    # In short; the whole of it is said once, below.
    touch = f"{VIRTUAL} virtual touches"
    image = f"{size.train_per_object * CLASSES:,} virtual pictures"
    more_touch, more_image = f"{touch} and {trained} {kind} ones", f"{image} and {size.measured_train} {kind} ones, scaled"
    why = (f"{cache.backbone.path.name} instead of ResNet-50; {kind} test data, whose poses are not trained on; how many touches a set of "
           "the seed's table has is not stated; every set is paired with every picture")
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
    groups = {**cells, "all virtual": virtual_only}
    result.tables += [_sweep(groups), _gains(groups)]
    confused = {name: np.sum([each.confusion[name] for each in best], 0) for name in METHODS}
    result.figures = [
        _draw(context, groups), _draw_sweep(context, groups),
        figures.confusion(context.figure_path("confusion"), f"What {kind} pairs are taken for, trained on virtual and {kind} data, all seeds "
                          "together: percent of each true object.", plans.OBJECTS, confused)]
    result.data = {key: [dataclasses.asdict(each) for each in runs] for key, runs in groups.items()}
    return result


def _sweep(groups) -> Table:
    """Accuracy by the weight of touch."""
    weights = [fusion_rules.WEIGHTS[k] for k in _SWEPT]
    return Table("Weighted sum, by the weight of touch", ["training sets (touch x image)", *(f"{weight:.1f}" for weight in weights)],
                 [[key, *(f"{100 * np.mean([each.sweep[k] for each in runs]):.1f} %" for k in _SWEPT)] for key, runs in groups.items()],
                 "Means over seeds, on the test pairs: 0 is sight alone, 1 touch alone. No weight was chosen by this table.")


def _draw_sweep(context, groups):
    lines = {key: [estimate_share([each.sweep[k] for each in runs]) for k in range(len(fusion_rules.WEIGHTS))] for key, runs in groups.items()}
    return figures.curves(context.figure_path("weights"), "Accuracy of the weighted sum over the weight of touch, on the test pairs. Bands: "
                          "95 % over seeds.", list(fusion_rules.WEIGHTS), lines, x_label="weight of touch", chance=1 / CLASSES)


def _beaten(method: str, groups) -> str:
    """For which training sets the method beats each sense alone, by the intervals of the paired differences."""
    lows = {key: [paired.difference([each.accuracy[method] for each in runs], [each.accuracy[alone] for each in runs])
                  for alone in METHODS[:2]]
            for key, runs in groups.items()}
    better = [key for key, both in lows.items() if all(each.low > 0 for each in both)]
    worse = [key for key, both in lows.items() if any(each.high < 0 for each in both)]
    return (f"Fusion by {method} is better than each sense alone for {len(better)} of {len(groups)} training sets (touch x image)"
            f"{': ' + ', '.join(better) if better else ''}; it is worse than one of them for "
            f"{', '.join(worse) if worse else 'none'}; elsewhere the intervals leave it open.")


def _gains(groups) -> Table:
    """Paired differences over seeds between fusion and each sense."""
    def points(runs, method, alone):
        found = paired.difference([each.accuracy[method] for each in runs], [each.accuracy[alone] for each in runs])
        return f"{100 * found.value:+.1f} ({100 * found.low:+.1f} to {100 * found.high:+.1f})"

    ways = [(method, alone) for method in METHODS[2:] for alone in METHODS[:2]]
    return Table("What fusion gains, in points of accuracy", ["training sets (touch x image)", *(f"{m} less {a}" for m, a in ways)],
                 [[key, *(points(runs, *way) for way in ways)] for key, runs in groups.items()],
                 "Paired over seeds, with 95 % intervals.")


def _row(runs):
    return [*(estimate_share([each.accuracy[name] for each in runs]).words() for name in METHODS), f"{np.mean([each.weight for each in runs]):.2f}"]


_LOOKS = {"touch": ("touch", 1.0), "image": ("image", 1.0), "product": ("both", 1.0), "weighted sum": ("both", 0.5)}


def _draw(context, groups):
    figure, axes = plt.subplots(figsize=(9, 4.2))
    for place, name in enumerate(METHODS):
        found = [estimate_share([each.accuracy[name] for each in runs]) for runs in groups.values()]
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
