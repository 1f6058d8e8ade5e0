"""What a better model is worth to recognition: error, accuracy and saved touches at each step of a diagnosis."""

from __future__ import annotations

import warnings

import numpy as np
from scipy import stats
from sklearn import exceptions

from .. import ladder, ladder_figures, plans
from ..context import Context
from ..experiment import Experiment
from ..features import feature_sets, histogram
from ..prediction_powered import bootstrap_gain, powered_mean, simulated_per_measured
from ..recognisers import SEEDS, TEN
from ..result import Estimate, Result, Table
from ..statistics import estimate, estimate_share

TOUCHES = 8  # of a set
MORE = 10  # simulated predictions per measurement
# Each alone, planted in simulated touches: the first two have the same RMSE by their size (sqrt(3) 0.4536 = 30 tan 1.5 deg).
ALONE = {
    "hand tilted by 1.5 deg": "tool_tilt: {angle_deg: 1.5}",
    "middle finger 1.4 mm longer": "finger_length: {offset_mm: [-0.4536, 0.9072, -0.4536]}",
    "tips of 2 mm radius": "tip_radius: {radius_mm: 2}",
    "object gives way by 0.4 mm": "object_push: {shift_mm: 0.4}",
}
MARGIN = 0.03  # of accuracy: a loss whose interval lies below it is called none


def run(context: Context) -> Result:
    settings = context.settings
    rungs = ladder.climb(context)
    diagnosed, rig = ladder.measured(context)
    context.progress(0.3, "ladder: " + ", ".join(rung.name for rung in rungs))
    found = [_seed(context, seed, rungs, rig) for seed in settings.runs]
    context.progress(0.8, "effects alone")
    alone = _alone(context)
    worth = _worth(context, rungs, rig)
    return _result(context, rungs, diagnosed, rig, found, alone, worth)


def _simulated(context: Context, model: str, seed: int, sets: int):
    """(features, objects) of simulated touches."""
    objects = len(plans.OBJECTS)
    data = context.simulated(sets * TOUCHES * objects, model=model, seed=seed)
    return feature_sets(data, TOUCHES, np.random.default_rng(seed))


def _seed(context, seed, rungs, rig):
    """Accuracies of one seed, a value a rung: "rig", "simulated", "again" (the rig's commanded touches, simulated by the rung:
    what is left of the difference between the two is the model's, not the poses'), "ranks" (Spearman, NaN where not asked)."""
    settings = context.settings
    train_sets, test_sets = settings.pick((40, 40), (120, 120))
    groups = _deal(rig, context.rng("deal", seed))
    objects = rig.object[groups[:, 0]]
    measured = histogram(rig.curvature()[groups]), objects
    shown = {"rig": [], "simulated": [], "again": [], "ranks": []}
    for k, rung in enumerate(rungs):
        train = _simulated(context, rung.model, 1000 + seed, train_sets)
        test = _simulated(context, rung.model, 2000 + seed, test_sets)
        all_ten = not settings.quick or k == len(rungs) - 1
        again = histogram(_curvature(rig, ladder.simulate_again(context, rig, rung.model, 100 + seed))[groups]), objects
        scores = []
        for new in (TEN if all_ten else {"XGBoost": SEEDS["XGBoost"]}).values():
            with warnings.catch_warnings():  # the perceptron's steps are limited on purpose
                warnings.simplefilter("ignore", exceptions.ConvergenceWarning)
                recogniser = new(seed).fit(*train)
            scores.append([np.mean(recogniser.predict(x) == y) for x, y in (test, measured, again)])
        shown["simulated"].append(float(scores[0][0]))
        shown["rig"].append(float(scores[0][1]))
        shown["again"].append(float(scores[0][2]))
        inside, outside, _ = np.transpose(scores)
        varies = all_ten and np.ptp(inside) > 0 and np.ptp(outside) > 0
        shown["ranks"].append(float(stats.spearmanr(inside, outside)[0]) if varies else float("nan"))
    context.progress(0.3 + 0.5 * (seed - settings.seed + 1) / settings.seeds)
    return shown


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
            recogniser = SEEDS["XGBoost"](seed).fit(*_simulated(context, ladder.NOMINAL, 1000 + seed, sets))
            of = lambda planted, recogniser=recogniser: np.mean(recogniser.predict(planted[0]) == planted[1])
            # The same poses with and without the effect.
            losses.append(float(of(_simulated(context, ladder.NOMINAL, 3000 + seed, sets)) -
                                of(_simulated(context, model, 3000 + seed, sets))))
        ladder.write_set(context.simulated(settings.pick(200, 2000), model=model, seed=4000), path)
        found[name] = context.simulator.compare(path, ladder.NOMINAL).rmse_us, losses
    return found


