"""The figure of a Worth."""

from __future__ import annotations

import os
import pathlib

import matplotlib.pyplot as plt

from .. import figures
from .result import Worth


def draw(worth: Worth, path: str | os.PathLike[str]) -> None:
    """Left: accuracy at each step. Right: learning curves of simulated touches, and what measured ones give. SVG."""
    figure, (left, right) = plt.subplots(1, 2, figsize=(9.6, 4))
    kind, chance = worth.about["kind"], 1 / len(worth.about["objects"])
    shown = [each.accuracy for each in worth.steps] + [worth.own]
    names = [f"{each.rung.name}\n{each.rung.rmse_us / 1e3:.1f} ms" for each in worth.steps] + [f"{kind}\ntouches"]
    for k, each in enumerate(shown):
        left.errorbar([k], [100 * each.value], [[100 * (each.value - each.low)], [100 * (each.high - each.value)]], marker="o", capsize=3,
                      color=figures.colour("measured" if k == len(shown) - 1 else "virtual"))
    left.set_xticks(range(len(names)), names, rotation=25, ha="right", fontsize=8)
    left.set(ylabel=f"knows of {kind} sets, %", title="Trained on", xlim=(-0.5, len(names) - 0.5))
    for place, (name, curve) in enumerate(worth.curves.items()):
        sizes, look = [size for size, _ in curve], figures.colour(("noisy", "virtual")[place])
        right.plot(sizes, [100 * each.value for _, each in curve], marker="os"[place], color=look, label=f"simulated, {name}")
        right.fill_between(sizes, [100 * each.low for _, each in curve], [100 * each.high for _, each in curve], color=look, alpha=0.2, linewidth=0)
    own = worth.own
    right.errorbar([worth.own_touches], [100 * own.value], [[100 * (own.value - own.low)], [100 * (own.high - own.value)]], marker="D", capsize=3,
                   color=figures.colour("measured"), label=kind, linestyle="")
    right.set(xscale="log", xlabel="touches in training", title="How many touches it takes")
    ticks = sorted({size for curve in worth.curves.values() for size, _ in curve})
    right.set_xticks(ticks, [f"{size:,}" for size in ticks], rotation=25, fontsize=8)
    right.minorticks_off()
    low = min(each.low for each in [*shown, *(point for curve in worth.curves.values() for _, point in curve)])
    for axes in (left, right):
        axes.set_ylim(100 * max(0, min(low, chance) - 0.05), 102)
        axes.axhline(100 * chance, color="#7b8794", linestyle=":", linewidth=1)
        axes.annotate("chance", (1, 100 * chance), xycoords=("axes fraction", "data"), ha="right", va="bottom", fontsize=8, color="#7b8794")
    right.legend(loc="upper center", bbox_to_anchor=(0.5, -0.25), ncol=3, fontsize=8)
    target = pathlib.Path(path)
    figure.savefig(target, metadata={"Date": None} if target.suffix == ".svg" else None)
    plt.close(figure)
