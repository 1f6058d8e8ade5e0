"""The report of a run: HTML for people, JSON for programs, figures as SVG beside them."""

from __future__ import annotations

import dataclasses
import html
import json
import math
import pathlib
import platform
import re
from collections.abc import Sequence

from touchstone.whole_file import whole_file

from .experiment import Experiment
from .result import Result
from .settings import Settings

_STYLE = """
body{font:16px/1.55 system-ui,sans-serif;color:#1f2933;max-width:62rem;margin:2rem auto;padding:0 1.2rem}
h1{margin-bottom:.2rem} h2{margin-top:3rem;border-top:1px solid #e4e7eb;padding-top:1.4rem}
.grey{color:#616e7c} table{border-collapse:collapse;margin:1rem 0} th,td{padding:.25rem .8rem;text-align:left;vertical-align:top}
th{border-bottom:2px solid #7b8794} tr+tr td{border-top:1px solid #e4e7eb} caption{text-align:left;font-weight:600}
figure{margin:1.2rem 0} figure img{max-width:100%} figcaption{color:#616e7c;font-size:.92rem}
nav{columns:2;margin:1.2rem 0} .wide{overflow-x:auto} .wide table{font-size:.88rem}
td.number{font-variant-numeric:tabular-nums;white-space:nowrap}
"""


def write(settings: Settings, done: Sequence[tuple[Experiment, Result]], left_out: Sequence[tuple[Experiment, str]],
          command: str, date: str) -> pathlib.Path:
    """Writes report.html and report.json into the folder of the run; the page's path. `left_out`: with the reason."""
    about = _about(settings, command, date)
    page = [f"<!doctype html><html lang=en><meta charset=utf-8><title>Recognition by touch and sight</title><style>{_STYLE}</style>",
            "<h1>Recognition by touch and sight</h1>", *(f"<p class=grey>{_text(line)}</p>" for line in about), "<nav>",
            *(f'<a href="#{each.name}">{_text(each.title)}</a><br>' for each, _ in done), "</nav>"]
    for experiment, result in done:
        page += _section(experiment, result)
    if left_out:
        page += ["<h2>Left out</h2>", "<ul>", *(f"<li>{_text(each.title)}: {_text(why)}</li>" for each, why in left_out), "</ul>"]
    path = settings.out / "report.html"
    with whole_file(path, encoding="utf-8") as file:
        file.write("\n".join(page) + "\n")
    found = {"about": about, "command": command, "date": date, "left_out": {e.name: why for e, why in left_out},
             "experiments": [{**dataclasses.asdict(result), "seed_shows": e.seed_shows} for e, result in done]}
    with whole_file(settings.out / "report.json") as file:
        file.write(json.dumps(_without_nan(found), indent=1) + "\n")
    return path


def _about(settings, command, date):
    rig = ("a real rig's, through its gateway" if settings.rig_is_real else
           "made by an emulated rig, through its gateway: nothing here was measured on anything")
    return [f"Made by: {command}", (f"{date}, {platform.machine()}, Python {platform.python_version()}. Seeds {settings.runs[0]} to "
             f"{settings.runs[-1]}; intervals are 95 % over seeds. {'A quick run: small sets, wide intervals.' if settings.quick else ''}"),
            f"What is called {settings.measured_kind} is {rig}. Everything else is simulated."]


def _section(experiment: Experiment, result: Result) -> list[str]:
    seed = f"The seed's {experiment.seed_shows}." if experiment.seed_shows else "Not in the seed."
    parts = [f"<h2 id={experiment.name}>{_text(experiment.title)}</h2>", f"<p class=grey>{_text(seed)} {result.seconds:.0f} s.</p>"]
    parts += [f"<p>{_text(words)}</p>" for words in result.words]
    if result.comparisons:
        rows = [[c.what, c.ours.words(), "not stated" if c.seeds is None else f"{100 * c.seeds:.3g} %", _difference(c), c.made_on, c.why]
                for c in result.comparisons]
        parts += _table("Beside the seed's numbers", ["", "here", "seed", "difference", "made on", "why it may differ"], rows)
    for table in result.tables:
        parts += _table(table.title, table.columns, table.rows)
        if table.note:
            parts.append(f"<p class=grey>{_text(table.note)}</p>")
    for figure in result.figures:
        parts.append(f'<figure><img src="{_text(figure.file)}" alt="{_text(figure.caption)}">'
                     f"<figcaption>{_text(figure.caption)}</figcaption></figure>")
    return [*parts, "<p class=grey>Made on " + _text("; ".join(result.made_on)) + ".</p>"]


def _difference(comparison) -> str:
    return "" if comparison.seeds is None else f"{100 * (comparison.ours.value - comparison.seeds):+.1f} points"


def _table(title, columns, rows) -> list[str]:
    # A number and its interval stay in one line, if there is room for it.
    number = re.compile(r"[+-]?\d\S*( %| points)?( \(|$)")
    begin = lambda cell, kind: "td class=number" if kind == "td" and len(columns) <= 6 and number.match(str(cell)) else kind
    cells = lambda row, kind: "<tr>" + "".join(f"<{begin(cell, kind)}>{_text(cell)}</{kind}>" for cell in row) + "</tr>"
    return ["<div class=wide><table>", f"<caption>{_text(title)}</caption>", cells(columns, "th"),
            *(cells(row, "td") for row in rows), "</table></div>"]


def _text(words: str) -> str:
    """Escaped; a per cent sign stands one space from its number, and never alone in a line."""
    return re.sub(r"(\d) ?%", "\\1\u00a0%", html.escape(str(words), quote=True))


def _without_nan(value):
    """JSON has no nan: an interval of one seed is unknown."""
    if isinstance(value, float) and not math.isfinite(value):
        return None
    if isinstance(value, dict):
        return {key: _without_nan(each) for key, each in value.items()}
    if isinstance(value, (list, tuple)):
        return [_without_nan(each) for each in value]
    return value
