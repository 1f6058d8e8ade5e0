"""How many touches it takes to be sure: the next touch chosen by expected information, at random, or in a fixed order."""

from __future__ import annotations

import matplotlib.pyplot as plt
import numpy as np

import touchstone

from .. import figures, ladder, plans
from ..context import Context
from ..experiment import Experiment
from ..result import Result, Table
from ..sequential import Expected, recognise
from ..statistics import estimate, estimate_share

CERTAINTY = 0.95
REACHABLE = 12  # candidates of an episode: what an arm may reach, and touches at most
STROKE_MM = 100.0
NOISES = (1, 2, 4)  # times the seed's, on simulated touches
POLICIES = ("information", "random", "fixed")
# The rig of the ladder with the seed's noise: with an optical sensor's one touch is enough, whichever it is.
RIG = ("--sigma-us", f"{plans.SIGMA_US:.0f}", *ladder.RIGS[0].hidden)


def run(context: Context) -> Result:
    settings = context.settings
    rungs = ladder.climb(context)
    candidates = _candidates(context)
    context.progress(0.3, f"{len(candidates)} candidate touches")
    rig = _measured(context, candidates)[None]
    last = _expected(context, candidates, rungs[-1])
    simulated = np.stack([_touch(context.simulator, candidates, ladder.with_noise(rungs[-1].model, plans.SIGMA_US), 70 + r)
                          for r in range(settings.pick(4, 20))])
    nominal = _expected(context, candidates, rungs[0])
    kind = settings.measured_kind
    cases = {
        "simulated, its own model": (last[0], simulated),
        f"{kind}, nominal, its error ignored": (nominal[0], rig),
        f"{kind}, nominal, its error counted": (nominal[1], rig),
        f"{kind}, last model, its error counted": (last[1], rig),
        f"{kind}, last model, free space ignored": (Expected(last[1].times_us, last[1].scatter_us, False), rig),
    }
    found = {}
    for name, (expected, observed) in cases.items():
        found[name] = _case(context, name, expected, observed)
        context.progress(0.4 + 0.6 * len(found) / len(cases), name)
    noise = {times: _noisier(context, candidates, rungs[-1], last[0], times) for times in NOISES}
    return _result(context, candidates, rig[0], cases, found, noise)


def _candidates(context) -> touchstone.Touches:
    """Touches of every face of the box in which all objects lie, up to its rim, so that fingers may pass; the same lines for
    all objects, drawn without knowledge of any."""
    return plans.blind(context.settings.pick(4, 16), seed=21, spread=1.0, standoff_mm=ladder.STANDOFF_MM, stroke_mm=STROKE_MM)


def _touch(client, candidates, model, seed):
    """(candidates, objects, fingers) contact times less the first's, NaN: none."""
    return np.stack([client.touch(name, candidates, model=model, seed=seed, start=k * 1_000_000)["descriptor_us"]
                     for k, name in enumerate(plans.OBJECTS)], 1)


def _measured(context, candidates):
    """By the rig, each touch once for each object; kept, since an arm takes its time."""
    what = [candidates.target_mm.tolist(), candidates.approach.tolist(), STROKE_MM, RIG]
    return context.kept(what, lambda: {"times_us": _touch(context.rig(*RIG), candidates, None, 0)})["times_us"]


def _expected(context, candidates, rung):
    """The model's touches without noise, with the scatter of noise alone and of noise and the model's own error.

    That error is what its RMSE of held-out touches has beyond the sensor's noise.
    """
    times = _touch(context.simulator, candidates, ladder.with_noise(rung.model, 0), 1)
    error = max(rung.rmse_us**2 - ladder.SIGMA_US**2, 0)
    return Expected(times, plans.SIGMA_US), Expected(times, float(np.hypot(plans.SIGMA_US, np.sqrt(error))))


