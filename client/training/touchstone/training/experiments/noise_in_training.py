"""Figures 10 and 11 of the seed: trained without noise, with noise, with some measured touches, and on measured ones alone."""

from __future__ import annotations

import numpy as np

from .. import figures, measured_sets, paired, plans, recognisers
from ..context import Context
from ..experiment import Experiment
from ..features import FeatureSets, drawn_sets, joined
from ..result import Comparison, Result, Table
from ..statistics import estimate_share, estimates
from ..touch_data import TouchData

# The seed's samples are touches: 640 virtual and 160 measured ones, or 768, which is 80 % of its 960. The other 192 are tested.
VIRTUAL, REAL, TEST_SHARE, TEST_SETS = 640, 160, 0.2, 300


def set_sizes(context: Context) -> list[int]:
    """Touches of a set; of a quick run's few measured ones none can be large."""
    return context.settings.pick([5, 8], [5, 10, 15, 20, 25, 30])


def shown_size(context: Context) -> int:
    """Touches of a set where one number is shown."""
    return context.settings.pick(8, 15)


def sets_of(parts: dict[str, TouchData], touches: int, sets: int, rng: np.random.Generator) -> FeatureSets:
    """`sets` sets of the touches of all parts together, every set of touches of one part only; of each part as many sets as
    it has touches of them."""
    total = sum(map(len, parts.values()))
    edges = np.round(np.cumsum([0, *map(len, parts.values())]) * sets / total).astype(int)
    return joined(*(drawn_sets(part, touches, stop - start, rng) for part, start, stop in zip(parts.values(), edges, edges[1:]) if stop > start))


def training_parts(context: Context, rig: TouchData, rows: np.ndarray, seed: int) -> dict[str, dict[str, TouchData]]:
    """The touches of every training set that is compared, by its name; `rows` of the rig's touches may be trained on."""
    kind = context.settings.measured_kind
    ideal, noisy = (context.simulated(VIRTUAL + REAL, model=model, seed=seed) for model in (plans.IDEAL, plans.NOISY))
    alone = rig[rows]
    real = measured_sets.part(alone, REAL, context.rng("part", seed))
    return {f"{VIRTUAL + REAL} virtual, ideal": {"virtual": ideal}, f"{VIRTUAL + REAL} virtual, noisy": {"virtual": noisy},
            f"{VIRTUAL} virtual, noisy + {len(real)} {kind}": {"virtual": noisy[:VIRTUAL], kind: real},
            f"{len(alone)} {kind}": {kind: alone}}


def run(context: Context) -> Result:
    settings = context.settings
    rig = context.measured(plans.measured(settings), options=plans.RIG)
    counts, names, trained = set_sizes(context), list(recognisers.SEEDS), []
    found, confusions = [], {}
    for step, seed in enumerate(settings.runs):
        context.progress(step / settings.seeds, f"seed {seed}")
        rows, test_rows = measured_sets.split(rig, TEST_SHARE, context.rng("split", seed))
        parts = training_parts(context, rig, rows, seed)
        trained, accuracies = list(parts), np.zeros((len(names), len(parts), len(counts)))
        for column, touches in enumerate(counts):
            test = drawn_sets(rig[test_rows], touches, TEST_SETS, context.rng("test", seed, touches))
            for place, (title, part) in enumerate(parts.items()):
                train = sets_of(part, touches, VIRTUAL + REAL, context.rng("sets", seed, touches, place))
                for k, (name, make) in enumerate(recognisers.SEEDS.items()):
                    matrix = recognisers.confusion(recognisers.Trained(make(seed), train), test, len(plans.OBJECTS))
                    accuracies[k, place, column] = matrix.trace() / matrix.sum()
                    if name == "XGBoost" and touches == shown_size(context):
                        confusions[title] = confusions.get(title, 0) + matrix
        found.append(accuracies)
    return _result(context, counts, names, trained, np.array(found), confusions, len(rig))


