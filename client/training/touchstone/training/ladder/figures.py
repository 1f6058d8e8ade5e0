"""Figures of a ladder of models."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import matplotlib.pyplot as plt
import numpy as np

from .. import figures, plans
from ..context import Context
from ..result import Estimate, Figure
from .words import Climb, verdict


def draw_ladder(context: Context, climbs: Sequence[Climb], alone: Mapping[str, tuple[float, Estimate]]) -> Figure:
    """Accuracy at each rung of each rig; and of single effects (RMSE in us, accuracy lost)."""
    figure, all_axes = plt.subplots(1, len(climbs) + 1, figsize=(3.5 * (len(climbs) + 1), 4.2))
    kind = context.settings.measured_kind
    for axes, climb in zip(all_axes, climbs):
        x = np.arange(len(climb.rungs))
        for key, name, look in (("rig", kind, "emulated"), ("simulated", "its own simulation", "virtual")):
            shown = climb.shown(key)
            axes.errorbar(x, [100 * p.value for p in shown], [[100 * (p.value - p.low) for p in shown], [100 * (p.high - p.value) for p in shown]],
                          marker="o" if key == "rig" else "s", color=figures.colour(look), label=name, capsize=2)
        for k in range(1, len(climb.rungs)):
            if verdict(climb.step(k)) == "loses":
                axes.annotate("harms", (k, 100 * climb.shown("rig")[k].value), xytext=(0, -16), textcoords="offset points", ha="center", fontsize=8)
        axes.axhline(100 / len(plans.OBJECTS), color="#7b8794", linestyle=":", linewidth=1)
        axes.annotate("chance", (1, 100 / len(plans.OBJECTS)), xycoords=("axes fraction", "data"), ha="right", va="bottom", fontsize=8,
                      color="#7b8794")
        axes.set(ylim=(0, 100), title=f"{climb.hidden.name}: {100 * climb.gain().value:+.1f} points")
        axes.set_xticks(x, [f"{r.name}\n{r.rmse_us / 1e3:.1f} ms" for r in climb.rungs], rotation=25, ha="right", fontsize=8)
    all_axes[0].set_ylabel("accuracy, %")
    all_axes[0].legend(loc="lower right", fontsize=8)
    right = all_axes[-1]
    for place, (name, (rmse, loss)) in enumerate(alone.items()):
        right.errorbar([rmse / 1e3], [100 * loss.value], [[100 * (loss.value - loss.low)], [100 * (loss.high - loss.value)]],
                       marker="osD^"[place], color=figures.colour(name, place), capsize=2, linestyle="", label=name)
    right.axhline(0, color="#7b8794", linewidth=1)
    right.set(xlabel="RMSE, ms", ylabel="accuracy lost, points", title="One effect alone, simulated", xlim=(0, None))
    right.legend(loc="best", fontsize=8)
    return figures.save(figure, context.figure_path("ladder"), "Accuracy of recognisers trained by each model of three ladders, with the "
                        "model's RMSE below it. Right: what single effects cost that the model lacks. Bars: 95 % over seeds.")


def draw_worth(context: Context, climb: Climb, worth: Mapping[str, Sequence[Mapping]]) -> Figure:
    """What simulated touches save at each rung, {quantity: [{"gain": (value, low, high)}]}, and rank correlations."""
    rungs, ranks = climb.rungs, climb.ranks()
    figure, (left, right) = plt.subplots(1, 2, figsize=(9.6, 3.6))
    x = np.arange(len(rungs))
    for shift, (quantity, each) in zip((-0.08, 0.08), worth.items()):
        gains = np.array([w["gain"] for w in each])
        left.errorbar(x + shift, gains[:, 0], np.abs(gains[:, 1:].T - gains[:, 0]), marker="o" if quantity == "accuracy" else "s",
                      linestyle="", capsize=2, color=figures.colour("touch" if quantity == "accuracy" else "image"), label=quantity)
    left.axhline(1, color="#7b8794", linewidth=1)
    left.set(ylabel="effective / measured touches", title="What simulation saves", yscale="log")
    left.yaxis.set_major_locator(plt.FixedLocator([1, 1.5, 2, 3, 5, 7, 10, 15, 20]))
    left.yaxis.set_major_formatter(plt.FormatStrFormatter("%g"))
    left.yaxis.set_minor_formatter(plt.NullFormatter())
    left.legend(loc="upper left")
    known = [(k, rank) for k, rank in enumerate(ranks) if rank is not None]
    right.errorbar([k for k, _ in known], [rank.value for _, rank in known],
                   [[rank.value - rank.low for _, rank in known], [rank.high - rank.value for _, rank in known]],
                   marker="o", linestyle="", capsize=2, color=figures.colour("both"))
    right.axhline(0, color="#7b8794", linewidth=1)
    right.set(ylabel="Spearman's rank correlation", title="Ten recognisers, simulated and tested", ylim=(-1.05, 1.05))
    for axes in (left, right):
        axes.set_xticks(x, [r.name for r in rungs], rotation=25, ha="right", fontsize=8)
        axes.set_xlim(-0.4, len(rungs) - 0.6)
    return figures.save(figure, context.figure_path("worth"), "Left: how many measurements would give the same certainty, per measurement "
                        "made, with bootstrap intervals. Right: does simulation put ten recognisers in the right order?")
