"""Are a recogniser's probabilities true, do its sets of answers cover, and does it say when an object is none of these?"""

from __future__ import annotations

import matplotlib.pyplot as plt
import numpy as np

from .. import figures, ladder, plans
from ..calibration import Novelty, conformal_sets, conformal_threshold, expected_calibration_error, reliability
from ..context import Context
from ..experiment import Experiment
from ..features import dealt_sets
from ..recognisers import TEN, Trained
from ..result import Result, Table
from ..statistics import estimate, estimate_share

TOUCHES = 4  # of a set: few, so that answers are uncertain
NOVEL_TOUCHES = 8
COVERAGE = 0.9
FALSE_ALARMS = 0.1
RECOGNISERS = ("XGBoost", "naive Bayes", "logistic regression")  # that state probabilities; an SVM does not


def run(context: Context) -> Result:
    settings = context.settings
    rungs = ladder.climb(context)
    _, rig = ladder.measured(context)
    models = {"nominal": rungs[0].model, "last": rungs[-1].model}
    found = []
    for seed in settings.runs:
        found.append({name: _seed(context, model, seed, rig) for name, model in models.items()})
        context.progress((seed - settings.seed + 1) / settings.seeds)
    return _result(context, rungs, rig, found)


def _simulated(context, model, seed, sets, touches, use):
    data = context.simulated(sets * touches * len(plans.OBJECTS), model=model, seed=seed, use=use)
    return dealt_sets(data, touches, np.random.default_rng(seed))


def _seed(context, model, seed, rig):
    """Everything of one seed and one model: {"ece", "curves", "conformal", "novel"}."""
    sets = context.settings.pick(40, 300)
    train, calibrate, test = (_simulated(context, model, seed, sets, TOUCHES, use) for use in ("training", "calibration", "testing"))
    measured = dealt_sets(rig, TOUCHES, context.rng("deal", seed))
    y = measured.objects
    first = context.rng("halves", seed).permutation(len(y)) < len(y) // 2
    shown = {"ece": {}, "curves": {}, "conformal": {}, "novel": _novel(context, model, seed, rig)}
    for name in RECOGNISERS:
        told = Trained(TEN[name](seed), train).probabilities
        by_rig, by_test = told(measured), told(test)
        shown["ece"][name] = {"simulated": expected_calibration_error(by_test, test.objects), "rig": expected_calibration_error(by_rig, y)}
        shown["curves"][name] = {"simulated": reliability(by_test, test.objects).tolist(), "rig": reliability(by_rig, y).tolist()}
        if name == RECOGNISERS[0]:
            by_calibration = told(calibrate)
            cases = {"simulated, by simulated": (by_test, test.objects, by_calibration, calibrate.objects),
                     "rig, by simulated": (by_rig[~first], y[~first], by_calibration, calibrate.objects),
                     "rig, by rig": (by_rig[~first], y[~first], by_rig[first], y[first])}
            for case, (given, true, other, other_true) in cases.items():
                answer = conformal_sets(given, other, other_true, COVERAGE)
                shown["conformal"][case] = (float(answer[np.arange(len(true)), true].mean()), float(answer.sum(1).mean()))
    return shown