def _case(context, name, expected, observed):
    """{policy: (seeds, 4)}: touches, share that is sure, share of those that is right, their mean stated certainty."""
    settings = context.settings
    outcomes = expected.outcomes(context.rng("outcomes", name), settings.pick(8, 24))
    found = {policy: [] for policy in POLICIES}
    for seed in settings.runs:
        rng = context.rng("episodes", seed)
        episodes = {policy: [] for policy in POLICIES}
        for number in range(settings.pick(40, 200)):
            true = number % len(plans.OBJECTS)
            reachable = np.sort(rng.choice(len(expected.times_us), REACHABLE, replace=False))
            one = observed[rng.integers(len(observed), size=len(expected.times_us)), np.arange(len(expected.times_us)), true]
            for policy in POLICIES:
                went = recognise(expected, one, reachable, policy, rng, outcomes=outcomes, certainty=CERTAINTY)
                episodes[policy].append((went.touches, went.sure, went.sure and went.answer == true, went.sure * went.certainty))
        for policy in POLICIES:
            touches, sure, right, stated = np.mean(episodes[policy], 0)
            found[policy].append((touches, sure, right / max(sure, 1e-9), stated / max(sure, 1e-9)))
    return {policy: np.array(values) for policy, values in found.items()}


def _noisier(context, candidates, rung, expected, times):
    """_case() of touches simulated and judged by one model with more noise."""
    sigma = times * plans.SIGMA_US
    observed = np.stack([_touch(context.simulator, candidates, ladder.with_noise(rung.model, sigma), 170 + r)
                         for r in range(context.settings.pick(2, 10))])
    return _case(context, f"noise {times}", Expected(expected.times_us, sigma), observed)


def _result(context, candidates, rig, cases, found, noise):
    kind = context.settings.measured_kind
    result = Result("", "", made_on=[
        f"{len(candidates)} candidate touches, each simulated once for each of {len(plans.OBJECTS)} objects by the models of the ladder",
        (f"{rig.shape[0] * rig.shape[1]} {kind} touches, each made once: the rig of the ladder with the seed's noise "
         f"({plans.SIGMA_US / 1e3:.1f} ms), {np.isnan(rig).any(-1).mean():.0%} of them with a finger that met nothing"),
        (f"an episode may make {REACHABLE} of the candidates, drawn at random; intervals are over the episodes of each seed, not over "
         "other touches of the rig")])
    result.words = [_policy_words(name, found[name]) for name in (*list(found)[:1], list(found)[3])]
    result.words += [_calibration_words(found), _free_space_words(found), _noise_words(noise)]
    rows = []
    for name, each in found.items():
        for policy, values in each.items():
            touches, stated = estimate(values[:, 0]), estimate(values[:, 3])
            sure, right = estimate_share(values[:, 1]), estimate_share(values[:, 2])
            rows.append([name, policy, touches.words(percent=False), sure.words(), right.words(), f"{stated.value:.1%}"])
    result.tables = [Table("Touches to 95 % certainty", ["touches, model", "next touch", "touches", "became sure", "of these right", "stated"],
                           rows, "Episodes that never became sure count with all their touches. Scatter by which touches are judged: "
                           + "; ".join(f"{name}: {expected.scatter_us / 1e3:.1f} ms" for name, (expected, _) in cases.items()) + ".")]
    result.figures = [_draw(context, found), _draw_noise(context, noise)]
    result.data = {"cases": {name: {policy: values.tolist() for policy, values in each.items()} for name, each in found.items()},
                   "noise": {times: {policy: values.tolist() for policy, values in each.items()} for times, each in noise.items()}}
    return result


def _policy_words(name, each):
    mean = {policy: estimate(values[:, 0]) for policy, values in each.items()}
    saved = {policy: estimate(each[policy][:, 0] - each["information"][:, 0]) for policy in ("random", "fixed")}
    told = {True: "fewer touches are needed", False: "no saving can be told"}
    return (f"On {name}: by expected information {mean['information'].words(percent=False)} touches are needed to be 95 % sure, at random "
            f"{mean['random'].words(percent=False)}, in a fixed order {mean['fixed'].words(percent=False)}: against random "
            f"{told[saved['random'].low > 0]}, against a fixed order {told[saved['fixed'].low > 0]}.")