def _result(context, counts, names, trained, found, confusions, rig_touches):
    """`found`: (seeds, recognisers, training sets, touches of a set)."""
    kind, shown = context.settings.measured_kind, shown_size(context)
    column = counts.index(shown)
    ideal, noisy, mixed, real = found[:, 0, :, column].T
    result = Result("", "", made_on=[
        f"simulated touches, without noise and with a standard deviation of {plans.SIGMA_US / 1e6:g} s, new for every seed",
        (f"{rig_touches} {kind} touches that were made once; {TEST_SHARE:.0%} of the poses of each object are for testing, others for "
         "every seed"),
        (f"{VIRTUAL + REAL} sets in training and {TEST_SETS} in testing, drawn from the touches that are named: a touch is in several "
         "of them")])
    result.words = [
        f"On {kind} sets of {shown} touches, XGBoost: {paired.order('training with noise', noisy, 'training without', ideal)}.",
        f"{paired.order(trained[2], mixed, f'{trained[3]} touches alone', real)}; the seed found the former better.",
        f"{paired.order(trained[2], mixed, 'virtual with noise alone', noisy)}.",
        _order_words(counts, trained, found)]
    result.words = [words[0].upper() + words[1:] for words in result.words]
    result.tables = [Table(f"Accuracy on {kind} sets of {shown} touches in poses that were not trained on", ["trained on", *names],
                           [[title, *(estimate_share(found[:, k, place, column]).words() for k in range(len(names)))]
                            for place, title in enumerate(trained)])]
    result.tables.append(Table(f"XGBoost on {kind} sets, by the touches of a set", ["trained on", *(f"{n} touches" for n in counts)],
                               [[title, *(each.words() for each in estimates(found[:, 0, place]))] for place, title in enumerate(trained)]))
    result.figures = [
        figures.curves(context.figure_path("sizes"), f"XGBoost on {kind} sets in poses that were not trained on, by the touches of a set. "
                       "Bands: 95 % over seeds.", counts, {title: estimates(found[:, 0, place]) for place, title in enumerate(trained)},
                       x_label="touches a feature set", chance=1 / len(plans.OBJECTS)),
        figures.confusion(context.figure_path("confusion"), f"What XGBoost takes each object for, % of {kind} sets of {shown} touches, all "
                          "seeds together.", plans.OBJECTS, {t.replace(", ", ",\n").replace(" + ", "\n+ "): m
                                                             for t, m in confusions.items()})]
    why = "the seed shows matrices and curves; which objects are confused depends on the shapes, which the seed does not publish"
    result.comparisons = [Comparison(f"XGBoost, trained on {title}", each, None, f"tested on {kind} sets of {shown} touches", why)
                          for title, each in zip(trained, estimates(found[:, 0, :, column]))]
    result.data = {"recognisers": names, "trained_on": trained, "touches": counts, "accuracy": found.tolist(),
                   "confusion": {title: matrix.tolist() for title, matrix in confusions.items()}}
    return result


def _order_words(counts, trained, found) -> str:
    """For how many sizes of a set the mixture is better than what is measured alone."""
    gains = [paired.difference(found[:, 0, 2, k], found[:, 0, 3, k]) for k in range(len(counts))]
    better = [f"{n}" for n, gain in zip(counts, gains) if gain.low > 0]
    worse = [f"{n}" for n, gain in zip(counts, gains) if gain.high < 0]
    return (f"By the touches of a set ({', '.join(map(str, counts))}), XGBoost: {trained[2]} is better than {trained[3]} alone for "
            f"{', '.join(better) or 'none'}, worse for {', '.join(worse) or 'none'}; elsewhere they cannot be told apart")


EXPERIMENT = Experiment("noise_in_training", "Noise and measured touches in training", "figures 10 and 11: without noise poor, with a "
                        "noise of 0.04779 s better, 80:20 virtual and measured (640 + 160) better than 768 measured", run, (12, 130))
