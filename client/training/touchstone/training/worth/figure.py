"""The figure of a Worth."""

from __future__ import annotations

import os
import pathlib
from typing import Any

import matplotlib.pyplot as plt

from touchstone.whole_file import whole_file

from .. import figures
from ..result import Estimate
from .result import Worth


def draw(worth: Worth, path: str | os.PathLike[str]) -> None:
    """Left: accuracy at each step. Right: learning curves of simulated touches, and what measured ones give."""
    figure, (left, right) = plt.subplots(1, 2, figsize=(9.6, 4))
    draw_steps(worth, left)
    draw_curves(worth, right)
    shown = [*(each.accuracy for each in worth.steps), worth.own, *(point for curve in worth.curves.values() for _, point in curve)]
    for axes in (left, right):
        axes.set_ylim(100 * max(0, min(_chance(worth), *(each.low for each in shown)) - 0.05), 102)
    target = pathlib.Path(path)
    with whole_file(target, "wb") as file:
        figure.savefig(file, format=target.suffix[1:] or None, metadata={"Date": None} if target.suffix == ".svg" else None)
    plt.close(figure)


def draw_steps(worth: Worth, axes: Any) -> None:
    kind = worth.about["kind"]
    for k, each in enumerate(worth.steps):
        _point(axes, k, each.accuracy, figures.colour("virtual"))
    _point(axes, len(worth.steps), worth.own, figures.colour("measured"))
    names = [f"{each.rung.name}\n{each.rung.rmse_us / 1e3:.1f} ms" for each in worth.steps] + [f"{kind}\ntouches"]
    axes.set_xticks(range(len(names)), names, rotation=25, ha="right", fontsize=8)
    axes.set(ylabel=f"knows of {kind} sets, %", xlabel="trained on", xlim=(-0.5, len(names) - 0.5))
    _mark_chance(worth, axes)


def draw_curves(worth: Worth, axes: Any) -> None:
    for place, (name, curve) in enumerate(worth.curves.items()):
        sizes, look = [size for size, _ in curve], figures.colour(("noisy", "virtual")[place])
        axes.plot(sizes, [100 * each.value for _, each in curve], marker="os"[place], color=look, label=f"simulated, {name}")
        axes.fill_between(sizes, [100 * each.low for _, each in curve], [100 * each.high for _, each in curve], color=look, alpha=0.2, linewidth=0)
    _point(axes, worth.own_touches, worth.own, figures.colour("measured"), marker="D", label=worth.about["kind"])
    ticks = sorted({size for curve in worth.curves.values() for size, _ in curve})
    axes.set(xscale="log", xlabel="touches in training")
    axes.set_xticks(ticks, [f"{size:,}" for size in ticks], rotation=25, fontsize=8)
    axes.minorticks_off()
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.25), ncol=3, fontsize=8)
    _mark_chance(worth, axes)


def _chance(worth: Worth) -> float:
    return 1 / len(worth.about["objects"])


def _point(axes: Any, x: float, share: Estimate, colour: str, **look: Any) -> None:
    axes.errorbar([x], [100 * share.value], [[100 * (share.value - share.low)], [100 * (share.high - share.value)]], capsize=3, color=colour,
                  linestyle="", **{"marker": "o", **look})


def _mark_chance(worth: Worth, axes: Any) -> None:
    axes.axhline(100 * _chance(worth), color="#7b8794", linestyle=":", linewidth=1)
    axes.annotate("chance", (1, 100 * _chance(worth)), xycoords=("axes fraction", "data"), ha="right", va="bottom", fontsize=8, color="#7b8794")
