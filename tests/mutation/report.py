"""RESULTS.md: a part per measured state of the sources, named by a label."""

import math
import pathlib
import re

PATH = pathlib.Path(__file__).resolve().parent / "RESULTS.md"
_HEAD = """# Which mutants the tests notice

Written by `tests/mutation/run`; [README.md](README.md) says how mutants are drawn and when one counts as noticed.
"""


def _at_most(count, of, share):
    """Probability of at most `count` of `of`, each with the probability `share`."""
    return sum(math.comb(of, k) * share**k * (1 - share)**(of - k) for k in range(count + 1))


def _solve(falling, value):
    low, high = 0.0, 1.0
    for _ in range(60):
        middle = (low + high) / 2
        low, high = (middle, high) if falling(middle) > value else (low, middle)
    return low


def interval(count, of, level=0.95):
    """Clopper and Pearson's interval of a share."""
    tail = (1 - level) / 2
    lower = 0.0 if count == 0 else _solve(lambda share: _at_most(count - 1, of, share), 1 - tail)
    upper = 1.0 if count == of else _solve(lambda share: _at_most(count, of, share), tail)
    return lower, upper


def _share(name, count, of):
    lower, upper = interval(count, of)
    return f"| {name} | {count} of {of} | {100 * count / of:.0f} % | {100 * lower:.0f} to {100 * upper:.0f} % |"


def _code(text, width=60):
    text = " ".join(text.split()).replace("|", "\\|")
    return f"`{text if len(text) <= width else text[:width - 3] + '...'}`"


def part(state, outcomes, tests, machine):
    """The text of one label. `state`: as saved by run."""
    reached = {number for test in tests for number in test.reached}
    tried = {number: outcome for number, outcome in outcomes.items() if outcome.tried}
    of, first = len(tried), sum(outcome.tier == 1 for outcome in tried.values())
    lines = [(f"Commit {state['commit'][:7]} ({state['commit_date']}), measured {state['date']} on {machine}, seed {state['seed']}: "
              f"{len(state['mutants'])} mutants, {of} of them tried."), ""]
    if of:
        lines += ["| tests | noticed | share | 95 % interval |", "| --- | --- | --- | --- |", _share("first tier", first, of)]
        if all(outcome.tier or outcome.tried == 2 for outcome in tried.values()):
            lines.append(_share("all", sum(outcome.tier > 0 for outcome in tried.values()), of))
        lines.append("")
    lines += ["| | mutant | changed | noticed by |", "| --- | --- | --- | --- |"]
    for number, mutant in enumerate(state["mutants"]):
        outcome, site = outcomes.get(number), mutant["site"]
        if outcome is None or not outcome.tried:
            verdict = "not tried"
        elif outcome.tier:
            verdict = f"{('first', 'second')[outcome.tier - 1]}: {outcome.test} ({outcome.how})"
        elif number not in reached:
            verdict = "**none**: no test reaches it"
        else:
            verdict = "**none**" if outcome.tried == 2 else "**none** of the first tier"
        changed = f"{_code(mutant['text'])}: {_code(site['original'])} to {_code(mutant['change'])}"
        lines.append(f"| {number} | {mutant['path']}:{site['line']} | {changed} | {verdict} |")
    if state["broken"]:
        broken = ", ".join(f"{suite} {name}" for suite, name in state["broken"])
        lines += ["", f"Left out, since they fail without a mutant or take more than 10 minutes: {broken}."]
    return "\n".join(lines)


def write(label, text, path=PATH):
    """Replaces the label's part and keeps the others."""
    parts = dict(re.findall(r"^## ([^\n]+)\n\n(.*?)\n*(?=^## |\Z)", path.read_text(), re.MULTILINE | re.DOTALL)) if path.exists() else {}
    parts[label] = text
    path.write_text(_HEAD + "".join(f"\n## {name}\n\n{body}\n" for name, body in parts.items()))
