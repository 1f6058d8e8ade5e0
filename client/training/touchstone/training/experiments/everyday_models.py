"""Figures 17 and 18 of the seed: ten everyday models by touch, by sight and by both; trained without noise, tested with it."""

from __future__ import annotations

import contextlib
import dataclasses
import pathlib
from collections.abc import Sequence

import matplotlib.pyplot as plt
import numpy as np

import touchstone
from touchstone.own_server import OwnServer

from .. import figures, paired, plans, recognisers
from ..context import Context
from ..experiment import Experiment
from ..features import dealt_sets, drawn_sets, some
from ..picture_data import FeatureCache, photographed
from ..result import Comparison, Result, Table
from ..separation import pose_seed
from ..statistics import estimate_share, estimates
from ..touch_data import collect
from ..two_senses import METHODS, by_pictures, by_touch, fused, virtual_sets

SIZE_MM = 150  # of the longest side: that of the shipped shapes; the models have no unit
# Touches of an object in training are those of the seed's five objects: 640 of them together.
PER_OBJECT, TEST_SETS, TOUCHES = 128, 500, 15
# From all sides, as the seed touches them; a finger that misses makes the source draw the touch again.
PLAN = touchstone.sphere(step_angle_deg=1, roll_step_deg=1)
# Noise of pictures: that of the emulated rig's camera (plans.RIG). The seed states none for these figures.
NOISY_PICTURES = ("touchstone: model/1\nname: noisy_pictures\nend_effector: {fingers: 3, spacing_mm: 30}\neffects:\n"
                  "  - radial_distortion: {k1: -0.1}\n  - gamma: {exponent: 0.85}\n  - image_noise: {sigma_grey: 3}\n")


@dataclasses.dataclass
class Group:
    """What was found of some objects.

    Attributes:
      objects: their names.
      accuracy: (training model, seeds, touches of a set) by touch.
      confusion: by touch at TOUCHES, trained without noise.
      senses: of each seed, both senses together; empty without a backbone.
    """

    objects: list[str]
    accuracy: np.ndarray
    confusion: np.ndarray
    senses: list


def run(context: Context) -> Result:
    settings = context.settings
    files = sorted(settings.everyday.glob("*.off")) if settings.everyday else []
    counts = settings.pick([5, 15], [5, 10, 15, 20, 25, 30])
    cache = FeatureCache(context) if settings.backbone else None
    sources: dict[str, tuple[touchstone.Client, Sequence[str]]] = {"shipped shapes": (context.simulator, plans.OBJECTS)}
    with contextlib.ExitStack() as stack:
        if files:
            sources["everyday models"] = (_serve(files, stack), [file.stem for file in files])
        groups = {name: _recognise(context, cache, name, client, objects, counts) for name, (client, objects) in sources.items()}
    return _result(context, cache, counts, groups)


def _serve(files: list[pathlib.Path], stack: contextlib.ExitStack) -> touchstone.Client:
    """A simulator with these meshes."""
    server = OwnServer([word for file in files for word in ("--mesh", f"{file.stem}={file},fit_mm={SIZE_MM}")])
    stack.callback(server.stop)
    return stack.enter_context(touchstone.connect(server.target))


def _pictures(context: Context) -> tuple[int, int]:
    """Of an object, for training and for testing."""
    return context.settings.pick((16, 8), (50, 20))


