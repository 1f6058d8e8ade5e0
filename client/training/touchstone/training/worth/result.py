"""What worth() found: numbers, a table and words."""

from __future__ import annotations

import dataclasses
import json
import math
import os
import textwrap
from typing import Any

import numpy as np

from touchstone.tabular import Tabular
from touchstone.whole_file import check_target, whole_file

from ..ladder import Rung, words as ladder_words
from ..result import Estimate, Table
from .intervals import Exchange

FEW_GROUPS = 20  # of poses: with fewer, intervals by bootstrap are too narrow


@dataclasses.dataclass(frozen=True)
class Step:
    """What training on one model gives. All estimates with their 95 % intervals.

    Attributes:
      rung: the model.
      accuracy: on measured touches, 0 to 1.
      gain: of accuracy over the nominal model; None: this is the nominal model.
      step: of accuracy over the model before it.
      rmse_change_us: over the model before it, on the touches that are tested.
    """

    rung: Rung
    accuracy: Estimate
    gain: Estimate | None = None
    step: Estimate | None = None
    rmse_change_us: Estimate | None = None

    def judgement(self) -> str:
        """What this step does to the error and to the mistakes."""
        assert self.step is not None and self.rmse_change_us is not None
        error = {"gains": "raises the error", "loses": "lowers the error"}.get(ladder_words.verdict(self.rmse_change_us), "")
        change = ladder_words.verdict(self.step)
        if change == "gains":
            return f"{error} and the mistakes" if error.startswith("low") else "lowers the mistakes" + (f", and {error}" if error else "")
        if change == "loses":
            return "HARMS: more mistakes" + (f", and {error}" if error else "")
        if not error:
            return "no change of error or mistakes can be told"
        if error.startswith("low"):
            return f"{error} and not the mistakes (a gain of more than {100 * self.step.high:.1f} points is excluded)"
        return f"{error}; no change of the mistakes can be told"


@dataclasses.dataclass(frozen=True)
class Worth(Tabular):
    """What a better model is worth to a recogniser, on measured touches. print() says it; a table of accuracies in notebooks, with
    to_pandas(), to_arrow() and plot().

    Attributes:
      steps: the nominal model, each step between, the better model.
      own: accuracy of the recogniser trained on measured touches, each tested on poses that it was not trained on.
      own_touches: how many it was trained on.
      exchange: by the nominal and by the better model, how many simulated touches teach as much as one measured one.
      curves: for both, [(simulated touches, accuracy)].
      about: set, recogniser, numbers of touches and sets, seed.
      cautions: what a reader must know before the numbers.
    """

    steps: tuple[Step, ...]
    own: Estimate
    own_touches: int
    exchange: dict[str, Exchange]
    curves: dict[str, list[tuple[int, Estimate]]]
    about: dict[str, Any]
    cautions: tuple[str, ...]

    @property
    def words(self) -> list[str]:
        """A paragraph each; the first is the answer."""
        return [_answer(self), *self.cautions, *(f"{_name(each)}: {each.judgement()}, {ladder_words.points(each.step)}." for each in self.steps[1:]
                                                 if each.step is not None), _exchange_words(self)]

    def table(self) -> Table:
        rows = [[_name(each), f"{each.rung.rmse_us / 1e3:.1f}", each.accuracy.words(), ladder_words.points(each.gain) if each.gain else ""]
                for each in self.steps]
        rows.append([f"{self.own_touches:,} {self.about['kind']} touches", "", self.own.words(), ""])
        return Table("", ["trained on", "RMSE, ms", f"knows of {self.about['kind']} sets", "against the nominal"], rows)

    def _table(self) -> dict[str, Any]:
        rows: list[Any] = [(_name(each), each.rung.rmse_us, each.accuracy, each.gain) for each in self.steps]
        rows.append((f"{self.about['kind']} touches", None, self.own, None))
        bounds = lambda of: [[getattr(row[of], end) if row[of] else None for row in rows] for end in ("value", "low", "high")]
        names = ("accuracy", "accuracy_low", "accuracy_high", "gain", "gain_low", "gain_high")
        return {"trained_on": [row[0] for row in rows], "rmse_us": [row[1] for row in rows], **dict(zip(names, bounds(2) + bounds(3)))}

    def _heading(self) -> str:
        return " ".join([self.words[0], *self.cautions])

    def _draw(self, axes: Any) -> None:
        from .figure import draw_steps

        draw_steps(self, axes)

    def to_dict(self) -> dict[str, Any]:
        """Plain types, as `--json` writes them; what is infinite or unknown is None."""
        found = {
            "words": self.words, "cautions": list(self.cautions), "about": self.about,
            "steps": [{"name": each.rung.name, "model": each.rung.model, "rmse_us": each.rung.rmse_us, "accuracy": each.accuracy, "gain": each.gain,
                       "step": each.step, "rmse_change_us": each.rmse_change_us, "judgement": each.judgement() if each.step else None}
                      for each in self.steps],
            "measured": {"touches": self.own_touches, "accuracy": self.own},
            "simulated_per_measured": self.exchange,
            "curves": {name: [{"touches": touches, "accuracy": accuracy} for touches, accuracy in curve] for name, curve in self.curves.items()}}
        plain: dict[str, Any] = _plain(found)
        return plain

    def save(self, path: str | os.PathLike[str], *, force: bool = False) -> None:
        """Writes it as JSON, whole or not at all; force: replace a file that is there, which is else an InvalidRequest."""
        check_target(path, force)
        with whole_file(path, encoding="utf-8") as file:
            file.write(json.dumps(self.to_dict(), indent=1) + "\n")

    def text(self, width: int = 100) -> str:
        """Words and table; words are broken at `width`, the table is as wide as it is."""
        answer, *more = (textwrap.fill(each, width, subsequent_indent="  ") for each in self.words)
        return "\n".join([answer, "", *_lines(self.table()), "", *more])

    def __str__(self) -> str:
        return self.text()