def _novel(context, model, seed, rig):
    """{object left out: {"simulated" | "rig by simulated" | "rig by rig": (found, false alarms)}}."""
    sets = context.settings.pick(25, 150)
    train, calibrate, test = ((each.values, each.objects) for each in (
        _simulated(context, model, seed, sets, NOVEL_TOUCHES, f"novel {use}") for use in ("training", "calibration", "testing")))
    measured = dealt_sets(rig, NOVEL_TOUCHES, context.rng("novel", seed))
    x, y = measured.values, measured.objects
    first = context.rng("novel halves", seed).permutation(len(y)) < len(y) // 2
    found = {}
    for left_out, name in enumerate(plans.OBJECTS):
        novelty = Novelty(train[0][train[1] != left_out])
        limits = [conformal_threshold(novelty.distance(a[b != left_out]), 1 - FALSE_ALARMS)
                  for a, b in (calibrate, (x[first], y[first]))]
        rate = lambda features, limit, novelty=novelty: float(np.mean(novelty.distance(features) > limit))
        rest, rest_y = x[~first], y[~first]
        found[name] = {
            "simulated": (rate(test[0][test[1] == left_out], limits[0]), rate(test[0][test[1] != left_out], limits[0])),
            "rig by simulated": (rate(x[y == left_out], limits[0]), rate(rest[rest_y != left_out], limits[0])),
            "rig by rig": (rate(x[y == left_out], limits[1]), rate(rest[rest_y != left_out], limits[1]))}
    return found


def _result(context, rungs, rig, found):
    kind = context.settings.measured_kind
    result = Result("", "", made_on=[
        (f"{len(rig):,} {kind} touches of {len(rig.objects)} objects, made once, in sets of {TOUCHES} ({NOVEL_TOUCHES} for objects not "
         "trained on); one half of the sets calibrates, the other is tested"),
        f"touches simulated by the nominal model and by the last of the ladder ({rungs[-1].name}) train, calibrate and are tested",
        "intervals are over the simulated touches, the dealing into sets and halves and the training of each seed"])
    pick = lambda *path: [_at(each, path) for each in found]
    result.words = [_ece_words(pick, kind), _conformal_words(pick, kind), _novel_words(found, kind)]
    result.tables = [_ece_table(pick, kind), _conformal_table(pick, kind), _novel_table(found, kind)]
    result.figures = [_draw(context, found, kind)]
    result.data = {"seeds": found}
    return result


def _at(tree, path):
    for step in path:
        tree = tree[step]
    return tree


def _ece_words(pick, kind):
    name = RECOGNISERS[0]
    inside = estimate(pick("last", "ece", name, "simulated"))
    worse, better = pick("nominal", "ece", name, "rig"), pick("last", "ece", name, "rig")
    gain = estimate(np.subtract(worse, better))
    told = ("the better model makes them truer" if gain.low > 0 else "the better model makes them less true" if gain.high < 0
            else "no difference between the models can be told")
    return (f"The certainty that {name} states is off by {estimate(worse).words()} on {kind} touches when it was trained by the nominal model, by "
            f"{estimate(better).words()} by the last of the ladder: {told} (difference {gain.words()}). On touches of its own simulation "
            f"they are off by {inside.words()} (expected calibration error, ten bins).")


def _conformal_words(pick, kind):
    said = []
    for model in ("nominal", "last"):
        for case, where in (("rig, by simulated", "simulated"), ("rig, by rig", kind)):
            covered = estimate_share(np.array(pick(model, "conformal", case))[:, 0])
            size = estimate(np.array(pick(model, "conformal", case))[:, 1])
            verdict = "kept" if covered.value >= COVERAGE else "kept within the interval" if covered.high >= COVERAGE else "not kept"
            said.append(f"{model} model, calibrated on {where} touches: {covered.words()}, {verdict}, {size.value:.1f} objects a set")
    return f"Sets of answers stated to hold the true object in {COVERAGE:.0%} of cases, on {kind} touches. " + "; ".join(said) + "."


def _novel_words(found, kind):
    said = []
    for model in ("nominal", "last"):
        rates = [np.mean([each[model]["novel"][name]["rig by simulated"] for name in plans.OBJECTS], 0) for each in found]
        detected, alarms = (estimate_share(column) for column in np.transpose(rates))
        verdict = "more than stated" if alarms.low > FALSE_ALARMS else "as stated or less" if alarms.value <= FALSE_ALARMS else "about as stated"
        said.append(f"by the {model} model {detected.words()} of the sets of an object not trained on are called none of these, at "
                    f"{alarms.words()} false alarms ({verdict})")
    return (f"None of these, on {kind} touches, with {FALSE_ALARMS:.0%} false alarms stated and calibrated on simulated touches: " + "; ".join(said)
            + ". Objects that lie between two others of their family are the hard ones (table).")


