"""What a Report is made of."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Any

from . import tabular
from .printable import printable
from .tabular import Tabular
from .v1 import diagnosis_pb2


@dataclasses.dataclass(frozen=True)
class Value:
    """A parameter as it was fitted; the unit is in the name.

    Attributes:
      name: "radius_mm"; with its axis or finger ("offset_mm x") and object where it has them.
      value, std_error: estimate and standard error.
      interval: of 95 %.
    """

    name: str
    value: float
    std_error: float
    interval: tuple[float, float]


@dataclasses.dataclass(frozen=True)
class Quality:
    """How wrong a model is on one kind of measurement, in the unit of its DataReport.

    Attributes:
      rmse: as compare() finds it.
      heldout_rmse: on measurements that the fit did not see.
      lack_of_fit_p: probability of at least this much misfit beyond noise if nothing were missing.
    """

    rmse: float
    heldout_rmse: float
    lack_of_fit_p: float


@dataclasses.dataclass(frozen=True)
class DataReport:
    """What one kind of measurement says.

    Attributes:
      kind: "touches", "photographs", "boards" or "distributions" (touches without poses).
      unit: of every error: "us", "grey" (levels of 255) or "px".
      session: path or name of the measurements.
      emulated: an emulator made them, or some: they measure nothing.
      count: touches or pictures that took part.
      noise_floor: what no model can go below; 0: unknown.
      initial, final: of the given and of the improved model; None if nothing could be compared.
      after_step: after each of Report.steps.
      message: all of it, touchstone.v1.DataReport.
    """

    kind: str
    unit: str
    session: str
    emulated: bool
    count: int
    noise_floor: float
    initial: Quality | None
    after_step: tuple[Quality, ...]
    final: Quality | None
    message: diagnosis_pb2.DataReport = dataclasses.field(repr=False)


@dataclasses.dataclass(frozen=True)
class Step:
    """An effect to add. Its errors are those of DataReport.after_step, at its place in the list.

    Attributes:
      effect: its name.
      equivalent: effects that these data cannot tell from it.
      probability: of it, with its equivalents, among all that could take its place.
      values: its parameters.
      words: where it acts, if not everywhere, and what to doubt.
      shown_by: of a joint diagnosis, the kinds of measurement that show it.
    """

    effect: str
    equivalent: tuple[str, ...]
    probability: float
    values: tuple[Value, ...]
    words: str
    shown_by: tuple[str, ...]

    @staticmethod
    def _draw_all(rows: Sequence[Step], axes: Any) -> None:
        tabular.bars(axes, [row.effect for row in rows], [row.probability for row in rows])
        axes.set(xlim=(0, 1), xlabel="probability among all that could take its place")


@dataclasses.dataclass(frozen=True)
class Detectable:
    """One value of an effect that the model lacks, and how well touches like these show it. Sizes are in the unit of the
    name. report.detectable has to_pandas(), to_arrow() and plot().

    Attributes:
      effect, name: "tip_radius", "radius_mm"; with its axis or finger ("offset_mm l").
      stage: where in the simulation the effect acts.
      std_error: what a fit leaves open; 0: these touches say nothing about the value.
      typical, power_at_typical: what rigs usually show, and the chance that a diagnosis finds it, 0 to 1.
      found_from: smallest size that is found in 80 % of such sets; None: none within the value's bounds.
      rival, correlation: what resembles the effect most ("given:NAME": a value of the model's own), 0 to 1.
      told_from: smallest size from which 80 % of such sets tell it from the rival; None: none does.
      parted_by: what is known to tell the two apart.
    """

    effect: str
    name: str
    stage: str
    std_error: float
    typical: float
    power_at_typical: float
    found_from: float | None
    rival: str
    correlation: float
    told_from: float | None
    parted_by: str

    @staticmethod
    def _draw_all(rows: Sequence[Detectable], axes: Any) -> None:
        tabular.bars(axes, [f"{row.effect} {row.name}" for row in rows], [row.power_at_typical for row in rows])
        axes.axvline(0.8, color="0.5", linestyle=":", linewidth=1)
        axes.set(xlim=(0, 1), xlabel="chance to be found at its typical size (dotted: 0.8)")


@dataclasses.dataclass(frozen=True)
class UncertaintyBudget:
    """Standard uncertainties of a finger's next contact time as a model predicts it, less the mean over its touch, or of a pixel
    of a photograph, or of a corner of a board: root mean squares over touches or pictures. report.uncertainty has to_pandas(), to_arrow() and plot().

    Attributes:
      unit: "us", "grey" or "px".
      object: "": of all.
      touches: how many meet the object with two fingers or more, repeats of a pose count once; or pictures.
      parameters, surface, repeatability: of the model's values, of the surface's departure from its mesh, of the
        noise of one reading.
      reproducibility: of values that differ from session to session; None: not estimated, the model is of one session.
      combined, largest: all of them; and that of the worst finger of the worst touch.
      beyond_measured: touches that meet the object where nothing was measured near.
      source, share: what contributes most ("repeatability", an effect), and its share of the combined variance.
      message: all of it, touchstone.v1.UncertaintyBudget.
    """

    unit: str
    object: str
    touches: int
    parameters: float
    surface: float
    repeatability: float
    reproducibility: float | None
    combined: float
    largest: float
    beyond_measured: int
    source: str
    share: float
    message: diagnosis_pb2.UncertaintyBudget = dataclasses.field(repr=False, compare=False)

    @property
    def contributions(self) -> dict[str, float]:
        """The effects alone and the rest by name, largest first. Correlations between effects are in parameters only."""
        return {one.name: one.std_uncertainty for one in self.message.contributions}

    @staticmethod
    def _draw_all(rows: Sequence[UncertaintyBudget], axes: Any) -> None:
        """Variances stacked: they add, standard uncertainties do not."""
        names = [row.object or "all" for row in rows]
        parts = {"parameters": [row.parameters for row in rows], "surface": [row.surface for row in rows],
                 "repeatability": [row.repeatability for row in rows],
                 "reproducibility": [row.reproducibility or 0.0 for row in rows],
                 "misfit": [row.contributions.get("misfit", 0.0) for row in rows]}
        unit, scale = ("ms", 1000.0) if rows[0].unit == "us" else (rows[0].unit, 1.0)
        left = [0.0] * len(names)
        for name, values in parts.items():
            if not any(values):
                continue
            squares = [(value / scale)**2 for value in values]
            tabular.bars(axes, names, squares, left=left, label=name)
            left = [begin + square for begin, square in zip(left, squares)]
        axes.set_ylim(len(names) - 0.5, -0.5)
        axes.set(xlabel=f"variance of a prediction, {unit}^2")
        axes.legend(loc="lower center", bbox_to_anchor=(0.5, 1), ncol=len(parts), frameon=False)


@dataclasses.dataclass(frozen=True)
class Explanation(Tabular):
    """Why one effect is, or is not, what a model lacks.

    Attributes:
      words: a sentence or two.
      effect, values: its name, and its best values; the interval holds what the data do not exclude.
      gain_nats, probability: of the effect as the only one that is missing.
      rmse, heldout_rmse: with it, in the unit of the report's data.
      taken_over: other effects, and the share of what it does that they do as well.
      message: all of it, touchstone.v1.ExplainedEffect.
    """

    words: str
    effect: str
    values: tuple[Value, ...]
    gain_nats: float
    probability: float
    rmse: float
    heldout_rmse: float
    taken_over: dict[str, float]
    message: diagnosis_pb2.ExplainedEffect = dataclasses.field(repr=False)

    def _table(self) -> dict[str, Any]:
        ends = zip(*(value.interval for value in self.values)) if self.values else ((), ())
        low, high = map(list, ends)
        return {"effect": [self.effect] * len(self.values), "name": [value.name for value in self.values],
                "value": [value.value for value in self.values], "std_error": [value.std_error for value in self.values], "low": low, "high": high}

    def _heading(self) -> str:
        return self.words

    def _draw(self, axes: Any) -> None:
        tabular.intervals(axes, [value.name for value in self.values], [value.value for value in self.values],
                          [value.interval for value in self.values])
        axes.set(title=printable(self.effect), xlabel="value with what the data do not exclude")


@dataclasses.dataclass(frozen=True)
class Versus(Tabular):
    """A second model on the same touches.

    Attributes:
      words: which of the two errs less.
      other: its error, as compare() finds it.
      rmse_difference, interval: the other's RMSE less the given model's, and its 95 % interval over poses.
      other_better: share of the bootstrap's draws in which the other errs less.
      message: all of it, touchstone.v1.ModelComparison.
    """

    words: str
    other: Quality
    rmse_difference: float
    interval: tuple[float, float]
    other_better: float
    message: diagnosis_pb2.ModelComparison = dataclasses.field(repr=False)

    def _table(self) -> dict[str, Any]:
        return {"rmse": [self.other.rmse - self.rmse_difference], "other_rmse": [self.other.rmse], "rmse_difference": [self.rmse_difference],
                "low": [self.interval[0]], "high": [self.interval[1]], "other_better": [self.other_better]}

    def _heading(self) -> str:
        return self.words

    def _draw(self, axes: Any) -> None:
        tabular.intervals(axes, ["the other model"], [self.rmse_difference], [self.interval])
        axes.set(xlabel="RMSE less that of the given model; below 0 the other errs less")


@dataclasses.dataclass(frozen=True)
class ComparedValue:
    """One value of the model in every session. report.sessions.values has to_pandas(), to_arrow() and plot().

    Attributes:
      effect, name, object: "tip_radius", "radius_mm" (with its axis or finger), and the object of values that differ by object.
      change: "unchanged" (the interval holds no change that would move a contact time by more than its noise), "changed" or
        "cannot_say".
      p: of sessions that differ so much by chance, over all effects.
      difference, interval: of the two sessions that differ most, the later one's value less the earlier one's; of 95 %.
      by_session: {place in report.data: (value, standard error)}.
      between_sessions: standard deviation between sessions beyond the standard errors, of three or more; else 0.
      outside: places of the sessions outside the limits that the others let expect.
    """

    effect: str
    name: str
    object: str
    change: str
    p: float
    difference: float
    interval: tuple[float, float]
    by_session: dict[int, tuple[float, float]]
    between_sessions: float
    outside: tuple[int, ...]

    @staticmethod
    def _draw_all(rows: Sequence[ComparedValue], axes: Any) -> None:
        tabular.intervals(axes, [f"{row.effect} {row.name} {row.object}".rstrip() for row in rows],
                          [row.difference for row in rows], [row.interval for row in rows])
        axes.axvline(0, color="0.5", linestyle=":", linewidth=1)
        axes.set(xlabel="change between the sessions that differ most, with its 95 % interval")


@dataclasses.dataclass(frozen=True)
class Sessions:
    """What several sessions of one rig share, and what changed between them.

    Attributes:
      words: what changed, in sentences.
      values: every value of the model, in every session.
      models: {place in report.data: the session's model file}; of sessions with enough touches, none of compare().
      message: all of it, touchstone.v1.SessionComparison, with the poses that sessions share (same_poses).
    """

    words: str
    values: tabular.Rows[ComparedValue]
    models: dict[int, str]
    message: diagnosis_pb2.SessionComparison = dataclasses.field(repr=False)