def _worth(context, rungs, rig):
    """{quantity: [{"gain": (value, low, high), "n", "worth", "covers"} a rung]}: what simulation saves at equal certainty.

    The recogniser is the same at every rung, trained by the last one, so that only the predictions change.
    """
    settings = context.settings
    groups = _deal(rig, context.rng("worth"))
    recogniser = SEEDS["XGBoost"](settings.seed).fit(*_simulated(context, rungs[-1].model, 1000, settings.pick(40, 120)))
    more = _more_poses(context, rig)
    more_groups = _deal(more, context.rng("more"))
    right = lambda data, groups, times: _right(recogniser, _curvature(data, times)[groups], data.object[groups[:, 0]])
    found = {"accuracy": [], "mean curvature": []}
    for rung in rungs:
        again = [ladder.simulate_again(context, rig, rung.model, 50 + r) for r in range(settings.pick(1, 4))]
        others = [ladder.simulate_again(context, more, rung.model, 90 + r) for r in range(settings.pick(1, 4))]
        quantities = {
            "accuracy": (right(rig, groups, rig.times_us), np.mean([right(rig, groups, t) for t in again], 0),
                         np.mean([right(more, more_groups, t) for t in others], 0)),
            "mean curvature": (rig.curvature(), np.mean([_curvature(rig, t) for t in again], 0),
                               np.mean([_curvature(more, t) for t in others], 0))}
        for name, (y, f, g) in quantities.items():
            gain = bootstrap_gain(y, f, g, context.rng("bootstrap", name), settings.pick(200, 1000))
            found[name].append({"gain": gain, "n": len(y), "N": len(g),
                                "worth": [simulated_per_measured(value, len(y), len(g)) for value in gain],
                                "covers": _covers(y, f, context.rng("covers", name))})
    return found