def _ece_table(pick, kind):
    rows = [[name, model, estimate_share(pick(model, "ece", name, "simulated")).words(), estimate_share(pick(model, "ece", name, "rig")).words()]
            for name in RECOGNISERS for model in ("nominal", "last")]
    return Table("Expected calibration error", ["recogniser", "trained by model", "on its own simulation", f"on {kind} touches"], rows,
                 f"Sets of {TOUCHES} touches, ten bins. Of few sets the error is too large even for true probabilities.")


def _conformal_table(pick, kind):
    rows = []
    for model in ("nominal", "last"):
        for case in ("simulated, by simulated", "rig, by simulated", "rig, by rig"):
            values = np.array(pick(model, "conformal", case))
            on, by = (part.replace("rig", kind) for part in case.split(", by "))
            rows.append([model, on, by, estimate_share(values[:, 0]).words(), estimate(values[:, 1]).words(percent=False)])
    return Table(f"Sets of answers with a stated coverage of {COVERAGE:.0%}", ["trained by model", "tested on", "calibrated on", "covered",
                                                                               "objects a set"], rows,
                 f"Split conformal prediction with {RECOGNISERS[0]}. It promises the coverage where calibration and test are exchangeable.")


def _novel_table(found, kind):
    rows = []
    for name in plans.OBJECTS:
        row = [name]
        for model, case in (("last", "simulated"), ("nominal", "rig by simulated"), ("last", "rig by simulated"), ("last", "rig by rig")):
            detected, alarms = (estimate(column) for column in np.transpose([each[model]["novel"][name][case] for each in found]))
            row.append(f"{detected.value:.0%}, {alarms.value:.0%}")
        rows.append(row)
    return Table("None of these: sets found of the object that was left out, and false alarms",
                 ["left out", "last model, simulated", f"nominal, {kind}", f"last, {kind}", f"last, {kind}, calibrated on it"], rows,
                 f"False alarms stated: {FALSE_ALARMS:.0%}. By distance to the nearest training sets.")


def _draw(context, found, kind):
    panels = {"simulated, nominal model": ("nominal", "simulated"), f"{kind}, nominal model": ("nominal", "rig"),
              f"{kind}, last model": ("last", "rig")}
    figure, all_axes = plt.subplots(1, 3, figsize=(9.6, 3.6), sharey=True)
    for axes, (title, (model, where)) in zip(all_axes, panels.items()):
        axes.plot([0, 100], [0, 100], color="#7b8794", linestyle=":", linewidth=1)
        for place, name in enumerate(RECOGNISERS):
            bins = np.array([_at(each, (model, "curves", name, where)) for each in found])  # (seeds, bins, 3)
            count = bins[:, :, 0].sum(0)
            stated, right = (100 * (np.nan_to_num(bins[:, :, k]) * bins[:, :, 0]).sum(0) / np.maximum(count, 1) for k in (1, 2))
            # A bin of a handful of sets shows nothing.
            used = count >= 10 * len(found)
            axes.plot(stated[used], right[used], marker="osD"[place], markersize=4, color=figures.colour(name, 3 + place), label=name)
        axes.set(title=title, xlabel="stated certainty, %", xlim=(20, 101), ylim=(0, 101))
    all_axes[0].set_ylabel("right, %")
    all_axes[0].legend(loc="lower right", fontsize=8)
    return figures.save(figure, context.figure_path("reliability"), "Share of answers that are right over the certainty that they state, all "
                        "seeds together; on the dotted line the probabilities are true. Bins of fewer than 10 sets a seed are left out.")


EXPERIMENT = Experiment("calibrated_answers", "Answers whose certainty is true", "", run, (5, 60))
