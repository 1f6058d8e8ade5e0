"""Figure 9 of the seed: three recognisers against the number of touches in a feature set, trained on simulated ones."""

from __future__ import annotations

import numpy as np

from .. import figures, paired, plans, recognisers
from ..context import Context
from ..experiment import Experiment
from ..features import feature_sets
from ..measured_sets import drawn_sets
from ..result import Comparison, Result, Table
from ..statistics import estimate_share, estimates

TRAINING_SETS, TEST_SETS = 640, 500


def run(context: Context) -> Result:
    settings = context.settings
    counts = settings.pick([5, 15, 30], [5, 10, 15, 20, 25, 30])
    rig = context.measured(plans.measured(settings), options=plans.RIG)
    names = list(recognisers.SEEDS)
    found = {where: np.zeros((len(names), settings.seeds, len(counts))) for where in ("simulated", settings.measured_kind)}
    for step, seed in enumerate(settings.runs):
        context.progress(step / settings.seeds, f"seed {seed}")
        pool = context.simulated((TRAINING_SETS + TEST_SETS) * max(counts) + 500, model=plans.NOISY, seed=seed)
        for place, touches in enumerate(counts):
            features, objects = feature_sets(pool, touches, context.rng("simulated", seed, touches), sets=TRAINING_SETS + TEST_SETS)
            order = context.rng("order", seed, touches).permutation(len(features))
            train, held_out = order[:TRAINING_SETS], order[TRAINING_SETS:]
            tests = {"simulated": (features[held_out], objects[held_out]),
                     settings.measured_kind: drawn_sets(rig, touches, TEST_SETS, context.rng("rig", seed, touches))}
            for k, make in enumerate(recognisers.SEEDS.values()):
                recogniser = make(seed).fit(features[train], objects[train])
                for where, test in tests.items():
                    found[where][k, step, place] = np.mean(recogniser.predict(test[0]) == test[1])
    return _result(context, counts, names, found, len(rig))


def _result(context, counts, names, found, rig_touches):
    kind = context.settings.measured_kind
    best = {where: names[int(np.argmax(values[:, :, -1].mean(1)))] for where, values in found.items()}
    others = lambda where: [paired.order(best[where], found[where][names.index(best[where]), :, -1], name, values[:, -1])
                            for name, values in zip(names, found[where]) if name != best[where]]
    more = found[kind].mean(0)
    result = Result("", "", made_on=[
        f"{TRAINING_SETS} simulated sets in training and {TEST_SETS} others in testing, with the seed's noise, new for every seed",
        (f"{TEST_SETS} {kind} sets, drawn for every seed from {rig_touches} touches that were made once: the intervals on them do "
         "not hold the chance of another measurement")])
    result.words = [
        f"With {counts[-1]} touches a set {best[kind]} recognises most of the {kind} sets: {'; '.join(others(kind))}.",
        f"Of simulated sets {best['simulated']} recognises most: {'; '.join(others('simulated'))}. The seed found XGBoost best.",
        (f"More touches: {paired.order(f'{counts[-1]} touches a set', more[:, -1], f'{counts[0]} touches', more[:, 0])} on {kind} sets, "
         "all recognisers together.")]
    for where, values in found.items():
        lines = {name: estimates(each) for name, each in zip(names, values)}
        result.figures.append(figures.curves(
            context.figure_path(where), f"Accuracy on {where} sets against the touches in a set; trained on {TRAINING_SETS} simulated "
            "sets. Bands: 95 % over seeds.", counts, lines, x_label="touches a feature set", chance=1 / len(plans.OBJECTS)))
        result.tables.append(Table(f"Accuracy on {where} sets", ["recogniser", *(f"{n} touches" for n in counts)],
                                   [[name, *(point.words() for point in points)] for name, points in lines.items()]))
    result.comparisons = [Comparison(f"{name}, {counts[-1]} touches a set", estimate_share(found[kind][k, :, -1]), None,
                                     f"trained on {TRAINING_SETS} simulated sets, tested on {kind} ones",
                                     "the seed shows curves without numbers: XGBoost above the others")
                          for k, name in enumerate(names)]
    result.data = {"touches": counts, "recognisers": names, "accuracy": {where: v.tolist() for where, v in found.items()}}
    return result


EXPERIMENT = Experiment("touches_per_set", "Touches in a feature set", "figure 9: XGBoost, support vector machine and naive Bayes "
                        "against the touches in a set, 640 virtual samples; XGBoost best", run, (12, 200))
