"""What a better model is worth to recognition: error, accuracy and saved touches at each step of a diagnosis."""

from __future__ import annotations

import dataclasses
import warnings

import numpy as np
from scipy import stats
from sklearn import exceptions

from .. import ladder, plans
from ..context import Context
from ..experiment import Experiment
from ..features import FeatureSets, dealt_rows, of_rows
from ..ladder import figures as ladder_figures, words as ladder_words
from ..ladder.words import Climb
from ..prediction_powered import bootstrap_gain, powered_mean, simulated_per_measured
from ..recognisers import SEEDS, TEN, Trained
from ..result import Result
from ..statistics import estimate

TOUCHES = 8  # of a set
MORE = 10  # simulated predictions per measurement
# Each alone, planted in simulated touches: the first two have the same RMSE by their size (sqrt(3) 0.4536 = 30 tan 1.5 deg).
ALONE = {
    "hand tilted by 1.5 deg": "tool_tilt: {angle_deg: 1.5}",
    "middle finger 1.4 mm longer": "finger_length: {offset_mm: [-0.4536, 0.9072, -0.4536]}",
    "tips of 2 mm radius": "tip_radius: {radius_mm: 2}",
    "object gives way by 0.4 mm": "object_push: {shift_mm: 0.4}",
}


def run(context: Context) -> Result:
    settings = context.settings
    climbs = []
    for number, hidden in enumerate(ladder.RIGS):
        context.progress(0.7 * number / len(ladder.RIGS), hidden.name)
        rungs = ladder.climb(context, hidden)
        diagnosed, rig = ladder.measured(context, hidden)
        context.stop_rigs()
        found = [_seed(context, seed, rungs, rig, ranked=number == 0) for seed in settings.runs]
        climbs.append(Climb(hidden, rungs, len(diagnosed), len(rig), {key: np.array([each[key] for each in found]) for key in found[0]}))
    context.progress(0.7, "effects alone")
    alone = _alone(context)
    context.progress(0.8, "what simulation saves")
    worth = _worth(context, climbs[0].rungs, ladder.measured(context)[1])
    return _result(context, climbs, alone, worth)


def _simulated(context: Context, model: str, seed: int, sets: int, use: str = "training") -> FeatureSets:
    return ladder.simulated_sets(context, model, seed, sets, TOUCHES, use=use)


def _seed(context, seed, rungs, rig, ranked):
    """Accuracies of one seed, a value a rung: "rig", "simulated", "again" (the rig's commanded touches, simulated by the rung:
    what is left of the difference between the two is the model's, not the poses'), "ranks" (Spearman, NaN unless `ranked`)."""
    settings = context.settings
    train_sets, test_sets = settings.pick((40, 40), (120, 120))
    groups = dealt_rows(rig, TOUCHES, context.rng("deal", seed))
    measured = of_rows(rig, groups)
    shown = {"rig": [], "simulated": [], "again": [], "ranks": []}
    for k, rung in enumerate(rungs):
        train = _simulated(context, rung.model, seed, train_sets)
        test = _simulated(context, rung.model, seed, test_sets, "testing")
        all_ten = ranked and (not settings.quick or k == len(rungs) - 1)
        again = of_rows(_again(context, rig, rung.model, 100 + seed), groups)
        scores = []
        for new in (TEN if all_ten else {"XGBoost": SEEDS["XGBoost"]}).values():
            with warnings.catch_warnings():  # the perceptron's steps are limited on purpose
                warnings.simplefilter("ignore", exceptions.ConvergenceWarning)
                recogniser = Trained(new(seed), train)
            scores.append([recogniser.accuracy(sets) for sets in (test, measured, again)])
        for name, score in zip(("simulated", "rig", "again"), scores[0]):
            shown[name].append(score)
        inside, outside, _ = np.transpose(scores)
        varies = all_ten and np.ptp(inside) > 0 and np.ptp(outside) > 0
        shown["ranks"].append(float(stats.spearmanr(inside, outside)[0]) if varies else float("nan"))
    return shown


def _again(context, data, model, seed):
    """The same commanded touches by a model. A finger that misses in simulation counts as if none did, like the others: any rule
    does, as long as it is the same for all predictions."""
    return dataclasses.replace(data, times_us=np.nan_to_num(ladder.simulate_again(context, data, model, seed)))