def _calibration_words(found):
    said = []
    for name, each in list(found.items())[:4]:
        right, stated = (np.mean([values[:, column] for values in each.values()], 0) for column in (2, 3))
        share, excess = estimate_share(right), estimate(stated - right)
        enough = "at least the 95 % asked for" if share.low >= CERTAINTY else "fewer than the 95 % asked for" if share.high < CERTAINTY \
            else "about the 95 % asked for"
        # A difference of a point or less is of no use to anybody.
        honest = "less certain than right" if excess.high < 0 else "more certain than right" if excess.low > 0.01 else "as certain as right"
        said.append(f"{name[0].upper()}{name[1:]}: {share.words()} right, {enough}; stated {np.mean(stated):.1%} on average, {honest}")
    return "Answers given at 95 % certainty or more, all ways of choosing together. " + ". ".join(said) + "."


def _free_space_words(found):
    names = list(found)
    gain = estimate(found[names[4]]["random"][:, 0] - found[names[3]]["random"][:, 0])
    if gain.low > 0:
        return (f"A finger that passes without contact is evidence: without it {gain.words(percent=False)} touches more are needed at "
                "random on the same touches.")
    return f"That fingers pass without contact saves no touches that can be told: {gain.words(percent=False)} at random."


def _noise_words(noise):
    said = [f"{times} x: {estimate(each['information'][:, 0]).words(percent=False)} against "
            f"{estimate(each['random'][:, 0]).words(percent=False)}, {estimate_share(each['information'][:, 2]).words()} right"
            for times, each in noise.items()]
    return "By expected information against at random, with more noise than the seed's, on simulated touches. " + "; ".join(said) + "."


def _draw_noise(context, noise):
    lines = {policy: [estimate(each[policy][:, 0]) for each in noise.values()] for policy in POLICIES}
    return figures.curves(context.figure_path("noise"), "Touches to 95 % certainty over the noise of each finger's time, on simulated "
                          f"touches; at most {REACHABLE}. Bands: 95 % over seeds.", [times * plans.SIGMA_US / 1e3 for times in noise], lines,
                          x_label="noise of a finger's time, ms", y_label="touches to 95 % certainty")


def _draw(context, found):
    figure, (left, right) = plt.subplots(1, 2, figsize=(9.6, 3.8), sharey=True)
    y = np.arange(len(found))[::-1]
    for place, policy in enumerate(POLICIES):
        for axes, column, scale in ((left, 0, 1), (right, 2, 100)):
            points = [(estimate if axes is left else estimate_share)(each[policy][:, column]) for each in found.values()]
            axes.errorbar([scale * p.value for p in points], y + 0.16 * (1 - place),
                          xerr=[[scale * (p.value - p.low) for p in points], [scale * (p.high - p.value) for p in points]],
                          marker="osD"[place], markersize=5, linestyle="", capsize=2, color=figures.colour(policy), label=policy)
    left.set_yticks(y, [name.replace(", ", "\n", 1) for name in found], fontsize=8)
    left.set(xlabel="touches to 95 % certainty", xlim=(0, None))
    right.axvline(100 * CERTAINTY, color="#1f2933", linestyle="--", linewidth=1)
    right.annotate("stated", (100 * CERTAINTY, 1), xycoords=("data", "axes fraction"), ha="right", va="bottom", fontsize=8)
    right.set(xlabel="right of the answers given at 95 %, %")
    left.legend(loc="lower left", bbox_to_anchor=(0, 1.01), borderaxespad=0, ncols=3, fontsize=8)
    return figures.save(figure, context.figure_path("touches"), "Left: touches until one object has a probability of 95 %. Right: how many "
                        "of these answers are right. Bars: 95 % over seeds.")


EXPERIMENT = Experiment("touches_to_be_sure", "How many touches it takes to be sure", "", run, (18, 160))
