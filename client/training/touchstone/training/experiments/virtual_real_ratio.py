"""Figure 12 of the seed: accuracy against the ratio of virtual to measured touches in training."""

from __future__ import annotations

import numpy as np

from .. import figures, measured_sets, plans, recognisers
from ..context import Context
from ..experiment import Experiment
from ..features import drawn_sets
from ..result import Result, Table
from ..statistics import estimates
from .noise_in_training import REAL, TEST_SETS, TEST_SHARE, VIRTUAL, set_sizes, sets_of, shown_size

TOTAL = VIRTUAL + REAL


def run(context: Context) -> Result:
    settings = context.settings
    shares = settings.pick([0, 20, 60, 100], [0, 5, 10, 20, 30, 40, 60, 80, 100])  # % measured
    counts = set_sizes(context)
    rig = context.measured(plans.measured(settings), options=plans.RIG)
    found = np.zeros((len(counts), len(recognisers.SEEDS), settings.seeds, len(shares)))
    total = 0
    for step, seed in enumerate(settings.runs):
        context.progress(step / settings.seeds, f"seed {seed}")
        rows, test_rows = measured_sets.split(rig, TEST_SHARE, context.rng("split", seed))
        # A rig has fewer touches than the seed's 800 for training: the ratio is of as many as it has.
        total = min(TOTAL, len(rows))
        pool = context.simulated(TOTAL, model=plans.NOISY, seed=seed)
        for column, touches in enumerate(counts):
            test = drawn_sets(rig[test_rows], touches, TEST_SETS, context.rng("test", seed, touches))
            for place, share in enumerate(shares):
                rng = context.rng("sets", seed, touches, share)
                parts = {"virtual": measured_sets.part(pool, total - total * share // 100, rng),
                         "rig": measured_sets.part(rig[rows], total * share // 100, rng)}
                if min(len(part) for part in parts.values() if len(part)) < len(plans.OBJECTS) * touches:
                    found[column, :, step, place] = np.nan  # too few touches of one source for a set of each object
                    continue
                train = sets_of({name: part for name, part in parts.items() if len(part)}, touches, TOTAL, rng)
                for k, make in enumerate(recognisers.SEEDS.values()):
                    found[column, k, step, place] = recognisers.accuracy(make(seed), train, test)
    return _result(context, shares, counts, found, total, len(rig))


def _result(context, shares, counts, found, total, rig_touches):
    kind = context.settings.measured_kind
    shown = shown_size(context)
    values = found[counts.index(shown)]
    possible = [k for k in range(len(shares)) if np.isfinite(values[0, :, k]).all()]
    best = shares[max(possible, key=lambda k: values[0, :, k].mean())]
    # Where the best share lies is as uncertain as the seeds make it.
    each_best = [shares[int(np.nanargmax(row))] for row in values[0]]
    result = Result("", "", made_on=[
        f"{total} touches in training, simulated with the seed's noise (new for every seed) or {kind}, of which {TOTAL} sets are drawn",
        f"{rig_touches} {kind} touches, made once; {TEST_SHARE:.0%} of the poses are for testing, others for every seed"])
    result.words = [(f"XGBoost on sets of {shown} touches is best on average with {best} % {kind} touches in training; seed by seed the best "
                     f"share lies between {min(each_best)} and {max(each_best)} %. The seed chose 20 %.")]
    by_size = {f"{n} touches a set": each[0] for n, each in zip(counts, found)}
    by_name = dict(zip(recognisers.SEEDS, values))
    for name, caption, lines in (
            ("recognisers", f"Three recognisers on {kind} sets of {shown} touches", by_name), ("sizes", f"XGBoost on {kind} sets", by_size)):
        whole = {line: each[:, possible] for line, each in lines.items() if np.isfinite(each[:, possible]).all()}
        result.figures.append(figures.curves(
            context.figure_path(name), f"{caption} against the share of {kind} touches among {total} in training. Bands: 95 % over seeds.",
            [shares[k] for k in possible], {line: estimates(each) for line, each in whole.items()},
            x_label=f"{kind} touches in training, %", chance=1 / len(plans.OBJECTS)))
    cells = lambda each: [point.words() if np.isfinite(point.value) else "too few touches" for point in estimates(each)]
    for title, first, lines in ((f"Accuracy on {kind} sets of {shown} touches", "recogniser", by_name),
                                (f"XGBoost on {kind} sets, by the touches of a set", "set", by_size)):
        result.tables.append(Table(title, [first, *(f"{share} % {kind}" for share in shares)],
                                   [[line, *cells(each)] for line, each in lines.items()],
                                   "Too few touches: of one of the sources there are not enough for one set of every object."))
    result.data = {"measured_percent": shares, "touches": counts, "recognisers": list(recognisers.SEEDS), "accuracy": found.tolist()}
    return result


EXPERIMENT = Experiment("virtual_real_ratio", "Ratio of virtual to measured touches", "figure 12: a curve of the accuracy against the "
                        "ratio, the best near 80:20", run, (15, 240))
