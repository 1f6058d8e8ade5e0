"""The look of all figures: one colour a thing, intervals as bands, SVG whose bytes depend on the numbers alone."""

from __future__ import annotations

import pathlib
from collections.abc import Mapping, Sequence

import matplotlib

matplotlib.use("svg")
import matplotlib.pyplot as plt
import numpy as np

from touchstone.whole_file import whole_file

from .result import Estimate, Figure

# Okabe and Ito: the colour-blind can tell them apart. One colour a thing, in every figure.
COLOURS = {
    "touch": "#d55e00", "image": "#0072b2", "both": "#009e73",
    "XGBoost": "#d55e00", "SVM": "#0072b2", "naive Bayes": "#009e73",
    "ideal": "#0072b2", "noisy": "#e69f00", "measured": "#d55e00", "emulated": "#d55e00", "virtual": "#0072b2",
    "information": "#009e73", "random": "#0072b2", "fixed": "#e69f00",
    "lat00": "#e69f00", "lat05": "#56b4e9", "lat10": "#009e73", "lat15": "#0072b2", "lat20": "#cc79a7",
}
_OTHERS = ["#d55e00", "#0072b2", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#000000", "#999933", "#882255", "#44aa99"]
_MARKERS = "osD^vPX*<>"
_INK, _GREY, _FAINT = "#1f2933", "#7b8794", "#e4e7eb"

plt.rcParams.update({
    "svg.hashsalt": "touchstone", "svg.fonttype": "none", "font.family": "DejaVu Sans", "font.size": 10,
    "axes.edgecolor": _GREY, "axes.labelcolor": _INK, "text.color": _INK, "xtick.color": _GREY, "ytick.color": _GREY,
    "axes.spines.top": False, "axes.spines.right": False, "axes.grid": True, "grid.color": _FAINT, "axes.axisbelow": True,
    "legend.frameon": False, "figure.constrained_layout.use": True,
})


def colour(name: str, place: int = 0) -> str:
    """The colour of a thing; by its place among others where it has none of its own."""
    return COLOURS.get(name, _OTHERS[place % len(_OTHERS)])


def save(figure: plt.Figure, path: pathlib.Path, caption: str) -> Figure:
    """Writes and closes it. `path`: of Context.figure_path()."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with whole_file(path, "wb") as file:
        figure.savefig(file, format="svg", metadata={"Date": None})
    plt.close(figure)
    return Figure(f"{path.parent.name}/{path.name}", caption)


def curves(path: pathlib.Path, caption: str, x: Sequence[float], lines: Mapping[str, Sequence[Estimate]], *,
           x_label: str, y_label: str = "accuracy", chance: float | None = None,
           marks: Mapping[str, float] | None = None) -> Figure:
    """Lines with their 95 % bands over x; `chance` as a dotted line, `marks` as named dashed ones."""
    figure, axes = plt.subplots(figsize=(7, 4))
    scale = 100 if y_label == "accuracy" else 1  # shares are shown in per cent, as in all words and tables
    for place, (name, points) in enumerate(lines.items()):
        look = colour(name, place)
        axes.plot(x, [scale * p.value for p in points], color=look, marker=_MARKERS[place % len(_MARKERS)], markersize=4, label=name)
        axes.fill_between(x, [scale * p.low for p in points], [scale * p.high for p in points], color=look, alpha=0.2, linewidth=0)
    for name, height in (marks or {}).items():
        axes.axhline(scale * height, color=_INK, linestyle="--", linewidth=1)
        axes.annotate(name, (1, scale * height), xycoords=("axes fraction", "data"), ha="right", va="bottom", fontsize=8)
    if chance is not None:
        axes.axhline(scale * chance, color=_GREY, linestyle=":", linewidth=1)
        axes.annotate("chance", (1, scale * chance), xycoords=("axes fraction", "data"), ha="right", va="bottom", fontsize=8, color=_GREY)
    axes.set_xlabel(x_label)
    axes.set_ylabel("accuracy, %" if scale == 100 else y_label)
    if len(x) <= 6:
        axes.set_xticks(x)
    if y_label == "accuracy":  # of a band beyond 100 % nothing can come
        axes.set_ylim(top=min(axes.get_ylim()[1], 102))
    if len(lines) > 1:
        axes.legend(loc="best", frameon=True, framealpha=0.8, edgecolor="none")  # a band may lie below
    return save(figure, path, caption)


def confusion(path: pathlib.Path, caption: str, names: Sequence[str], matrices: Mapping[str, np.ndarray]) -> Figure:
    """Confusion matrices side by side: shares of each true object, rows true, columns recognised."""
    figure, all_axes = plt.subplots(1, len(matrices), figsize=(3.4 * len(matrices), 3.4), squeeze=False)
    for axes, (title, matrix) in zip(all_axes[0], matrices.items()):
        shares = matrix / np.maximum(matrix.sum(1, keepdims=True), 1)
        axes.imshow(shares, cmap="Blues", vmin=0, vmax=1)
        for (row, column), share in np.ndenumerate(shares):
            if share >= 0.005:
                axes.text(column, row, f"{100 * share:.0f}", ha="center", va="center", fontsize=8,
                          color="white" if share > 0.6 else _INK)
        axes.set(title=title, xticks=range(len(names)), yticks=range(len(names)), xlabel="recognised")
        axes.set_xticklabels(names, rotation=45, ha="right")
        axes.set_yticklabels(names)
        axes.grid(False)
    all_axes[0][0].set_ylabel("true")
    return save(figure, path, caption)