def _plain(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _plain(each) for key, each in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(each) for each in value]
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return _plain(dataclasses.asdict(value))
    return None if isinstance(value, float) and not math.isfinite(value) else value


def _lines(table: Table) -> list[str]:
    widths = [max(map(len, column)) for column in zip(table.columns, *table.rows)]
    return ["  ".join(cell.ljust(width) for cell, width in zip(row, widths)).rstrip() for row in [table.columns, *table.rows]]


def _name(step: Step) -> str:
    return step.rung.name


def _answer(worth: Worth) -> str:
    first, last = worth.steps[0], worth.steps[-1]
    kind, touches = worth.about["kind"], worth.about["touches_per_set"]
    of = f"of the sets of {touches} {kind} touches"
    if last.gain is None:
        return (f"The two models have the same effects: there is nothing to compare. Trained on them, {worth.about['recogniser']} knows "
                f"{first.accuracy.words()} {of}.")
    change = ladder_words.verdict(last.gain)
    yes = {"gains": "Worth it", "loses": "Not worth it: the better model HARMS"}.get(change, "Not shown to be worth it")
    limit = "" if change == "gains" or change == "loses" else f"; a gain of more than {100 * last.gain.high:.1f} points is excluded"
    return (f"{yes}: trained on the better model, {worth.about['recogniser']} knows {last.accuracy.words()} {of}, on the nominal one "
            f"{first.accuracy.words()}: {ladder_words.points(last.gain)}{limit}. The RMSE went from {first.rung.rmse_us / 1e3:.1f} to "
            f"{last.rung.rmse_us / 1e3:.1f} ms.")


def _exchange_words(worth: Worth) -> str:
    kind = worth.about["kind"]
    each = [f"{found.words()} simulated ones of the {name} model" for name, found in worth.exchange.items()]
    return (f"One {kind} touch is worth {' and '.join(each)} in training: {worth.own_touches:,} {kind} touches teach it {worth.own.words()}.")


def cautions(about: dict[str, Any], steps: int) -> tuple[str, ...]:
    """What a reader must know before the numbers; `steps`: how many models were tried."""
    said, groups = [], about["groups"]
    if about["fitted"] is None and steps > 1:
        said.append("Caution: it is not known whether the better model was fitted to these touches; if it was, its error and accuracy are "
                    "flattered. Name the set that was diagnosed (--fitted), and none of its poses is tested.")
    if groups < FEW_GROUPS:
        said.append(f"Caution: the set has {groups} groups of poses; with fewer than {FEW_GROUPS} these intervals are too narrow.")
    if about["incomplete"]:
        said.append(f"{about['incomplete']} touches are left out because a finger reported nothing.")
    return tuple(said)


def change_of_rmse(difference: float, interval: tuple[float, float]) -> Estimate:
    low, high = interval if np.isfinite(interval).all() else (-np.inf, np.inf)
    return Estimate(difference, float(low), float(high))