def _recognise(context, cache, name, client, objects, counts) -> Group:
    settings, classes = context.settings, len(objects)
    models = {"ideal": plans.IDEAL, "noisy": plans.NOISY}
    group = Group(list(objects), np.zeros((len(models), settings.seeds, len(counts))), np.zeros((classes, classes), int), [])
    for step, seed in enumerate(settings.runs):
        context.progress(step / settings.seeds, f"{name}, seed {seed}")
        touch = lambda samples, model, use, seed=seed: collect(client, objects, PLAN, samples, model=model, seed=pose_seed(use, "everyday", seed))
        pools = {kind: touch(PER_OBJECT * classes, model, "training") for kind, model in models.items()}
        tests = touch((TEST_SETS + 2 * classes) * max(counts), plans.NOISY, "testing")
        # In steps of a degree a pose comes again now and then.
        tests = tests[~np.isin(tests.poses(), pools["ideal"].poses())]
        for place, touches in enumerate(counts):
            rng = context.rng(name, "test", seed, touches)
            test = some(dealt_sets(tests, touches, rng), TEST_SETS, rng)
            for k, kind in enumerate(models):
                train = drawn_sets(pools[kind], touches, len(pools[kind]), context.rng(name, kind, seed, touches))
                recogniser = recognisers.Trained(recognisers.SEEDS["XGBoost"](seed), train)
                group.accuracy[k, step, place] = recogniser.accuracy(test)
                if kind == "ideal" and touches == TOUCHES:
                    group.confusion += recognisers.confusion(recogniser, test, classes)
        if cache is not None:
            group.senses.append(_both(context, cache, client, objects, pools["ideal"], tests, seed))
    return group


def _both(context, cache, client, objects, pool, tests, seed):
    """Both senses, trained without noise and tested with it."""
    per_object, test_per_object = _pictures(context)
    train, validation = virtual_sets(pool, TOUCHES, np.random.default_rng([seed, 3]))
    rng = np.random.default_rng([seed, 5])
    sets = some(dealt_sets(tests, TOUCHES, rng), 40 * len(objects), rng)
    pictures = lambda count, use, model: cache(photographed(client, objects, count, pose_seed(use, "everyday pictures", seed), model=model))
    image = by_pictures(pictures(per_object, "training", plans.IDEAL), len(objects), seed, pictures(test_per_object, "testing", NOISY_PICTURES))
    return fused(by_touch(seed, train, validation, sets), image)


def _result(context, cache, counts, groups):
    place = counts.index(TOUCHES)
    result = Result("", "", made_on=[
        (f"simulated touches alone, from all sides (sphere), new for every seed: {PER_OBJECT} touches of an object in training, {TEST_SETS} sets of "
         "others with the seed's noise in testing; XGBoost"), *(f"{name}: {', '.join(group.objects)}" for name, group in groups.items())])
    if cache is not None:
        result.made_on.append(f"{_pictures(context)[0]} pictures of an object without noise in training, {_pictures(context)[1]} others with a rig "
                              f"camera's lens, gamma and noise in testing, normalised; features of {cache.backbone}, frozen")
    if "everyday models" in groups:
        result.made_on.append(f"the everyday models have no unit: their longest side is {SIZE_MM} mm")
        everyday, shipped = (groups[name].accuracy[0, :, place] for name in ("everyday models", "shipped shapes"))
        result.words = [
            (f"Trained without noise, with {TOUCHES} touches a set, {estimate_share(everyday).words()} of the noisy sets of ten everyday models "
             f"are recognised (chance 10%) and {estimate_share(shipped).words()} of five shipped shapes (chance 20%): "
             f"{paired.order('the former', everyday, 'the latter', shipped)}. The seed found them comparable.")]
        result.comparisons = [Comparison(f"ten everyday models, {TOUCHES} touches a set", estimate_share(everyday), None,
                                         "trained on ideal, tested on noisy simulated sets", "the seed shows a figure without numbers")]
    else:
        result.words = [(f"The everyday models are not here (--everyday FOLDER): the shipped shapes take their place, of whose noisy sets "
                         f"{estimate_share(groups['shipped shapes'].accuracy[0, :, place]).words()} are recognised after training without noise.")]
    for name, group in groups.items():
        _touch_part(context, result, counts, name, group)
    if cache is None:
        result.words.append("Sight, and touch with sight, were left out: they need --backbone FILE.onnx.")
    else:
        _sight_part(context, result, groups)
    result.figures.insert(0, figures.curves(
        context.figure_path("curves"), "Accuracy by touch on noisy sets after training without noise. Bands: 95 % over seeds.", counts,
        {name: estimates(group.accuracy[0]) for name, group in groups.items()}, x_label="touches a feature set"))
    result.data = {"touches": counts, "objects": {name: group.objects for name, group in groups.items()},
                   "accuracy": {name: group.accuracy.tolist() for name, group in groups.items()},
                   "senses": {name: [dataclasses.asdict(each) for each in group.senses] for name, group in groups.items()}}
    return result


