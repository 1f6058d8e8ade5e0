"""RESULTS.md from reports: python -m touchstone.training.results_page --note TEXT [--earlier RESULTS.md] report.json ... > new.md

Every number of the page is one of a report; a later report's experiment takes the place of an earlier one's, and sections
of an earlier page stay where no report has their experiment.
"""

from __future__ import annotations

import argparse
import json
import pathlib
import re
import shlex
from collections.abc import Mapping, Sequence
from typing import Any

from touchstone import command

from .experiment import experiments

# What goes beyond the seed stands first.
_FIRST = ("better_model", "touches_to_be_sure", "calibrated_answers", "other_rigs")
_FIGURES = {"better_model": "![accuracy on each step of three ladders, and what single effects cost](ladder.svg)"}


def page(reports: Sequence[Mapping[str, Any]], note: str, earlier: str = "") -> str:
    """Of report.json files, as they were read; `note` says where and when; `earlier`: the text of another such page."""
    kept = dict(section.split("\n", 1) for section in earlier.split("\n## ")[1:])
    titles = {each.name: each.title for each in experiments()}
    found = {each["name"]: (each, report) for report in reports for each in report["experiments"]}
    names = [*_FIRST, *(name for name in titles if name not in _FIRST)]
    parts = ["# What the experiments found", "", *_wrapped(
        f"{note} Each experiment names the command that made its tables and its seeds; intervals are 95 % over them. The rig is the emulated "
        "one: **nothing here was measured on anything.** The emulated touches were made once, so that another measurement may differ by more "
        "than an interval. Made of the runs' `report.json` by `python -m touchstone.training.results_page`.")]
    for name in names:
        if name in found:
            parts += ["", *_section(*found[name])]
        elif titles[name] in kept:
            parts += ["", f"## {titles[name]}", *kept[titles[name]].rstrip("\n").split("\n")]
    return "\n".join(parts) + "\n"


def _section(result: Mapping[str, Any], report: Mapping[str, Any]) -> list[str]:
    seeds = re.search(r"Seeds (\d+) to (\d+)", " ".join(report["about"]))
    count = int(seeds[2]) - int(seeds[1]) + 1 if seeds else 0
    parts = [f"## {result['title']}", "",
             (f"`{_command(report['command'], result['name'])}`, {count} seeds, {result['seconds']:.0f} s. "
              f"Made on: {'; '.join(result['made_on'])}."), ""]
    if result["name"] in _FIGURES:
        parts += [_FIGURES[result["name"]], ""]
    parts += [f"- {words}" for words in result["words"]]
    if result["comparisons"]:
        parts += ["", *_table(["beside the seed", "here", "the seed", "why it may differ"], [_compared(each) for each in result["comparisons"]])]
    for table in result["tables"]:
        parts += ["", f"**{table['title']}**", "", *_table(table["columns"], table["rows"])]
        if table["note"]:
            parts += ["", table["note"]]
    return parts


def _command(line: str, name: str) -> str:
    """The command that makes this experiment alone as that line did: its options without the folder, files by their names."""
    words = shlex.split(line)
    first = next((k for k, word in enumerate(words) if word.startswith("--")), len(words))
    options = words[first:]
    if "--out" in options:
        place = options.index("--out")
        options = options[:place] + options[place + 2:]
    return " ".join(["python -m touchstone.training", name, *(pathlib.PurePath(word).name for word in options)])


def _compared(each: Mapping[str, Any]) -> list[str]:
    ours = each["ours"]
    seed = "shown without numbers" if each["seeds"] is None else f"{100 * each['seeds']:.1f} %"
    low, high = ("?" if ours[end] is None else f"{100 * ours[end]:.1f}" for end in ("low", "high"))
    return [each["what"], f"{100 * ours['value']:.1f} % ({low} to {high})", seed, each["why"]]


def _table(columns: Sequence[str], rows: Sequence[Sequence[str]]) -> list[str]:
    line = lambda cells: "| " + " | ".join(str(cell).replace("|", "\\|").replace("\n", " ") for cell in cells) + " |"
    return [line(columns), line(["---"] * len(columns)), *map(line, rows)]


def _wrapped(text: str, width: int = 128) -> list[str]:
    lines, line = [], ""
    for word in text.split():
        if line and len(line) + 1 + len(word) > width:
            lines.append(line)
            line = word
        else:
            line = f"{line} {word}".strip()
    return [*lines, line]


def main(words: list[str]) -> None:
    parser = argparse.ArgumentParser(prog="python -m touchstone.training.results_page", description=__doc__)
    parser.add_argument("reports", nargs="+", type=pathlib.Path, metavar="REPORT.json")
    parser.add_argument("--note", required=True, help="when, at which commit and on what machine")
    parser.add_argument("--earlier", type=pathlib.Path, metavar="RESULTS.md", help="whose sections stay where no report has the experiment")
    options = parser.parse_args(words)
    earlier = options.earlier.read_text(encoding="utf-8") if options.earlier else ""
    print(page([json.loads(path.read_text()) for path in options.reports], options.note, earlier), end="")


if __name__ == "__main__":
    command.run(main)
