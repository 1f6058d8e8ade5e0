"""The rules as server/diagnosis/RULES.md lists them, answers of the scorer, and the table of what changes."""

import dataclasses
import re

FACTORS = {"half": 0.5, "twice": 2.0}


@dataclasses.dataclass
class Rule:
    name: str  # engine.search.max_refits
    number: float
    unit: str
    kind: str  # "int" or "double"

    @property
    def room(self):
        """engine.search"""
        return self.name.rpartition(".")[0]


def read_rules(root):
    """[Rule] of all headers rules.h, in their order."""
    row = re.compile(r'Rule<(\w+)>\s+\w+\{\s*"([\w.]+)",\s*([^,]+),\s*"([^"]*)"')
    rules = []
    for path in sorted((root / "server/diagnosis").rglob("*rules.h")):
        for kind, name, number, unit in row.findall(path.read_text()):
            over = [float(part.replace("'", "")) for part in number.split("/")]  # 4.0 / 3, 250'000
            rules.append(Rule(name, over[0] / (over[1] if over[1:] else 1), unit, "double" if kind == "double" else "int"))
    return rules


def answers_of(output):
    """[(arm and seed, right, answer)] of the scorer's --verbose output, in the order of arms and seeds."""
    line = re.compile(r"^(ok   |WRONG) (.+ \d+) \([\d.]+ s\): (.*)$", re.MULTILINE)
    return sorted([where, mark == "ok   ", answer] for mark, where, answer in line.findall(output))


def findings(answer):
    """Verdict and names of an answer, without values: what must be the same for an answer to be the same."""
    said = answer.rpartition("=> ")[2]
    return re.sub(r"-?\d+(\.\d+)?(e[+-]?\d+)?", "#", said)


def differences(base, found):
    """{"half": [sets whose findings differ, of these now wrong, of these now right], ...}"""
    result = {}
    for way, answers in found.items():
        changed = [(old, new) for old, new in zip(base, answers) if isinstance(new, str) or findings(old[2]) != findings(new[2])]
        worse = sum(1 for old, new in changed if old[1] and (isinstance(new, str) or not new[1]))
        better = sum(1 for old, new in changed if not isinstance(new, str) and new[1] and not old[1])
        result[way] = [len(changed), worse, better]
    return result


def _cell(counts):
    if counts is None:
        return ""
    changed, worse, better = counts
    if not changed:
        return "same"
    return f"{changed} differ" + (f", {worse} now wrong" if worse else "") + (f", {better} now right" if better else "")


def text(state, sets):
    """RESULTS.md"""
    wrong = sum(1 for answer in state.get("base", []) if not answer[1])
    lines = ["# What each number changes", "",
             (f"Made by `tests/rules/run` on {state.get('date')} at commit {state.get('commit')}: {sets} sets of the tuning seeds of "
              f"tests/hidden_effects, one of each of as many arms; {wrong} of them are answered wrong as it is. Of each number that was "
              "tried: how many sets have another verdict, other steps or other equivalents where it is half or twice as large."), "",
             "| number | half | twice |", "| --- | --- | --- |"]
    lines += [f"| `{name}` | {_cell(found.get('half'))} | {_cell(found.get('twice'))} |" for name, found in sorted(state["rules"].items())]
    return "\n".join(lines) + "\n"
