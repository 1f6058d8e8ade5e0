"""Of the program that measures what each threshold changes."""
import pathlib

import table

OUTPUT = """ok    one 7 (1.2 s): hidden tip_radius 0.3 => MISSING_EFFECT tip_radius 0.31 P 1.00
        truth named: yes
WRONG two 8 (0.9 s): hidden oblique_slip 0.1 => ADEQUATE
"""


def test_answers_are_read_from_the_scorers_lines():
    assert table.answers_of(OUTPUT) == [["one 7", True, "hidden tip_radius 0.3 => MISSING_EFFECT tip_radius 0.31 P 1.00"],
                                        ["two 8", False, "hidden oblique_slip 0.1 => ADEQUATE"]]


def test_another_value_is_the_same_finding_and_another_name_is_not():
    base = table.answers_of(OUTPUT)
    moved = [["one 7", True, base[0][2].replace("0.31", "0.29")], base[1]]
    renamed = [["one 7", False, base[0][2].replace("MISSING_EFFECT tip_radius", "MISSING_EFFECT finger_length")], base[1]]
    assert table.differences(base, {"half": moved, "twice": renamed}) == {"half": [0, 0, 0], "twice": [1, 1, 0]}


def test_every_rule_of_the_diagnosis_is_read():
    root = pathlib.Path(__file__).resolve().parents[2]
    rules = table.read_rules(root)
    declared = sum(path.read_text().count("Rule<") for path in (root / "server/diagnosis").rglob("*rules.h"))
    assert len(rules) == declared > 300
    assert len({rule.name for rule in rules}) == len(rules)
