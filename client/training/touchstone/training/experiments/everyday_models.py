"""Figures 17 and 18 of the seed: ten everyday models, trained without noise, tested with it."""

from __future__ import annotations

import contextlib
import pathlib
from collections.abc import Sequence

import numpy as np

import touchstone
from touchstone.own_server import OwnServer

from .. import figures, paired, plans, recognisers
from ..context import Context
from ..experiment import Experiment
from ..features import feature_sets
from ..result import Comparison, Result, Table
from ..statistics import estimate_share, estimates
from ..touch_data import collect

SIZE_MM = 150  # of the longest side: that of the shipped shapes; the models have no unit
TRAINING_SETS, TEST_SETS, TOUCHES = 640, 500, 15
# From all sides, as the seed touches them; a finger that misses makes the source draw the touch again.
PLAN = touchstone.sphere(step_angle_deg=1, roll_step_deg=1)


def run(context: Context) -> Result:
    settings = context.settings
    files = sorted(settings.everyday.glob("*.off")) if settings.everyday else []
    counts = settings.pick([5, 15], [5, 10, 15, 20, 25, 30])
    groups: dict[str, tuple[touchstone.Client, Sequence[str]]] = {"shipped shapes": (context.simulator, plans.OBJECTS)}
    with contextlib.ExitStack() as stack:
        if files:
            groups["everyday models"] = (_serve(files, stack), [file.stem for file in files])
        found, confusions = {}, {}
        for name, (client, objects) in groups.items():
            found[name], confusions[name] = _recognise(context, name, client, objects, counts)
    return _result(context, counts, {name: objects for name, (_, objects) in groups.items()}, found, confusions)


def _serve(files: list[pathlib.Path], stack: contextlib.ExitStack) -> touchstone.Client:
    """A simulator with these meshes."""
    server = OwnServer([word for file in files for word in ("--mesh", f"{file.stem}={file},fit_mm={SIZE_MM}")])
    stack.callback(server.stop)
    return stack.enter_context(touchstone.connect(server.target))


def _recognise(context, name, client, objects, counts):
    """((training model, seeds, counts) accuracies on noisy sets, confusions of training without noise at TOUCHES)."""
    settings, confusion = context.settings, np.zeros((len(objects), len(objects)), int)
    models = {"ideal": plans.IDEAL, "noisy": plans.NOISY}
    accuracies = np.zeros((len(models), settings.seeds, len(counts)))
    for step, seed in enumerate(settings.runs):
        context.progress(step / settings.seeds, f"{name}, seed {seed}")
        size = (TRAINING_SETS + len(objects)) * max(counts)
        pools = {kind: collect(client, objects, PLAN, size, model=model, seed=seed) for kind, model in models.items()}
        tests = collect(client, objects, PLAN, (TEST_SETS + len(objects)) * max(counts), model=plans.NOISY, seed=seed + 10_000)
        for place, touches in enumerate(counts):
            test = feature_sets(tests, touches, context.rng(name, "test", seed, touches), sets=TEST_SETS)
            for k, kind in enumerate(models):
                train = feature_sets(pools[kind], touches, context.rng(name, kind, seed, touches), sets=TRAINING_SETS)
                recogniser = recognisers.SEEDS["XGBoost"](seed).fit(*train)
                accuracies[k, step, place] = np.mean(recogniser.predict(test[0]) == test[1])
                if kind == "ideal" and touches == TOUCHES:
                    confusion = confusion + recognisers.confusion(recogniser, test, len(objects))
    return accuracies, confusion


def _result(context, counts, objects, found, confusions):
    place = counts.index(TOUCHES)
    result = Result("", "", made_on=[
        (f"simulated touches alone, from all sides (sphere), new for every seed: {TRAINING_SETS} sets in training, {TEST_SETS} with the "
         f"seed's noise in testing; XGBoost"), *(f"{name}: {', '.join(names)}" for name, names in objects.items())])
    if "everyday models" in objects:
        result.made_on.append(f"the everyday models have no unit: their longest side is {SIZE_MM} mm")
        everyday, shipped = (found[name][0, :, place] for name in ("everyday models", "shipped shapes"))
        chance = {name: 1 / len(names) for name, names in objects.items()}
        result.words = [
            (f"Trained without noise, with {TOUCHES} touches a set, {estimate_share(everyday).words()} of the noisy sets of ten everyday models "
             f"are recognised (chance {chance['everyday models']:.0%}) and {estimate_share(shipped).words()} of five shipped shapes (chance "
             f"{chance['shipped shapes']:.0%}): {paired.order('the former', everyday, 'the latter', shipped)}. The seed found them comparable.")]
        result.comparisons = [Comparison(f"ten everyday models, {TOUCHES} touches a set", estimate_share(everyday), None,
                                         "trained on ideal, tested on noisy simulated sets", "the seed shows a figure without numbers")]
    else:
        result.words = [(f"The everyday models are not here (--everyday FOLDER): the shipped shapes take their place, of whose noisy sets "
                         f"{estimate_share(found['shipped shapes'][0, :, place]).words()} are recognised after training without noise.")]
    for name in objects:
        ideal, noisy = (found[name][k, :, place] for k in (0, 1))
        result.words.append(f"{name[0].upper() + name[1:]}: {paired.order('training with noise', noisy, 'training without', ideal)}.")
        lines = {f"{name}, trained on {kind}": estimates(found[name][k]) for k, kind in enumerate(("ideal", "noisy"))}
        result.tables.append(Table(f"Accuracy on noisy sets of {name}", ["trained on", *(f"{n} touches" for n in counts)],
                                   [[line.split("trained on ")[1], *(p.words() for p in points)] for line, points in lines.items()]))
        result.figures.append(figures.confusion(
            context.figure_path("confusion-" + name.split()[0]), f"What each of the {name} is taken for, % of its noisy sets of {TOUCHES} "
            "touches, after training without noise; all seeds together.", objects[name], {"ideal training": confusions[name]}))
    curves = {name: estimates(found[name][0]) for name in objects}
    result.figures.insert(0, figures.curves(
        context.figure_path("curves"), "Accuracy on noisy sets after training without noise. Bands: 95 % over seeds.", counts, curves,
        x_label="touches a feature set"))
    result.data = {"touches": counts, "objects": {n: list(o) for n, o in objects.items()},
                   "accuracy": {name: values.tolist() for name, values in found.items()}}
    return result


EXPERIMENT = Experiment("everyday_models", "Ten everyday models", "figures 17 and 18: ten everyday models, ideal training, noisy test, "
                        "comparable to the five", run, (15, 240))