def _deal(data, rng):
    """(sets, TOUCHES) rows, each set of one object."""
    groups = [rng.permutation(np.flatnonzero(data.object == k)) for k in range(len(data.objects))]
    return np.concatenate([rows[: len(rows) // TOUCHES * TOUCHES].reshape(-1, TOUCHES) for rows in groups])


def _more_poses(context, rig):
    """Commanded touches that the rig was not asked for, MORE times as many; their times are the nominal model's."""
    return context.simulated(MORE * len(rig), model=ladder.NOMINAL, seed=5000)


def _curvature(data, times_us):
    """A finger that misses in simulation gives 0: any rule does, as long as it is the same for all predictions."""
    left, middle, right = times_us.T / 1e6
    return np.nan_to_num(data.speed_mm_s * (left - 2 * middle + right) / data.spacing_mm**2 * 1e3)


def _right(recogniser, curvature, objects):
    return (recogniser.predict(histogram(curvature)) == objects).astype(float)


def _covers(y, f, rng, repeats=400):
    """How often the 95 % interval covers the mean of a population, which are the rig's touches themselves here: both the
    measured ones and those that are only predicted are drawn from them with replacement."""
    hits = 0
    for _ in range(repeats):
        rows, others = rng.integers(len(y), size=len(y) // 2), rng.integers(len(y), size=MORE * len(y) // 2)
        found = powered_mean(y[rows], f[rows], f[others])
        hits += found.low <= y.mean() <= found.high
    return hits / repeats


def _result(context, rungs, diagnosed, rig, found, alone, worth):
    kind = context.settings.measured_kind
    accuracy = {key: np.array([each[key] for each in found]) for key in ("rig", "simulated", "again", "ranks")}
    shown = {key: [(estimate if key == "ranks" else estimate_share)(column[np.isfinite(column)]) if np.isfinite(column).any() else None
                   for column in values.T]
             for key, values in accuracy.items()}
    for rank in filter(None, shown["ranks"]):  # Student's interval of a few seeds may leave the range
        rank.low, rank.high = max(rank.low, -1.0), min(rank.high, 1.0)
    steps = [estimate(accuracy["rig"][:, k] - accuracy["rig"][:, k - 1]) for k in range(1, len(rungs))]
    whole = estimate(accuracy["rig"][:, -1] - accuracy["rig"][:, 0])
    result = Result("", "", made_on=[
        f"diagnosed: {len(diagnosed):,} {kind} touches of {' and '.join(ladder.DIAGNOSED)}",
        (f"tested on {len(rig):,} other {kind} touches of {len(rig.objects)} objects, made once; intervals of accuracy are over "
         "the simulated touches, the dealing into sets and the training of each seed, not over other touches of the rig"),
        f"trained on touches simulated by each model; sets of {TOUCHES} touches"])
    result.words = [_answer(rungs, shown["rig"], whole, kind), *_step_words(rungs, steps), _gap_words(accuracy, kind),
                    _rank_words(accuracy["ranks"]), _alone_words(alone), _worth_words(worth, kind)]
    result.tables = [_ladder_table(rungs, shown, steps, kind), _alone_table(alone), _worth_table(rungs, worth)]
    result.figures = [ladder_figures.draw_ladder(context, rungs, shown, {name: (rmse, estimate(loss)) for name, (rmse, loss) in alone.items()}),
                      ladder_figures.draw_worth(context, rungs, worth, shown["ranks"])]
    result.data = {"rungs": [{"name": r.name, "rmse_us": r.rmse_us, "model": r.model} for r in rungs], "worth": worth,
                   "accuracy": {key: values.tolist() for key, values in accuracy.items()},
                   "alone": {name: {"rmse_us": rmse, "losses": losses} for name, (rmse, losses) in alone.items()}}
    return result


def _points(e: Estimate) -> str:
    return f"{100 * e.value:+.1f} points ({100 * e.low:+.1f} to {100 * e.high:+.1f})"


def _verdict(e: Estimate) -> str:
    return "gains" if e.low > 0 else "loses" if e.high < 0 else "cannot be told from"


def _answer(rungs, accuracy, whole, kind):
    if len(rungs) == 1:
        return f"The diagnosis found nothing to add to the nominal model (RMSE {rungs[0].rmse_us / 1e3:.1f} ms): there is no ladder."
    change = {"gains": "More of the sets are recognised", "loses": "Fewer of the sets are recognised",
              "cannot be told from": "No difference in recognition can be told"}[_verdict(whole)]
    return (f"{change} with the last model of the ladder than with the nominal one on {kind} touches: "
            f"{accuracy[0].words()} to {accuracy[-1].words()}, {_points(whole)}, while the RMSE went from "
            f"{rungs[0].rmse_us / 1e3:.1f} to {rungs[-1].rmse_us / 1e3:.1f} ms.")


def _step_words(rungs, steps):
    for rung, before, step in zip(rungs[1:], rungs, steps):
        told = {"gains": "recognises more", "loses": "recognises less"}.get(_verdict(step), "makes no difference that can be told")
        yield (f"{rung.name[2:]}: RMSE {before.rmse_us / 1e3:.1f} to {rung.rmse_us / 1e3:.1f} ms; {told}, {_points(step)}.")


def _gap_words(accuracy, kind):
    poses = estimate(accuracy["simulated"][:, -1] - accuracy["again"][:, -1])
    model = estimate(accuracy["again"][:, -1] - accuracy["rig"][:, -1])
    told = lambda e: "" if e.low > 0 or e.high < 0 else ", which cannot be told from none"
    return (f"What is left between the last model's own simulation and the {kind} touches is in part the poses that the rig was given, "
            f"{_points(poses)}{told(poses)}, and in part what the model still lacks, {_points(model)}{told(model)}: the same commanded touches "
            "were simulated again.")


def _rank_words(ranks):
    change = ranks[:, -1] - ranks[:, 0]
    if len(ranks[0]) < 2 or not np.isfinite(change).all():
        return "Whether a better model ranks ten recognisers better was not asked in this run."
    change = estimate(change)
    told = ("A better model ranks recognisers more as they come out" if change.low > 0 else "A better model ranks recognisers worse"
            if change.high < 0 else "That a better model ranks recognisers better cannot be told")
    return (f"{told}: the rank correlation of ten recognisers goes from {estimate(ranks[:, 0]).words(percent=False)} to "
            f"{estimate(ranks[:, -1]).words(percent=False)}.")


def _alone_words(alone):
    losses = {name: (rmse, estimate(loss)) for name, (rmse, loss) in alone.items()}
    harmless = [(rmse, name) for name, (rmse, loss) in losses.items() if loss.high < MARGIN]
    harmful = [(rmse, name) for name, (rmse, loss) in losses.items() if loss.low > 0 and loss.value > MARGIN]
    if not harmless or not harmful or max(harmless)[0] <= min(harmful)[0]:
        return "Among the effects that were planted alone, none with a larger residual was found that matters less."
    (large, a), (small, b) = max(harmless), min(harmful)
    tilt, longer = list(losses)[:2]
    return (f"A large residual that does not matter: {a}, RMSE {large / 1e3:.0f} ms, costs {_points(losses[a][1])}. A small one "
            f"that does: {b}, RMSE {small / 1e3:.0f} ms, costs {_points(losses[b][1])}. Of two with the same RMSE ({losses[tilt][0] / 1e3:.1f} and "
            f"{losses[longer][0] / 1e3:.1f} ms), the {tilt} costs {_points(losses[tilt][1])}, the {longer} {_points(losses[longer][1])}: a slope "
            "that is added to every touch cancels in the curvature, which these recognisers see; what one finger adds does not.")


def _worth_words(worth, kind):
    first, last = (worth["mean curvature"][k] for k in (0, -1))
    separate = last["gain"][1] > first["gain"][2]
    return (f"With {MORE} simulated touches per {kind} one, the mean curvature is as certain as from "
            f"{last['gain'][0]:.2f} ({last['gain'][1]:.2f} to {last['gain'][2]:.2f}) times as many {kind} touches by the last model, "
            f"{first['gain'][0]:.2f} ({first['gain'][1]:.2f} to {first['gain'][2]:.2f}) by the nominal one: "
            + ("the better model saves more." if separate else "the intervals overlap, so the models cannot be told apart in this.")
            + " For the accuracy of one recogniser it is " + " and ".join(
                f"{w['gain'][0]:.2f} ({w['gain'][1]:.2f} to {w['gain'][2]:.2f})" for w in (worth["accuracy"][-1], worth["accuracy"][0]))
            + " times. At most it can be about as many times as there are touches of both kinds per measured one.")


def _ladder_table(rungs, shown, steps, kind):
    rows = []
    for k, rung in enumerate(rungs):
        rank = shown["ranks"][k]
        rows.append([rung.name, f"{rung.rmse_us / 1e3:.1f}", shown["rig"][k].words(), shown["simulated"][k].words(), shown["again"][k].words(),
                     "" if k == 0 else _points(steps[k - 1]), "" if rank is None else rank.words(percent=False)])
    return Table("The ladder", ["model", "RMSE, ms", f"accuracy, {kind}", "accuracy, its own simulation", "the same touches simulated",
                                "step", "rank correlation"],
                 rows, "XGBoost trained on each model. RMSE of held-out touches by compare(). Rank correlation: Spearman's, of ten "
                 f"recognisers' accuracies in simulation and on {kind} touches.")


def _alone_table(alone):
    return Table("Effects alone, planted in simulated touches", ["effect", "RMSE, ms", "loss of accuracy"],
                 [[name, f"{rmse / 1e3:.1f}", _points(estimate(loss))] for name, (rmse, loss) in alone.items()],
                 "Trained on the nominal model. The first two were made to have the same RMSE.")


def _worth_table(rungs, worth):
    count = lambda x: "never" if np.isinf(x) else f"{x:.1f}"
    rows = [[quantity, rung.name, f"{w['gain'][0]:.2f} ({w['gain'][1]:.2f} to {w['gain'][2]:.2f})",
             f"{count(w['worth'][0])} ({count(w['worth'][2])} to {count(w['worth'][1])})", f"{w['covers']:.1%}"]
            for quantity, each in worth.items() for rung, w in zip(rungs, each)]
    return Table("What simulation saves", ["mean of", "predicted by", "effective / measured touches", "one measured touch is worth",
                                           "intervals that cover"], rows,
                 f"Prediction-powered inference (PPI++), {MORE} simulated touches per measured one; intervals by bootstrap over the "
                 "touches. Worth: simulated touches that save one measured one; never: they save none. The last column checks the "
                 "method: how many of 400 intervals of 95 % from half as many touches, drawn from the rig's with replacement, cover "
                 "the mean of the rig's. Both populations are random poses of one plan in which every finger meets the object.")


EXPERIMENT = Experiment("better_model", "What a better model is worth", "", run, (55, 560))
