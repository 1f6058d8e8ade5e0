"""Figure 12 of the seed: accuracy against the ratio of virtual to measured sets in training."""

from __future__ import annotations

import numpy as np

from .. import figures, plans, recognisers
from ..context import Context
from ..experiment import Experiment
from ..features import feature_sets
from ..measured_sets import drawn_sets, split
from ..result import Result, Table
from ..statistics import estimates
from .noise_in_training import TEST_SETS, TEST_SHARE, TOUCHES

SETS = 800


def run(context: Context) -> Result:
    settings, kind = context.settings, context.settings.measured_kind
    shares = settings.pick([0, 20, 60, 100], [0, 5, 10, 20, 30, 40, 60, 80, 100])  # % measured
    rig = context.measured(plans.measured(settings), options=plans.RIG)
    found = np.zeros((len(recognisers.SEEDS), settings.seeds, len(shares)))
    for step, seed in enumerate(settings.runs):
        context.progress(step / settings.seeds, f"seed {seed}")
        rows, test_rows = split(rig, TEST_SHARE, context.rng("split", seed))
        test = drawn_sets(rig[test_rows], TOUCHES, TEST_SETS, context.rng("test", seed))
        pool = context.simulated(SETS * TOUCHES + 500, model=plans.NOISY, seed=seed)
        virtual = feature_sets(pool, TOUCHES, context.rng("virtual", seed), sets=SETS)
        order = context.rng("order", seed).permutation(SETS)
        real = drawn_sets(rig[rows], TOUCHES, SETS, context.rng("rig", seed))
        for place, share in enumerate(shares):
            measured = SETS * share // 100
            train = tuple(np.concatenate([v[order[: SETS - measured]], r[:measured]]) for v, r in zip(virtual, real))
            for k, make in enumerate(recognisers.SEEDS.values()):
                found[k, step, place] = recognisers.accuracy(make(seed), train, test)
    lines = {name: estimates(values) for name, values in zip(recognisers.SEEDS, found)}
    best = shares[int(np.argmax(found[0].mean(0)))]
    # Where the best share lies is as uncertain as the seeds make it.
    each_best = [shares[int(np.argmax(row))] for row in found[0]]
    result = Result("", "", made_on=[
        f"{SETS} sets of {TOUCHES} touches in training, simulated with the seed's noise (new for every seed) or {kind}",
        f"{len(rig)} {kind} touches, made once; {TEST_SHARE:.0%} of the poses are for testing, others for every seed"])
    result.words = [(f"XGBoost is best on average with {best} % {kind} sets in training; seed by seed the best share lies between "
                     f"{min(each_best)} and {max(each_best)} %. The seed chose 20 %.")]
    result.figures = [figures.curves(
        context.figure_path("curve"), f"Accuracy on {kind} sets against the share of {kind} sets among {SETS} in training. Bands: 95 % "
        "over seeds.", shares, lines, x_label=f"{kind} sets in training, %", chance=1 / len(plans.OBJECTS))]
    result.tables = [Table(f"Accuracy on {kind} sets", ["recogniser", *(f"{share} % {kind}" for share in shares)],
                           [[name, *(point.words() for point in points)] for name, points in lines.items()])]
    result.data = {"measured_percent": shares, "accuracy": {n: v.tolist() for n, v in zip(recognisers.SEEDS, found)}}
    return result


EXPERIMENT = Experiment("virtual_real_ratio", "Ratio of virtual to measured sets", "figure 12: a curve of the accuracy against the "
                        "ratio, the best near 80:20", run, (15, 240))
