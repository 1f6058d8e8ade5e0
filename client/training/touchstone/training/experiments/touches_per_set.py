"""Figure 9 of the seed: three recognisers against the number of touches in a feature set, trained on simulated ones."""

from __future__ import annotations

import numpy as np

from .. import controls, features, figures, paired, plans, recognisers
from ..context import Context
from ..experiment import Experiment
from ..features import dealt_sets, drawn_sets, some
from ..result import Comparison, Result, Table
from ..statistics import estimate_share, estimates

# The seed's 640 virtual samples are touches, 128 of each object.
TRAINING_TOUCHES, TEST_SETS = 640, 500
# What the seed's recognisers are given.
SEEN = {"curvatures": features.curvatures, "contact times": features.triples}


def run(context: Context) -> Result:
    settings, kind = context.settings, context.settings.measured_kind
    counts = settings.pick([5, 15, 30], [5, 10, 15, 20, 25, 30])
    rig = context.measured(plans.measured(settings), options=plans.RIG)
    names = list(recognisers.SEEDS)
    found = {(seen, where): np.zeros((len(names), settings.seeds, len(counts))) for seen in SEEN for where in ("simulated", kind)}
    chance = np.zeros((settings.seeds, settings.pick(5, 20)))
    for step, seed in enumerate(settings.runs):
        context.progress(step / settings.seeds, f"seed {seed}")
        pool = context.simulated(TRAINING_TOUCHES, model=plans.NOISY, seed=seed)
        unseen = context.simulated((TEST_SETS + 5) * max(counts), model=plans.NOISY, seed=seed, use="testing")
        for place, touches in enumerate(counts):
            for seen, of in SEEN.items():
                rng = lambda what, seed=seed, touches=touches: context.rng(what, seed, touches)
                train = drawn_sets(pool, touches, TRAINING_TOUCHES, rng("train"), of)
                tests = {"simulated": some(dealt_sets(unseen, touches, rng("simulated"), of), TEST_SETS, rng("some")),
                         kind: drawn_sets(rig, touches, TEST_SETS, rng("rig"), of)}
                for k, make in enumerate(recognisers.SEEDS.values()):
                    recogniser = recognisers.Trained(make(seed), train)
                    for where, test in tests.items():
                        found[seen, where][k, step, place] = recogniser.accuracy(test)
                if seen == "curvatures" and touches == 15:
                    for shuffle in range(chance.shape[1]):
                        control = recognisers.shuffled(train, context.rng("shuffled", seed, shuffle))
                        chance[step, shuffle] = recognisers.accuracy(recognisers.SEEDS["XGBoost"](seed), control, tests["simulated"])
    return _result(context, counts, names, found, len(rig), controls.control(chance, 1 / len(plans.OBJECTS)))


def _result(context, counts, names, found, rig_touches, control):
    kind = context.settings.measured_kind
    last = lambda seen, where: {name: values[:, -1] for name, values in zip(names, found[seen, where])}
    result = Result("", "", made_on=[
        (f"{TRAINING_TOUCHES} simulated touches in training, of which as many sets are drawn, and {TEST_SETS} sets of others in testing, with the "
         "seed's noise, new for every seed"),
        (f"{TEST_SETS} {kind} sets, drawn for every seed from {rig_touches} touches that were made once: the intervals on them do "
         "not hold the chance of another measurement")])
    result.words = [
        f"With {counts[-1]} touches a set, on {kind} sets by curvatures, {_best(last('curvatures', kind))}.",
        f"Of simulated sets, by curvatures, {_best(last('curvatures', 'simulated'))}. The seed found XGBoost best.",
        f"By contact times themselves, on {kind} sets, {_best(last('contact times', kind))}.",
        _more_words(found["curvatures", kind].mean(0), counts, kind),
        f"XGBoost on simulated sets of 15 touches: {control.words()}."]
    for (seen, where), values in found.items():
        lines = {name: estimates(each) for name, each in zip(names, values)}
        result.figures.append(figures.curves(
            context.figure_path(f"{seen.replace(' ', '-')}-{where}"), f"Accuracy by {seen} on {where} sets against the touches in a set; trained "
            f"on {TRAINING_TOUCHES} simulated touches. Bands: 95 % over seeds.", counts, lines, x_label="touches a feature set",
            chance=1 / len(plans.OBJECTS)))
        result.tables.append(Table(f"Accuracy by {seen} on {where} sets", ["recogniser", *(f"{n} touches" for n in counts)],
                                   [[name, *(point.words() for point in points)] for name, points in lines.items()]))
    result.comparisons = [Comparison(f"{name}, {counts[-1]} touches a set", estimate_share(values), None,
                                     f"trained on {TRAINING_TOUCHES} simulated touches, tested on {kind} ones",
                                     "the seed shows curves without numbers: XGBoost above the others")
                          for name, values in last("curvatures", kind).items()]
    result.data = {"touches": counts, "recognisers": names,
                   "accuracy": {f"{seen}, {where}": v.tolist() for (seen, where), v in found.items()},
                   "shuffled": vars(control.found)}
    return result


def _best(values) -> str:
    best = max(values, key=lambda name: values[name].mean())
    others = [paired.order(best, values[best], name, each) for name, each in values.items() if name != best]
    return f"{best} recognises most: {'; '.join(others)}"


def _more_words(more, counts, kind) -> str:
    return (f"More touches: {paired.order(f'{counts[-1]} touches a set', more[:, -1], f'{counts[0]} touches', more[:, 0])} on {kind} sets, "
            "by curvatures, all recognisers together.")


EXPERIMENT = Experiment("touches_per_set", "Touches in a feature set", "figure 9: XGBoost, support vector machine and naive Bayes "
                        "against the touches in a set, 640 virtual samples; XGBoost best", run, (12, 150))
