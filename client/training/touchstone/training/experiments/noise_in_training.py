"""Figures 10 and 11 of the seed: trained without noise, with noise, with some measured touches, and on measured ones alone."""

from __future__ import annotations

import numpy as np

from .. import figures, paired, plans, recognisers
from ..context import Context
from ..experiment import Experiment
from ..features import feature_sets
from ..measured_sets import drawn_sets, split
from ..result import Comparison, Result, Table
from ..statistics import estimate_share, estimates

TOUCHES = 15  # a set
VIRTUAL, REAL, REAL_ALONE, TEST_SETS = 640, 160, 768, 300
TEST_SHARE = 0.4  # of the poses


def training_sets(context: Context, rig, rows: np.ndarray, seed: int) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Features and objects of every training set that is compared, by name; `rows` of the rig's touches may be trained on."""
    kind = context.settings.measured_kind
    virtual = {name: feature_sets(context.simulated((VIRTUAL + REAL) * TOUCHES + 500, model=model, seed=seed),
                                  TOUCHES, context.rng(name, seed), sets=VIRTUAL + REAL)
               for name, model in (("ideal", plans.IDEAL), ("noisy", plans.NOISY))}
    real = drawn_sets(rig[rows], TOUCHES, REAL_ALONE, context.rng("rig", seed))
    # The objects take turns in drawn sets and lie in a row in virtual ones: a random part of the latter has all of them.
    part = context.rng("part", seed).permutation(VIRTUAL + REAL)[:VIRTUAL]
    mixed = tuple(np.concatenate([v[part], r[:REAL]]) for v, r in zip(virtual["noisy"], real))
    return {f"{VIRTUAL + REAL} virtual, ideal": virtual["ideal"], f"{VIRTUAL + REAL} virtual, noisy": virtual["noisy"],
            f"{VIRTUAL} virtual, noisy + {REAL} {kind}": mixed, f"{REAL_ALONE} {kind}": real}


def run(context: Context) -> Result:
    settings = context.settings
    rig = context.measured(plans.measured(settings), options=plans.RIG)
    names, trained = list(recognisers.SEEDS), []
    found, confusions = [], {}
    for step, seed in enumerate(settings.runs):
        context.progress(step / settings.seeds, f"seed {seed}")
        rows, test_rows = split(rig, TEST_SHARE, context.rng("split", seed))
        test = drawn_sets(rig[test_rows], TOUCHES, TEST_SETS, context.rng("test", seed))
        sets = training_sets(context, rig, rows, seed)
        trained, accuracies = list(sets), np.zeros((len(names), len(sets)))
        for place, (title, train) in enumerate(sets.items()):
            for k, (name, make) in enumerate(recognisers.SEEDS.items()):
                recogniser = make(seed).fit(*train)
                matrix = recognisers.confusion(recogniser, test, len(plans.OBJECTS))
                accuracies[k, place] = matrix.trace() / matrix.sum()
                if name == "XGBoost":
                    confusions[title] = confusions.get(title, 0) + matrix
        found.append(accuracies)
    return _result(context, names, trained, np.array(found), confusions, len(rig))


def _result(context, names, trained, found, confusions, rig_touches):
    """`found`: (seeds, recognisers, training sets)."""
    kind = context.settings.measured_kind
    ideal, noisy, mixed, real = found[:, 0].T
    result = Result("", "", made_on=[
        f"simulated touches, without noise and with a standard deviation of {plans.SIGMA_US / 1e6:g} s, new for every seed",
        (f"{rig_touches} {kind} touches that were made once; {TEST_SHARE:.0%} of the poses of each object are for testing, others for "
         "every seed, and no round of them is trained on"),
        (f"sets of {TOUCHES} touches; {TEST_SETS} in testing. {kind.capitalize()} sets are drawn from fewer touches than they have "
         "together: a touch is in several of them")])
    result.words = [
        f"On {kind} sets, XGBoost: {paired.order('training with noise', noisy, 'training without', ideal)}.",
        f"{paired.order(f'80:20 virtual and {kind}', mixed, f'{REAL_ALONE} {kind} sets alone', real)}; the seed found the former better.",
        f"{paired.order(f'80:20 virtual and {kind}', mixed, 'virtual with noise alone', noisy)}."]
    result.words = [words[0].upper() + words[1:] for words in result.words]
    result.tables = [Table(f"Accuracy on {kind} sets of poses that were not trained on", ["trained on", *names],
                           [[title, *(estimate_share(found[:, k, place]).words() for k in range(len(names)))]
                            for place, title in enumerate(trained)])]
    result.figures = [figures.confusion(context.figure_path("confusion"), f"What XGBoost takes each object for, % of {kind} sets, all "
                                        "seeds together.", plans.OBJECTS, {t.replace(", ", ",\n").replace(" + ", "\n+ "): m
                                                                           for t, m in confusions.items()})]
    why = "the seed shows matrices and curves; which objects are confused depends on the shapes, which the seed does not publish"
    result.comparisons = [Comparison(f"XGBoost, trained on {title}", each, None, f"tested on {kind} sets", why)
                          for title, each in zip(trained, estimates(found[:, 0]))]
    result.data = {"recognisers": names, "trained_on": trained, "accuracy": found.tolist(),
                   "confusion": {title: matrix.tolist() for title, matrix in confusions.items()}}
    return result


EXPERIMENT = Experiment("noise_in_training", "Noise and measured touches in training", "figures 10 and 11: without noise poor, with a "
                        "noise of 0.04779 s better, 80:20 virtual and measured (640 + 160) better than 768 measured", run, (12, 130))
