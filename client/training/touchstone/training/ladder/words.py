"""What a report says of ladders of models: of each rig, of each step, and of all rigs together."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence

import numpy as np

from ..result import Estimate, Table
from ..statistics import estimate, estimate_share
from . import HiddenRig, Rung

MARGIN = 0.03  # of accuracy: a loss whose interval lies below it is called none


@dataclasses.dataclass(frozen=True)
class Climb:
    """Attributes:
      hidden: the rig.
      rungs: the models that the diagnosis of its touches gave.
      diagnosed, tested: how many touches.
      accuracy: (seeds, rungs) on the "rig"'s touches, on "simulated" ones of each rung, on the rig's commanded touches simulated
        "again"; and "ranks", the rank correlation of ten recognisers, NaN where it was not asked.
    """

    hidden: HiddenRig
    rungs: list[Rung]
    diagnosed: int
    tested: int
    accuracy: dict[str, np.ndarray]

    def shown(self, key: str) -> list[Estimate]:
        """A mean a rung."""
        return [estimate_share(column) for column in self.accuracy[key].T]

    def ranks(self) -> list[Estimate | None]:
        """A mean a rung; None where it was not asked. Student's interval of a few seeds may leave the range."""
        means = [estimate(column[np.isfinite(column)]) if np.isfinite(column).any() else None for column in self.accuracy["ranks"].T]
        return [mean and Estimate(mean.value, max(mean.low, -1.0), min(mean.high, 1.0)) for mean in means]

    def step(self, k: int) -> Estimate:
        """What rung k recognises more than the one before it, of the rig's touches."""
        return estimate(self.accuracy["rig"][:, k] - self.accuracy["rig"][:, k - 1])

    def judgement(self, k: int) -> str:
        """What rung k does on touches that no model has seen."""
        said = {"gains": "recognises more", "loses": "HARMS: recognises less"}.get(verdict(self.step(k)), "no difference can be told")
        worse = self.rungs[k].rmse_us > self.rungs[k - 1].rmse_us
        return said + (", and the RMSE rises" if worse else "")

    def gain(self) -> Estimate:
        """Of the last rung over the nominal model."""
        return estimate(self.accuracy["rig"][:, -1] - self.accuracy["rig"][:, 0])


def words(climbs: Sequence[Climb], alone, worth, kind: str, more: int) -> list[str]:
    """A paragraph each; the first is the answer."""
    first = climbs[0]
    said = [_spread_words(climbs, kind)]
    for climb in climbs:
        said.append(_answer(climb, kind))
        said += _step_words(climb)
    return [*said, _gap_words(first, kind), _rank_words(first), _alone_words(alone), _worth_words(first, worth, kind, more)]


def points(e: Estimate) -> str:
    return f"{100 * e.value:+.1f} points ({100 * e.low:+.1f} to {100 * e.high:+.1f})"


def verdict(e: Estimate) -> str:
    return "gains" if e.low > 0 else "loses" if e.high < 0 else "cannot be told from"


def _spread_words(climbs, kind) -> str:
    gains = [100 * climb.gain().value for climb in climbs]
    harms = [f"{climb.rungs[k].name[2:]} of the {climb.hidden.name}" for climb in climbs for k in range(1, len(climb.rungs))
             if climb.judgement(k) != "recognises more" and ("HARMS" in climb.judgement(k) or "rises" in climb.judgement(k))]
    each = ", ".join(f"{gain:+.1f}" for gain in gains)
    return (f"On the {kind} touches of {len(climbs)} rigs with other hidden physics the last model recognises {each} points of the sets more than "
            f"the nominal one: {np.mean(gains):+.1f} on average, and {np.ptp(gains):.1f} points between the largest and the smallest. "
            f"Steps that harm on touches which no model has seen: {', '.join(harms) or 'none'}.")


def _answer(climb, kind):
    rungs, accuracy = climb.rungs, climb.shown("rig")
    name = climb.hidden.name[0].upper() + climb.hidden.name[1:]
    if len(rungs) == 1:
        return f"{name}: the diagnosis found nothing to add to the nominal model (RMSE {rungs[0].rmse_us / 1e3:.1f} ms): there is no ladder."
    change = {"gains": "more of the sets are recognised", "loses": "fewer of the sets are recognised",
              "cannot be told from": "no difference in recognition can be told"}[verdict(climb.gain())]
    return (f"{name}: {change} with the last model of the ladder, which is what `touchstone diagnose` saves, than with the nominal one on {kind} "
            f"touches: {accuracy[0].words()} to {accuracy[-1].words()}, {points(climb.gain())}, while the RMSE went from "
            f"{rungs[0].rmse_us / 1e3:.1f} to {rungs[-1].rmse_us / 1e3:.1f} ms.")


def _step_words(climb):
    for k in range(1, len(climb.rungs)):
        before, rung = climb.rungs[k - 1 : k + 1]
        yield (f"{climb.hidden.name}, {rung.name[2:]}: RMSE {before.rmse_us / 1e3:.1f} to {rung.rmse_us / 1e3:.1f} ms; "
               f"{climb.judgement(k)}, {points(climb.step(k))}.")


