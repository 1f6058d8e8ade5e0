"""What the choices that the seed leaves open make of one accuracy: each varied by itself."""

from __future__ import annotations

import dataclasses
import functools
from typing import Any, Callable

import numpy as np
import xgboost

import touchstone

from .. import features, paired, plans, recognisers
from ..context import Context
from ..experiment import Experiment
from ..features import dealt_sets, drawn_sets
from ..measured_sets import part, split
from ..result import Result, Table
from ..statistics import estimate_share
from .noise_in_training import REAL, TEST_SETS, TEST_SHARE, VIRTUAL, shown_size


@dataclasses.dataclass(frozen=True)
class Choices:
    """What the other experiments use; each row of the table changes one."""

    features: features.Features = features.curvatures
    rounds: bool = False  # of plans.measured_in_rounds()
    by_pose: bool = True
    dealt: bool = False  # every touch in one set at most, in training
    recogniser: Callable[[int], Any] = recognisers.SEEDS["XGBoost"]
    plan: Any = None  # plans.simulated()
    sigma_us: float = plans.SIGMA_US


def variations() -> dict[str, Choices]:
    """By what is changed."""
    trees = lambda n, depth: lambda seed: xgboost.XGBClassifier(n_estimators=n, max_depth=depth, learning_rate=0.2, n_jobs=1,
                                                                random_state=seed, verbosity=0)
    return {
        "as everywhere: curvatures in their order": Choices(),
        "curvatures in the order of touching": Choices(features=features.curvatures_as_touched),
        "contact times themselves": Choices(features=features.triples),
        f"a histogram of {features.BINS} bins": Choices(features=features.histogram),
        "a histogram of 8 bins": Choices(features=functools.partial(features.histogram, bins=8)),
        "four moments": Choices(features=features.moments),
        "a touch in one set at most, in training": Choices(dealt=True),
        "the rig measures in rounds, split by pose": Choices(rounds=True),
        "the rig measures in rounds, split by touch: rounds of a pose on both sides": Choices(rounds=True, by_pose=False),
        "30 trees instead of 100": Choices(recogniser=trees(30, 4)),
        "depth 2 instead of 4": Choices(recogniser=trees(100, 2)),
        "depth 8 instead of 4": Choices(recogniser=trees(100, 8)),
        "simulated from all sides (sphere)": Choices(plan=touchstone.sphere(step_angle_deg=1, roll_step_deg=1)),
        "half the noise in the simulation": Choices(sigma_us=plans.SIGMA_US / 2),
        "twice the noise in the simulation": Choices(sigma_us=plans.SIGMA_US * 2),
    }


def run(context: Context) -> Result:
    settings, kind = context.settings, context.settings.measured_kind
    rig, rounds = (context.measured(plan, options=plans.RIG) for plan in (plans.measured(settings), plans.measured_in_rounds(settings)))
    table = variations()
    found = np.zeros((len(table), settings.seeds))
    for step, seed in enumerate(settings.runs):
        context.progress(step / settings.seeds, f"seed {seed}")
        for place, choices in enumerate(table.values()):
            found[place, step] = _accuracy(context, rounds if choices.rounds else rig, choices, seed)
    differences = [paired.difference(values, found[0]) for values in found]
    signed = lambda d: f"{100 * d.value:+.1f} ({100 * d.low:+.1f} to {100 * d.high:+.1f})"
    clear = [f"{name} ({100 * d.value:+.1f} points)" for name, d in list(zip(table, differences))[1:] if d.low > 0 or d.high < 0]
    result = Result("", "", made_on=[
        (f"XGBoost, trained on {VIRTUAL} simulated touches (new for every seed) and {REAL} {kind} ones in sets of {shown_size(context)}, tested on "
         f"{TEST_SETS} {kind} sets; the {len(rig)} {kind} touches were made once")])
    result.words = [("Of the choices that the seed leaves open these change the accuracy by more than the seeds do: " +
                     ", ".join(clear) + ".") if clear else "None of these choices changes the accuracy by more than the seeds do.",
                    f"{len(table) - 1} rows are compared, each at 95 %: one in twenty may stand out by chance."]
    result.tables = [Table(f"Accuracy on {kind} sets", ["changed", "accuracy", "difference, points"],
                           [[name, estimate_share(values).words(), "" if k == 0 else signed(differences[k])]
                            for k, (name, values) in enumerate(zip(table, found))])]
    result.data = {"changed": list(table), "accuracy": found.tolist()}
    return result


def _accuracy(context: Context, rig, choices: Choices, seed: int) -> float:
    """Rows share their random numbers, so that their differences hold only what was changed."""
    model = plans.NOISY.replace(f"{plans.SIGMA_US:.0f}", f"{choices.sigma_us:.0f}")
    touches = shown_size(context)
    rows, test_rows = split(rig, TEST_SHARE, context.rng("split", seed), by_pose=choices.by_pose)
    test = drawn_sets(rig[test_rows], touches, TEST_SETS, context.rng("test", seed), choices.features)
    pool = context.simulated(VIRTUAL, plan=choices.plan, model=model, seed=seed)
    real = part(rig[rows], REAL, context.rng("part", seed))
    sets = [dealt_sets(data, touches, context.rng(name, seed), choices.features) if choices.dealt
            else drawn_sets(data, touches, len(data), context.rng(name, seed), choices.features)
            for name, data in (("virtual", pool), ("rig", real))]
    return recognisers.Trained(choices.recogniser(seed), *sets, check_poses=choices.by_pose).accuracy(test)


EXPERIMENT = Experiment("sensitivity", "What was chosen, and what else would have come out", "features, splits and parameters, which "
                        "it leaves open", run, (20, 200))