def _alone(context):
    """{effect: (rmse_us, [loss of accuracy, one a seed])} of effects planted in simulated touches."""
    settings = context.settings
    sets = settings.pick(30, 200)
    path = settings.out / "measured" / "alone.csv"
    found = {}
    for name, effect in ALONE.items():
        model = ladder.NOMINAL + f"  - {effect}\n"
        losses = []
        for seed in settings.runs:
            recogniser = Trained(SEEDS["XGBoost"](seed), _simulated(context, ladder.NOMINAL, seed, sets))
            # The same poses with and without the effect.
            without, planted = (_simulated(context, each, seed, sets, "testing") for each in (ladder.NOMINAL, model))
            losses.append(recogniser.accuracy(without) - recogniser.accuracy(planted))
        ladder.write_set(context.simulated(settings.pick(200, 2000), model=model, seed=1, use="alone"), path)
        found[name] = context.simulator.compare(path, ladder.NOMINAL).rmse_us, losses
    return found


def _worth(context, rungs, rig):
    """{quantity: [{"gain": (value, low, high), "n", "worth", "covers"} a rung]}: what simulation saves at equal certainty.

    The recogniser is the same at every rung, trained by the last one, so that only the predictions change.
    """
    settings = context.settings
    groups = dealt_rows(rig, TOUCHES, context.rng("worth"))
    recogniser = Trained(SEEDS["XGBoost"](settings.seed), _simulated(context, rungs[-1].model, settings.seed, settings.pick(40, 120)))
    # Commanded touches that the rig was not asked for.
    more = context.simulated(MORE * len(rig), model=ladder.NOMINAL, seed=settings.seed, use="more")
    more_groups = dealt_rows(more, TOUCHES, context.rng("more"))
    found = {"accuracy": [], "mean curvature": []}
    for rung in rungs:
        again = [_again(context, rig, rung.model, 50 + r) for r in range(settings.pick(1, 4))]
        others = [_again(context, more, rung.model, 90 + r) for r in range(settings.pick(1, 4))]
        quantities = {
            "accuracy": [np.mean([_right(recogniser, data, rows) for data in each], 0)
                         for each, rows in (([rig], groups), (again, groups), (others, more_groups))],
            "mean curvature": [np.mean([data.curvature() for data in each], 0) for each in ([rig], again, others)]}
        for name, (y, f, g) in quantities.items():
            gain = bootstrap_gain(y, f, g, context.rng("bootstrap", name), settings.pick(200, 1000))
            found[name].append({"gain": gain, "n": len(y), "N": len(g),
                                "worth": [simulated_per_measured(value, len(y), len(g)) for value in gain],
                                "covers": _covers(y, f, context.rng("covers", name))})
    return found


def _right(recogniser, data, rows):
    sets = of_rows(data, rows)
    return (recogniser.predict(sets) == sets.objects).astype(float)


def _covers(y, f, rng, repeats=400):
    """How often the 95 % interval covers the mean of a population, which are the rig's touches themselves here: both the
    measured ones and those that are only predicted are drawn from them with replacement."""
    hits = 0
    for _ in range(repeats):
        rows, others = rng.integers(len(y), size=len(y) // 2), rng.integers(len(y), size=MORE * len(y) // 2)
        found = powered_mean(y[rows], f[rows], f[others])
        hits += found.low <= y.mean() <= found.high
    return hits / repeats


def _result(context, climbs, alone, worth):
    kind, first = context.settings.measured_kind, climbs[0]
    result = Result("", "", made_on=[
        (f"{len(climbs)} rigs, each with other hidden physics; diagnosed: {first.diagnosed:,} {kind} touches of "
         f"{' and '.join(ladder.DIAGNOSED)} by each"),
        (f"tested on {min(each.tested for each in climbs):,} other {kind} touches of {len(plans.OBJECTS)} objects or more, made once; intervals of "
         "accuracy are over the simulated touches, the dealing into sets and the training of each seed, not over other touches of the rig"),
        f"trained on touches simulated by each model; sets of {TOUCHES} touches"])
    result.words = ladder_words.words(climbs, alone, worth, kind, MORE)
    result.tables = [*(ladder_words.ladder_table(each, kind) for each in climbs), ladder_words.alone_table(alone),
                     ladder_words.worth_table(first.rungs, worth, MORE)]
    losses = {name: (rmse, estimate(loss)) for name, (rmse, loss) in alone.items()}
    result.figures = [ladder_figures.draw_ladder(context, climbs, losses), ladder_figures.draw_worth(context, first, worth)]
    result.data = {"rigs": [{"name": each.hidden.name, "hidden": each.hidden.hidden, "rungs": [dataclasses.asdict(rung) for rung in each.rungs],
                             "accuracy": {key: values.tolist() for key, values in each.accuracy.items()}} for each in climbs],
                   "worth": worth, "alone": {name: {"rmse_us": rmse, "losses": losses} for name, (rmse, losses) in alone.items()}}
    return result


EXPERIMENT = Experiment("better_model", "What a better model is worth", "", run, (90, 900))
