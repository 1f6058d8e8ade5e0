"""The seed's outlook: other hands, sensors and arms, by the same command.

Every hand touches along the same lines whatever lies there, in simulation and on the rig alike (plans.blind): a touch that is
aimed at the surface of the object would tell one finger, by where it was aimed, what it is to find out.
"""

from __future__ import annotations

import dataclasses

import matplotlib.pyplot as plt
import numpy as np

import touchstone

from .. import controls, figures, plans
from ..context import Context
from ..experiment import Experiment
from ..features import FeatureSets
from ..recognisers import SEEDS, Trained, accuracy, shuffled
from ..result import Result, Table
from ..separation import pose_numbers, pose_seed
from ..statistics import estimate_share

SIGMA_US = 5000.0
HIDDEN = ("--hide", "tip_radius.radius_mm=2")
# A touch ends 50 mm behind the face of the box: what has met nothing by then passes the object.
SPEED_MM_S, STANDOFF_MM, STROKE_MM = 20.0, 60.0, 110.0
TOUCHES = 4  # of a set


@dataclasses.dataclass(frozen=True)
class Rig:
    name: str
    fingers: int = 3
    spacing_mm: float = 30.0
    sensor: str = "optical"
    arm: str = "ur3e"

    @property
    def options(self) -> tuple[str, ...]:
        """Of touchstone-rig-emulator."""
        # A UR3 says where it is a quarter as often as a UR3e: on a fast clock too few of these messages arrive in time.
        slower = ("--speedup", "30") if self.arm == "ur3" else ()
        return ("--fingers", str(self.fingers), "--spacing-mm", f"{self.spacing_mm:g}", "--sensor", self.sensor, "--arm", self.arm,
                "--sigma-us", f"{SIGMA_US:.0f}", *HIDDEN, *slower)

    @property
    def model(self) -> str:
        """Of the simulation: this hand, and the sensor's noise."""
        return (f"touchstone: model/1\nname: rig\nend_effector: {{fingers: {self.fingers}, spacing_mm: {self.spacing_mm:g}}}\neffects:\n"
                f"  - gaussian_noise: {{sigma_us: {SIGMA_US:.0f}}}\n")


QUICK = (Rig("1 finger", 1), Rig("2 fingers", 2), Rig("5 fingers, 20 mm apart, microswitches", 5, 20.0, "microswitch"))
WHOLE = (Rig("3 fingers, the seed's"), Rig("1 finger", 1), Rig("2 fingers", 2), Rig("5 fingers, 20 mm apart", 5, 20.0),
         Rig("3 fingers, 20 mm apart", 3, 20.0), Rig("microswitches", sensor="microswitch"), Rig("resistors", sensor="resistor"),
         Rig("UR3", arm="ur3"))


def run(context: Context) -> Result:
    settings = context.settings
    rigs = settings.pick(QUICK, WHOLE)
    found = {}
    for number, rig in enumerate(rigs):
        context.progress(number / len(rigs), rig.name)
        measured = _measured(context, rig)
        found[rig.name] = {"touches": len(measured["object"]), "diagnosis": _diagnosed(context, rig, measured),
                           "accuracy": [_seed(context, rig, measured, seed) for seed in settings.runs]}
    return _result(context, rigs, found)


def lines(per_face: int, seed: int) -> touchstone.Touches:
    """The touches of every hand on every object; other seeds, other lines."""
    return plans.blind(per_face, seed, standoff_mm=STANDOFF_MM, stroke_mm=STROKE_MM, speed_mm_s=SPEED_MM_S)


def _columns(client, touches, seed, model=None):
    """(N, fingers) times since the approach began, what was touched and how; touches with a missing finger are left out."""
    names = ["object", "contact_time_us", "target_mm", "approach", "lateral"]
    batches = list(client.dataset(plans.OBJECTS, touches, seed=seed, model=model, columns=names))
    joined = {name: np.concatenate([batch[name] for batch in batches]).astype(float) for name in names}
    whole = np.isfinite(joined["contact_time_us"]).all(1)
    return {name: values[whole] for name, values in joined.items()}


def _measured(context, rig):
    per_face = context.settings.pick(3, 16)
    return context.kept([rig.options, "lines", per_face, STROKE_MM], lambda: _columns(
        context.rig(*rig.options), lines(per_face, pose_seed("rig", "lines")), 31))


