"""What compare(), diagnose(), propose(), check() and explain() answer."""

from __future__ import annotations

import json
import math
import os
from collections.abc import Mapping, Sequence
from typing import Any

from google.protobuf import json_format

from . import tabular
from .errors import InvalidRequest
from .measurements import Row
from .plans import Touches
from .printable import printable
from .report_parts import ComparedValue, DataReport, Detectable, Explanation, Quality, Sessions, Step, UncertaintyBudget, Value, Versus
from .spoken import as_python
from .tabular import Rows, Tabular
from .v1 import diagnosis_pb2
from .whole_file import check_target, whole_file


class Report(Tabular):
    """How wrong a model is, and, of diagnose(), why and what to add. print(report) says it in a paragraph.

    As a table and a figure: the error of each model on the way to the improved one, of check() what the plan can find.

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
        """The answer in a paragraph, as print(report) gives it."""
        return as_python(self.message.summary)

    @property
    def warnings(self) -> tuple[str, ...]:
        """What to doubt, a sentence each."""
        return tuple(map(as_python, self.message.warnings))

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
    def steps(self) -> Rows[Step]:
        """The effects to add, in this order."""
        return Rows(
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
    def detectable(self) -> Rows[Detectable]:
        """What touches like these can show, one entry per value of every effect that the model lacks."""
        return Rows(map(_detectable, self.message.detectable))

    @property
    def uncertainty(self) -> Rows[UncertaintyBudget]:
        """How well the model that the report ends with predicts measurements like these, an entry per object and one of all
        (object ""): of diagnose(), but for touches and photographs together, and of uncertainty()."""
        unit = self.message.data[0].unit if self.message.data else ""
        return Rows(_budget(budget, unit) for budget in self.message.uncertainty)

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

    @property
    def sessions(self) -> Sessions | None:
        """Of several sessions."""
        if not self.message.HasField("sessions"):
            return None
        s = self.message.sessions
        values = Rows(_compared(effect, value) for effect in s.effects for value in effect.values)
        return Sessions(s.words, values, {place: text for place, text in enumerate(s.model_yaml) if text}, s)

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

    def save(self, path: str | os.PathLike[str], *, force: bool = False) -> None:
        """Writes it as JSON; force: replace a file that is there, which is else an InvalidRequest."""
        _write(path, json.dumps(self.to_dict(), indent=1) + "\n", force)

    def save_model(self, path: str | os.PathLike[str], *, force: bool = False) -> None:
        """Writes the improved model as a model file; force: replace a file that is there, which is else an InvalidRequest."""
        if not self.improved_model:
            raise InvalidRequest("The report has no improved model: nothing is to be added or changed.")
        _write(path, self.improved_model, force)

    def _ladder(self) -> list[tuple[DataReport, str, Quality]]:
        """(data, model, its error) of the given model, after each step, of the improved one."""
        found = []
        for data in self.data:
            models = [("given", data.initial), *zip((f"+ {step.effect}" for step in self.steps), data.after_step)]
            if self.improved_model and data.final and (models[-1][1] is None or data.final.rmse != models[-1][1].rmse):
                models.append(("improved", data.final))
            found += [(data, name, quality) for name, quality in models if quality is not None]
        return found

    def _table(self) -> Mapping[str, Any]:
        ladder = self._ladder()
        if not ladder and self.message.detectable:
            return self.detectable._table()
        return {"data": [data.kind for data, _, _ in ladder], "session": [data.session for data, _, _ in ladder],
                "unit": [data.unit for data, _, _ in ladder], "model": [name for _, name, _ in ladder],
                "rmse": [quality.rmse for _, _, quality in ladder], "heldout_rmse": [quality.heldout_rmse for _, _, quality in ladder],
                "noise_floor": [data.noise_floor for data, _, _ in ladder]}

    def _heading(self) -> str:
        return self.summary

    def _draw(self, axes: Any) -> None:
        ladder = self._ladder()
        if not ladder:
            self.detectable._draw(axes)
            return
        unit = ladder[0][0].unit  # of the first kind of measurement; others have another unit
        shown = [each for each in ladder if each[0].unit == unit]
        tabular.bars(axes, [name for _, name, _ in shown], [quality.rmse for _, _, quality in shown])
        if shown[0][0].noise_floor:
            axes.axvline(shown[0][0].noise_floor, color="0.5", linestyle=":", linewidth=1)
        axes.set(xlabel=f"RMSE, {unit} (dotted: noise floor)")

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


def _budget(b: diagnosis_pb2.UncertaintyBudget, unit: str) -> UncertaintyBudget:
    return UncertaintyBudget(
        unit, b.object, b.touches, b.parameters, b.surface, b.repeatability, b.reproducibility if b.HasField("reproducibility") else None,
        b.combined, b.largest, b.beyond_measured, b.contributions[0].name if b.contributions else "",
        b.contributions[0].share if b.contributions else 0.0, b,
    )


def _compared(effect: diagnosis_pb2.ComparedEffect, value: diagnosis_pb2.ComparedValue) -> ComparedValue:
    return ComparedValue(
        effect.effect, " ".join(part for part in (value.name, value.finger) if part), effect.object,
        diagnosis_pb2.ComparedEffect.Change.Name(value.change).lower(), effect.p, value.difference,
        (value.lower, value.upper), {one.session: (one.value, one.std_error) for one in value.sessions},
        value.between_sessions, tuple(one.session for one in value.sessions if one.outside),
    )


def _value(p: diagnosis_pb2.ParameterValue) -> Value:
    name = " ".join(part for part in (p.name, p.finger, p.object) if part)
    return Value(name, p.value, p.std_error, (p.lower, p.upper))


def _write(path: str | os.PathLike[str], text: str, force: bool) -> None:
    check_target(path, force)
    with whole_file(path, encoding="utf-8") as file:
        file.write(text)
