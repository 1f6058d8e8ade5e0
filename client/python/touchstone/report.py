"""What compare(), diagnose(), propose(), check() and explain() answer."""

from __future__ import annotations

import dataclasses
import json
import math
import os
from collections.abc import Sequence
from typing import Any

from google.protobuf import json_format

from .errors import InvalidRequest
from .measurements import Row
from .plans import Touches
from .printable import printable
from .v1 import diagnosis_pb2
from .whole_file import whole_file


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
    message: diagnosis_pb2.DataReport


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


@dataclasses.dataclass(frozen=True)
class Detectable:
    """One value of an effect that the model lacks, and how well touches like these show it. Sizes are in the unit of the
    name. pandas.DataFrame(report.detectable) is a table of them.

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


@dataclasses.dataclass(frozen=True)
class Explanation:
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
    message: diagnosis_pb2.ExplainedEffect


@dataclasses.dataclass(frozen=True)
class Versus:
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
    message: diagnosis_pb2.ModelComparison


class Report:
    """How wrong a model is, and, of diagnose(), why and what to add. print(report) says it in a paragraph.

    Attributes:
      message: all of it, touchstone.v1.Report; to_dict() has it in plain types, as `touchstone diagnose --json` writes it.
    """

    def __init__(self, message: diagnosis_pb2.Report):
        self.message = message

    @property
    def verdict(self) -> str:
        """"adequate", "wrong_values", "missing_effects", "unexplained", "check_data", "too_little_data"; "" of compare()."""
        name = diagnosis_pb2.Report.Verdict.Name(self.message.verdict).lower()
        return "" if name == "verdict_unspecified" else name

    @property
    def p_nothing_missing(self) -> float | None:
        """The chance that data of the given model look at least as bad, over all that was tried; None: not assessed."""
        return self.message.p_nothing_missing if self.message.HasField("p_nothing_missing") else None

    @property
    def summary(self) -> str:
        return self.message.summary

    @property
    def warnings(self) -> tuple[str, ...]:
        return tuple(self.message.warnings)

    @property
    def data(self) -> tuple[DataReport, ...]:
        """One entry per kind of measurement, and per session where there are several."""
        return tuple(map(_data, self.message.data))

    def of(self, kind: str) -> DataReport | None:
        """The first entry of "touches", "photographs", "boards" or "distributions"; None: there is none."""
        return next((data for data in self.data if data.kind == kind), None)

    @property
    def rmse_us(self) -> float:
        """Of the given model on touches; NaN without touches."""
        return self._rmse("touches", "initial")

    @property
    def rmse_grey(self) -> float:
        """Of the given model on photographs, grey levels of 255; NaN without photographs."""
        return self._rmse("photographs", "initial")

    @property
    def final_rmse_us(self) -> float:
        """Of the improved model on touches; NaN without touches."""
        return self._rmse("touches", "final")

    @property
    def final_rmse_grey(self) -> float:
        """Of the improved model on photographs; NaN without photographs."""
        return self._rmse("photographs", "final")

    @property
    def noise_floor_us(self) -> float:
        """What no model of touches can go below; NaN without touches."""
        data = self.of("touches") or self.of("distributions")
        return data.noise_floor if data else math.nan

    @property
    def noise_floor_grey(self) -> float:
        """What no model of photographs can go below; NaN without photographs."""
        data = self.of("photographs")
        return data.noise_floor if data else math.nan

    @property
    def steps(self) -> tuple[Step, ...]:
        """The effects to add, in this order."""
        return tuple(
            Step(step.effect, tuple(step.equivalent), step.probability, tuple(map(_value, step.parameters)), step.words,
                 tuple(map(_kind, step.shown_by)))
            for step in self.message.steps
        )

    def _rmse(self, kind: str, when: str) -> float:
        data = self.of(kind)
        quality = getattr(data, when) if data else None
        return quality.rmse if quality else math.nan

    @property
    def improved_model(self) -> str:
        """The model file with all steps and refitted values, to be given as `model=`; "" if nothing changed."""
        return self.message.improved_model_yaml

    @property
    def suggested_model(self) -> str:
        """The improved model with the formula or curve for what no effect explains, in its place; "" if there is none."""
        return next((data.unexplained.model_yaml for data in self.message.data if data.unexplained.model_yaml), "")

    @property
    def next_touches(self) -> Sequence[Row]:
        """The touches to make next, as read_plan() gives those of a file."""
        return [
            Row(number, proposed.object, Touches.from_messages([proposed.touch]))
            for number, proposed in enumerate(one for one in self.message.next if one.HasField("touch"))
        ]

    @property
    def detectable(self) -> tuple[Detectable, ...]:
        """What touches like these can show, one entry per value of every effect that the model lacks."""
        return tuple(map(_detectable, self.message.detectable))

    @property
    def explained(self) -> Explanation | None:
        """Of explain()."""
        if not self.message.HasField("explained"):
            return None
        e = self.message.explained
        return Explanation(e.words, e.effect, tuple(map(_value, e.parameters)), e.gain_nats, e.probability, e.rmse,
                         e.heldout_rmse, {other.effect: other.share for other in e.taken_over}, e)

    @property
    def versus(self) -> Versus | None:
        """Of compare() with another model."""
        for data in self.message.data:
            if data.HasField("versus"):
                v = data.versus
                return Versus(v.words, _quality(v.other), v.rmse_difference, (v.lower, v.upper), v.other_better, v)
        return None

    def to_dict(self) -> dict[str, Any]:
        """Plain types by the names of touchstone.v1.Report, those that are empty or 0 among them; without the table of touches,
        which is for a page and stays in `message`."""
        shown = diagnosis_pb2.Report()
        shown.CopyFrom(self.message)
        for data in shown.data:
            data.ClearField("touch_table")
        try:
            return json_format.MessageToDict(shown, preserving_proto_field_name=True, always_print_fields_with_no_presence=True)
        except TypeError:  # protobuf before 5
            old_name: dict[str, Any] = {"including_default_value_fields": True}
            return json_format.MessageToDict(shown, preserving_proto_field_name=True, **old_name)

    def save(self, path: str | os.PathLike[str]) -> None:
        """Writes it as JSON."""
        _write(path, json.dumps(self.to_dict(), indent=1) + "\n")

    def save_model(self, path: str | os.PathLike[str]) -> None:
        """Writes the improved model as a model file."""
        if not self.improved_model:
            raise InvalidRequest("The report has no improved model: nothing is to be added or changed.")
        _write(path, self.improved_model)

    def __str__(self) -> str:
        return printable(self.summary)

    def __repr__(self) -> str:
        effects = ", ".join(step.effect for step in self.message.steps)
        return printable(f"Report({self.verdict or 'compared'}{': ' + effects if effects else ''})")


def _kind(number: int) -> str:
    return diagnosis_pb2.DataReport.Kind.Name(number).lower()


def _quality(message: diagnosis_pb2.Quality) -> Quality:
    return Quality(message.rmse, message.heldout_rmse, message.lack_of_fit_p)


def _data(message: diagnosis_pb2.DataReport) -> DataReport:
    return DataReport(
        _kind(message.kind), message.unit, message.session, message.emulated, message.count, message.noise_floor,
        _quality(message.initial) if message.HasField("initial") else None, tuple(map(_quality, message.after_step)),
        _quality(message.final) if message.HasField("final") else None, message,
    )


def _detectable(d: diagnosis_pb2.DetectableEffect) -> Detectable:
    return Detectable(
        d.effect, " ".join(part for part in (d.parameter, d.finger) if part), d.stage, d.std_error, d.typical,
        d.power_at_typical, d.found_from if d.HasField("found_from") else None, d.rival, d.correlation,
        d.told_from if d.HasField("told_from") else None, d.parted_by,
    )


def _value(p: diagnosis_pb2.ParameterValue) -> Value:
    name = " ".join(part for part in (p.name, p.finger, p.object) if part)
    return Value(name, p.value, p.std_error, (p.lower, p.upper))


def _write(path: str | os.PathLike[str], text: str) -> None:
    with whole_file(path, encoding="utf-8") as file:
        file.write(text)
