"""What an experiment found: numbers, tables, figures and words, which JSON keeps and the report shows."""

from __future__ import annotations

import dataclasses
import json
import pathlib
from typing import Any

from touchstone.whole_file import whole_file


@dataclasses.dataclass
class Estimate:
    """A mean over seeds with its 95 % interval."""

    value: float
    low: float
    high: float

    def words(self, percent: bool = True) -> str:
        scale, unit = (100, " %") if percent else (1, "")
        return f"{scale * self.value:.3g}{unit} ({scale * self.low:.3g} to {scale * self.high:.3g})"


@dataclasses.dataclass
class Comparison:
    """One number of ours beside the seed's.

    Attributes:
      what: "XGBoost, 15 touches, trained on 640 virtual samples", ...
      ours: what was found here.
      seeds: the number that the seed states; None: it only shows a figure or an ordering.
      made_on: what it was trained on and tested on.
      why: why the two may differ; must not be empty where they do.
    """

    what: str
    ours: Estimate
    seeds: float | None
    made_on: str
    why: str = ""


@dataclasses.dataclass
class Table:
    title: str
    columns: list[str]
    rows: list[list[str]]
    note: str = ""


@dataclasses.dataclass
class Figure:
    """An SVG file in the folder of the report."""

    file: str
    caption: str


@dataclasses.dataclass
class Result:
    """Attributes:
      name, title: of the experiment.
      made_on: a line for each source: what was simulated, measured, emulated, and how much of it.
      words: what was found, a paragraph each; the first is the answer in one sentence.
      data: every number that a figure or a table shows, so that they can be drawn again.
      seconds: how long it took.
    """

    name: str
    title: str
    made_on: list[str] = dataclasses.field(default_factory=list)
    words: list[str] = dataclasses.field(default_factory=list)
    comparisons: list[Comparison] = dataclasses.field(default_factory=list)
    tables: list[Table] = dataclasses.field(default_factory=list)
    figures: list[Figure] = dataclasses.field(default_factory=list)
    data: dict[str, Any] = dataclasses.field(default_factory=dict)
    seconds: float = 0.0

    def save(self, path: pathlib.Path, digest: str) -> None:
        """Whole or not at all, with the digest of what it was made by."""
        with whole_file(path) as file:
            json.dump({"digest": digest, **dataclasses.asdict(self)}, file, indent=1)

    @classmethod
    def load(cls, path: pathlib.Path, digest: str) -> Result | None:
        """None unless the file was made by the same code and settings."""
        try:
            found = json.loads(path.read_text())
        except (OSError, ValueError):
            return None
        if not isinstance(found, dict) or found.pop("digest", None) != digest:
            return None
        result = cls(**found)
        result.comparisons = [Comparison(**{**c, "ours": Estimate(**c["ours"])}) for c in found["comparisons"]]
        result.tables = [Table(**table) for table in found["tables"]]
        result.figures = [Figure(**figure) for figure in found["figures"]]
        return result