def _touch_part(context, result, counts, name, group):
    ideal, noisy = (group.accuracy[k, :, counts.index(TOUCHES)] for k in (0, 1))
    result.words.append(f"{name[0].upper() + name[1:]}: {paired.order('training with noise', noisy, 'training without', ideal)}.")
    result.tables.append(Table(f"Accuracy by touch on noisy sets of {name}", ["trained on", *(f"{n} touches" for n in counts)],
                               [[kind, *(p.words() for p in estimates(group.accuracy[k]))] for k, kind in enumerate(("ideal", "noisy"))]))
    result.figures.append(figures.confusion(
        context.figure_path("confusion-" + name.split()[0]), f"What each of the {name} is taken for by touch, % of its noisy sets of {TOUCHES} "
        "touches, after training without noise; all seeds together.", group.objects, {"touch": group.confusion}))


def _sight_part(context, result, groups):
    rows = [[name, *(estimate_share([each.accuracy[method] for each in group.senses]).words() for method in METHODS),
             f"{np.mean([each.weight for each in group.senses]):.2f}"] for name, group in groups.items()]
    result.tables.append(Table(f"Touch, sight and both on noisy data, trained without noise; {TOUCHES} touches a set",
                               ["objects", *METHODS, "weight of touch"], rows))
    for name, group in groups.items():
        product, alone = ([each.accuracy[method] for each in group.senses] for method in ("product", "image"))
        result.words.append(f"{name[0].upper() + name[1:]}, touch and sight: {paired.order('the product', product, 'sight alone', alone)}.")
        result.figures.append(figures.confusion(
            context.figure_path("senses-" + name.split()[0]), f"What each of the {name} is taken for by sight and by both senses, % of noisy "
            "pictures and pairs, after training without noise; all seeds together.", group.objects,
            {method: np.sum([each.confusion[method] for each in group.senses], 0) for method in ("image", "product")}))
    result.figures.append(_bars(context, groups))


def _bars(context, groups):
    figure, axes = plt.subplots(figsize=(7, 3.6))
    for k, (method, look) in enumerate((("touch", "touch"), ("image", "image"), ("product", "both"))):
        points = [estimate_share([each.accuracy[method] for each in group.senses]) for group in groups.values()]
        axes.bar(np.arange(len(groups)) + 0.26 * (k - 1), [100 * p.value for p in points], 0.24, color=figures.colour(look), label=method,
                 yerr=np.nan_to_num([[100 * (p.value - p.low) for p in points], [100 * (p.high - p.value) for p in points]]),
                 error_kw={"ecolor": "#1f2933", "elinewidth": 1, "capsize": 2})
    axes.set_xticks(range(len(groups)), [f"{name}\nchance {100 / len(group.objects):.0f} %" for name, group in groups.items()])
    axes.set(ylabel="accuracy, %", ylim=(0, 102))
    axes.grid(False, axis="x")
    axes.legend(loc="lower center", ncols=3, bbox_to_anchor=(0.5, 1.0))
    return figures.save(figure, context.figure_path("senses"), f"By touch ({TOUCHES} touches a set), by sight and by their product, on noisy data "
                        "after training without noise. Bars: 95 % over seeds.")


EXPERIMENT = Experiment("everyday_models", "Ten everyday models", "figures 17 and 18: ten everyday models by touch, sight and both, ideal "
                        "training, noisy test, comparable to the five", run, (20, 400))