def seen(times_us: np.ndarray, spacing_mm: float) -> tuple[np.ndarray, float, str]:
    """What n fingers tell of the surface: (N, values) numbers, the largest that matter, and what they are.

    Three or more: second differences of neighbouring times, curvature in 1/m. Two: the difference, a slope, which turns
    with the approach. One has no difference to another: what it tells is how deep behind the commanded target, on the face of
    a box about the object, it met the surface, in mm. That takes a known place of the object and an arm whose own delay is small.
    """
    travel_mm = times_us / 1e6 * SPEED_MM_S
    if times_us.shape[1] >= 3:
        return np.diff(travel_mm, 2, axis=1) / spacing_mm**2 * 1e3, 60.0, "curvature, 1/m"
    if times_us.shape[1] == 2:
        return np.diff(travel_mm, axis=1) / spacing_mm, 1.5, "slope"
    return travel_mm - STANDOFF_MM, 40.0, "depth, mm"


def _sets(data, spacing_mm, rng) -> FeatureSets:
    """Sets of TOUCHES touches: what all neighbouring fingers of all of them tell, from the smallest to the largest."""
    values, reach, _ = seen(data["contact_time_us"], spacing_mm)
    groups = [rng.permutation(np.flatnonzero(data["object"] == k)) for k in range(len(plans.OBJECTS))]
    rows = np.concatenate([each[: len(each) // TOUCHES * TOUCHES].reshape(-1, TOUCHES) for each in groups])
    index = data["object"].astype(int)
    # The lines are the same for all objects: it is the line that must not be trained on, whatever lay there.
    poses = pose_numbers(np.column_stack([data["target_mm"], data["approach"], data["lateral"]]))
    return FeatureSets(np.sort(values[rows].reshape(len(rows), -1), 1) / reach, index[rows[:, 0]], poses[rows])


def _seed(context, rig, measured, seed):
    """(accuracy on its own simulation, on the rig's touches, [with shuffled labels in training, on its own simulation])."""
    settings = context.settings
    per_face = -(-settings.pick(40, 120) * TOUCHES // 6)
    train, test = (_sets(_columns(context.simulator, lines(per_face, pose_seed(use, "lines", seed)), pose_seed(use, "noise", seed), rig.model),
                         rig.spacing_mm, np.random.default_rng(seed)) for use in ("training", "testing"))
    recogniser = Trained(SEEDS["XGBoost"](seed), train)
    told = context.rng("shuffled", rig.name, seed)
    return (recogniser.accuracy(test), recogniser.accuracy(_sets(measured, rig.spacing_mm, context.rng("deal", seed))),
            [accuracy(SEEDS["XGBoost"](seed), shuffled(train, told), test) for _ in range(settings.pick(3, 20))])


def _diagnosed(context, rig, measured):
    """What the diagnosis says of the nominal model of this hand: RMSE before and after, effects, or why it says nothing."""
    path = context.settings.out / "measured" / "other_rig.csv"
    unit = lambda vectors: vectors / np.linalg.norm(vectors, axis=1, keepdims=True)
    approach = unit(measured["approach"])
    lateral = unit(measured["lateral"] - np.sum(measured["lateral"] * approach, 1, keepdims=True) * approach)
    touches = touchstone.touches(target_mm=measured["target_mm"], approach=approach, lateral=lateral, standoff_mm=STANDOFF_MM,
                                 speed_mm_s=SPEED_MM_S)
    touchstone.write_measurements(path, [
        touchstone.Row(k, plans.OBJECTS[int(measured["object"][k])], touches[k:k + 1], tuple(measured["contact_time_us"][k]))
        for k in range(len(touches))], force=True)
    try:
        report = context.simulator.diagnose(path, rig.model, seed=1)
    except touchstone.TouchstoneError as error:
        return {"refused": str(error).removeprefix(f"{path}: ")}
    return {"verdict": report.verdict, "rmse_us": report.rmse_us, "final_rmse_us": report.final_rmse_us,
            "effects": [[step.effect, *step.equivalent] for step in report.steps]}


def _result(context, rigs, found):
    kind = context.settings.measured_kind
    asked = len(lines(context.settings.pick(3, 16), 1)) * len(plans.OBJECTS)
    missed = 1 - np.mean([each["touches"] for each in found.values()]) / asked
    result = Result("", "", made_on=[
        (f"each rig: {min(f['touches'] for f in found.values())} to {max(f['touches'] for f in found.values())} {kind} touches of "
         f"{len(plans.OBJECTS)} objects, made once; the emulator hides round tips of 2 mm"),
        f"trained on touches simulated by the nominal model of the same hand, sets of {TOUCHES} touches",
        (f"every hand touches along the same lines whatever lies there; touches of which a finger met nothing are left out "
         f"({missed:.0%} of the {kind} ones)"),
        "intervals are over the simulated touches, the dealing into sets and the training of each seed"])
    chance = 1 / len(plans.OBJECTS)
    above, rows, checks = [], [], {}
    for rig in rigs:
        inside, outside = (estimate_share([each[k] for each in found[rig.name]["accuracy"]]) for k in (0, 1))
        checks[rig.name] = controls.control([each[2] for each in found[rig.name]["accuracy"]], chance)
        if outside.low > chance:
            above.append(rig.name)
        said = found[rig.name]["diagnosis"]
        diagnosis = (said["refused"] if "refused" in said else f"{said['verdict'].replace('_', ' ')}: "
                     + ("; ".join(" or ".join(names) for names in said["effects"]) or "no effect"))
        rmse = "" if "refused" in said else f"{said['rmse_us'] / 1e3:.1f}, then {said['final_rmse_us'] / 1e3:.1f}"
        what = seen(np.zeros((1, rig.fingers)), rig.spacing_mm)[2]
        rows.append([rig.name, what, inside.words(), outside.words(), checks[rig.name].found.words(), rmse, diagnosis])
    result.words = [
        f"{len(above)} of {len(rigs)} other hands, sensors and arms recognise the objects better than chance on {kind} touches, by the same "
        f"command" + (f": {'; '.join(above)}." if above else "."), _finger_words(rigs, found), _control_words(checks)]
    result.tables = [Table("Rigs", ["rig", "feature", "accuracy, own simulation", f"accuracy, {kind}", "labels shuffled", "RMSE before and after, ms",
                                    "diagnosis of the nominal model"], rows,
                     "One finger's times have no differences: how deep it goes behind the face of a box about all objects takes their place, "
                     "which no diagnosis of differences can judge. It depends on where the object lies as the others do not.")]
    result.figures = [_draw(context, rigs, found, kind)]
    result.data = found
    return result


def _control_words(checks) -> str:
    odd = [name for name, each in checks.items() if not each.is_chance]
    low, high = min(each.found.value for each in checks.values()), max(each.found.value for each in checks.values())
    shuffles = next(iter(checks.values())).shuffles
    return (f"With shuffled labels ({shuffles} shuffles a rig) {low:.1%} to {high:.1%} are recognised, chance is 20%: "
            + (f"not what chance gives for {', '.join(odd)}." if odd else "what chance gives, for every rig."))


def _finger_words(rigs, found):
    first = next((rig for rig in rigs if rig.fingers == 1), None)
    if first is None:
        return "No rig of one finger was tried."
    outside = estimate_share([each[1] for each in found[first.name]["accuracy"]])
    if outside.low > 1 / len(plans.OBJECTS):
        return (f"One finger has no descriptor, but how deep it goes behind the face of a box about all objects tells them apart in "
                f"{outside.words()} of the sets. Known is where and how the object lies, not which it is: the lines are the same for all. "
                "Aimed at the surface of the object that lies there, as plans of faces are, one finger would meet it where it was aimed, "
                "and know nothing.")
    return f"One finger has no descriptor, and its depth does not tell the objects apart: {outside.words()}, chance is 20 %."


def _draw(context, rigs, found, kind):
    figure, axes = plt.subplots(figsize=(7, 0.55 * len(rigs) + 1.4))
    y = np.arange(len(rigs))[::-1]
    for column, name, look, shift in ((0, "its own simulation", "virtual", 0.12), (1, kind, "emulated", -0.12)):
        points = [estimate_share([each[column] for each in found[rig.name]["accuracy"]]) for rig in rigs]
        axes.errorbar([100 * p.value for p in points], y + shift, xerr=[[100 * (p.value - p.low) for p in points],
                      [100 * (p.high - p.value) for p in points]], marker="s" if column == 0 else "o", linestyle="", capsize=2,
                      color=figures.colour(look), label=name)
    axes.axvline(100 / len(plans.OBJECTS), color="#7b8794", linestyle=":", linewidth=1)
    axes.annotate("chance", (100 / len(plans.OBJECTS), 1), xycoords=("data", "axes fraction"), ha="center", va="bottom", fontsize=8,
                  color="#7b8794")
    axes.set_yticks(y, [rig.name for rig in rigs])
    axes.set(xlabel="accuracy, %", xlim=(0, 101), ylim=(-0.6, len(rigs) - 0.4))
    axes.legend(loc="lower right", bbox_to_anchor=(1, 1.01), borderaxespad=0, ncols=2, fontsize=8)
    return figures.save(figure, context.figure_path("rigs"), f"Accuracy of recognisers trained on the nominal simulation of each hand, sets of "
                        f"{TOUCHES} touches. Bars: 95 % over seeds.")


EXPERIMENT = Experiment("other_rigs", "Other hands, sensors and arms", "", run, (35, 660))