def _gap_words(climb, kind):
    accuracy = climb.accuracy
    poses = estimate(accuracy["simulated"][:, -1] - accuracy["again"][:, -1])
    model = estimate(accuracy["again"][:, -1] - accuracy["rig"][:, -1])
    told = lambda e: "" if e.low > 0 or e.high < 0 else ", which cannot be told from none"
    return (f"What is left on the {climb.hidden.name} between the last model's own simulation and the {kind} touches is in part the poses that the "
            f"rig was given, {points(poses)}{told(poses)}, and in part what the model still lacks, {points(model)}{told(model)}: "
            "the same commanded touches were simulated again.")


def _rank_words(climb):
    ranks = climb.accuracy["ranks"]
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
    return (f"A large residual that does not matter: {a}, RMSE {large / 1e3:.0f} ms, costs {points(losses[a][1])}. A small one "
            f"that does: {b}, RMSE {small / 1e3:.0f} ms, costs {points(losses[b][1])}. Of two with the same RMSE ({losses[tilt][0] / 1e3:.1f} and "
            f"{losses[longer][0] / 1e3:.1f} ms), the {tilt} costs {points(losses[tilt][1])}, the {longer} {points(losses[longer][1])}: a slope "
            "that is added to every touch cancels in the curvature, which these recognisers see; what one finger adds does not.")


def _worth_words(climb, worth, kind, more):
    first, last = (worth["mean curvature"][k] for k in (0, -1))
    separate = last["gain"][1] > first["gain"][2]
    return (f"On the {climb.hidden.name}, with {more} simulated touches per {kind} one, the mean curvature is as certain as from "
            f"{last['gain'][0]:.2f} ({last['gain'][1]:.2f} to {last['gain'][2]:.2f}) times as many {kind} touches by the last model, "
            f"{first['gain'][0]:.2f} ({first['gain'][1]:.2f} to {first['gain'][2]:.2f}) by the nominal one: "
            + ("the better model saves more." if separate else "the intervals overlap, so the models cannot be told apart in this.")
            + " For the accuracy of one recogniser it is " + " and ".join(
                f"{w['gain'][0]:.2f} ({w['gain'][1]:.2f} to {w['gain'][2]:.2f})" for w in (worth["accuracy"][-1], worth["accuracy"][0]))
            + " times. At most it can be about as many times as there are touches of both kinds per measured one.")


def ladder_table(climb: Climb, kind: str) -> Table:
    rig, simulated, again, ranks = climb.shown("rig"), climb.shown("simulated"), climb.shown("again"), climb.ranks()
    rows = []
    for k, (rung, rank) in enumerate(zip(climb.rungs, ranks)):
        rows.append([rung.name, f"{rung.rmse_us / 1e3:.1f}", rig[k].words(), simulated[k].words(), again[k].words(),
                     "" if k == 0 else points(climb.step(k)), "" if k == 0 else climb.judgement(k),
                     "" if rank is None else rank.words(percent=False)])
    columns = ["model", "RMSE, ms", f"accuracy, {kind}", "accuracy, its own simulation", "the same touches simulated", "step", "on unseen touches",
               "rank correlation"]
    ranked = any(rank is not None for rank in ranks)
    return Table(f"The ladder of the {climb.hidden.name}", columns if ranked else columns[:-1], rows if ranked else [row[:-1] for row in rows],
                 f"It hides {' '.join(climb.hidden.hidden)}. XGBoost trained on each model. RMSE of held-out touches by compare()."
                 + (f" Rank correlation: Spearman's, of ten recognisers' accuracies in simulation and on {kind} touches." if ranked else ""))


def alone_table(alone: Mapping[str, tuple[float, list[float]]]) -> Table:
    return Table("Effects alone, planted in simulated touches", ["effect", "RMSE, ms", "loss of accuracy"],
                 [[name, f"{rmse / 1e3:.1f}", points(estimate(loss))] for name, (rmse, loss) in alone.items()],
                 "Trained on the nominal model. The first two were made to have the same RMSE.")


def worth_table(rungs: Sequence[Rung], worth, more: int) -> Table:
    count = lambda x: "never" if np.isinf(x) else f"{x:.1f}"
    rows = [[quantity, rung.name, f"{w['gain'][0]:.2f} ({w['gain'][1]:.2f} to {w['gain'][2]:.2f})",
             f"{count(w['worth'][0])} ({count(w['worth'][2])} to {count(w['worth'][1])})", f"{w['covers']:.1%}"]
            for quantity, each in worth.items() for rung, w in zip(rungs, each)]
    return Table("What simulation saves", ["mean of", "predicted by", "effective / measured touches", "one measured touch is worth",
                                           "intervals that cover"], rows,
                 f"Prediction-powered inference (PPI++), {more} simulated touches per measured one; intervals by bootstrap over the "
                 "touches. Worth: simulated touches that save one measured one; never: they save none. The last column checks the "
                 "method: how many of 400 intervals of 95 % from half as many touches, drawn from the rig's with replacement, cover "
                 "the mean of the rig's. Both populations are random poses of one plan in which every finger meets the object.")


