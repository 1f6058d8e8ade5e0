"""Which tests are run for a mutant, when one counts as noticed, and what is reported."""

import dataclasses
import os
import pathlib
import time

import measure
import processes
import pytest
import report
import suites
from suites import KnownTest


def test_google_tests_learn_what_each_reaches_and_its_tier(program, tmp_path):
    tests, numbers = program
    assert sorted(tests.list()) == ["Between.HasAnEnd", "Count.Multiplies", "Crash.OfTheProgram", "Half.IsHalf", "Hang.Counts",
                                    "Text.SkipsItself"]
    learnt = {name: tests.learn(name, tmp_path / "reached")[0] for name in tests.list()}
    assert learnt["Text.SkipsItself"] is None
    assert (learnt["Half.IsHalf"].tier, learnt["Half.IsHalf"].reached) == (1, [numbers[18, "*"]])
    assert (learnt["Count.Multiplies"].tier, learnt["Count.Multiplies"].reached) == (2, [numbers[12, "+="], numbers[15, "*"]])


def test_a_test_that_does_not_end_in_time_is_left_out_and_not_run_again():
    @dataclasses.dataclass
    class Slow:
        name: str = "slow"
        runs: int = 0

        def list(self):
            return ["whole"]

        def learn(self, name, reached):
            self.runs += 1
            return KnownTest(self.name, name, 1), processes.Ended(False, True, -9, "", 600.0)

    slow, known, broken = Slow(), [], []
    measure.learn({"slow": slow}, known, broken, lambda: None)
    assert (known, broken, slow.runs) == ([], [("slow", "whole")], 1)


def test_google_tests_name_what_failed_crashed_or_did_not_end(program, monkeypatch):
    tests, numbers = program
    known = [KnownTest("all_test", name, 1, 0.0) for name in ("Half.IsHalf", "Between.HasAnEnd", "Hang.Counts", "Crash.OfTheProgram")]
    assert tests.first_failure(known, None) is None
    failure = tests.first_failure(known, numbers[18, "*"])
    assert (failure.test, failure.how) == ("Half.IsHalf", "failed")
    assert tests.fails_again(failure, known, numbers[18, "*"]) and not tests.fails_again(failure, known, None)
    crash = tests.first_failure(known[2:], numbers[20, "&&"])
    assert crash is None  # a disjunction holds there too
    monkeypatch.setattr(suites, "_MIN_S", 0.5)
    hang = tests.first_failure(known, numbers[24, "-="])
    assert (hang.test, hang.how) == ("Hang.Counts", "no end")


def test_a_process_that_does_not_end_is_killed_with_its_children():
    began = time.monotonic()
    ended = processes.run(["sh", "-c", "sleep 60 & echo $!; wait"], "/", dict(os.environ), 0.3)
    assert ended.timed_out and not ended.passed and time.monotonic() - began < 10
    child = int(ended.output)
    # Init may not have taken it away yet: a zombie has no command line.
    assert not os.path.exists(f"/proc/{child}") or pathlib.Path(f"/proc/{child}/cmdline").read_bytes() == b""


def test_a_process_that_wants_all_memory_fails():
    # Does not touch what it asks for.
    ended = processes.run(["/usr/bin/python3", "-c", "import mmap; mmap.mmap(-1, 7 << 30, flags=mmap.MAP_PRIVATE)"], "/",
                          dict(os.environ), 20)
    assert not ended.passed and "Cannot allocate memory" in ended.output


@dataclasses.dataclass
class FakeSuite:
    """Tests whose failures are written down: {test: mutants it notices}; `flaky`: fails once, whatever is on."""

    name: str
    notices: dict
    flaky: set = dataclasses.field(default_factory=set)
    ran: list = dataclasses.field(default_factory=list)

    def first_failure(self, tests, mutant):
        for test in tests:
            self.ran.append(test.name)
            if test.name in self.flaky:
                self.flaky.remove(test.name)
                return suites.Failure(test.name, "failed")
            if mutant in self.notices.get(test.name, ()):
                return suites.Failure(test.name, "failed")
        return None

    def fails_again(self, failure, tests, mutant):
        return mutant in self.notices.get(failure.test, ())


def fakes():
    quick, long = FakeSuite("quick", {"a": {1}}), FakeSuite("long", {"b": {1, 2}, "c": {3}})
    tests = [KnownTest("quick", "a", 1, 0.1, [1, 2, 4]), KnownTest("long", "b", 1, 9.0, [1, 2]), KnownTest("long", "c", 2, 5.0, [3, 4])]
    return {"quick": quick, "long": long}, tests


def test_tests_that_reach_a_mutant_run_cheapest_first_until_one_fails():
    both, tests = fakes()
    outcome = measure.try_mutant(both, tests, 1, (1, 2), measure.Outcome())
    assert (outcome.tier, outcome.test, both["long"].ran) == (1, "quick a", [])
    outcome = measure.try_mutant(both, tests, 2, (1, 2), measure.Outcome())
    assert (outcome.tier, outcome.test) == (1, "long b")


def test_the_second_tier_runs_for_what_the_first_does_not_notice():
    both, tests = fakes()
    first = measure.try_mutant(both, tests, 3, (1,), measure.Outcome())
    assert (first.tier, first.tried) == (0, 1)
    assert measure.try_mutant(both, tests, 3, (1, 2), first).tier == 2
    assert measure.try_mutant(both, tests, 4, (1, 2), measure.Outcome()).tier == 0


def test_a_failure_that_does_not_come_again_is_no_notice():
    both, tests = fakes()
    both["quick"].flaky.add("a")
    outcome = measure.try_mutant(both, tests, 4, (1,), measure.Outcome())
    assert (outcome.tier, both["quick"].ran) == (0, ["a"])


def test_a_test_that_fails_without_the_mutant_too_is_no_notice():
    both, tests = fakes()
    both["long"].notices["b"] = {2, None}
    assert measure.try_mutant(both, tests, 2, (1,), measure.Outcome()).tier == 0


@pytest.mark.parametrize("count, of, lower, upper", [(0, 10, 0.0, 0.3085), (5, 10, 0.1871, 0.8129), (10, 10, 0.6915, 1.0),
                                                     (45, 60, 0.6214, 0.8528)])
def test_intervals_are_clopper_and_pearsons(count, of, lower, upper):
    assert report.interval(count, of) == pytest.approx((lower, upper), abs=1e-4)


def test_a_part_of_the_results_is_replaced_and_the_others_stay(tmp_path):
    path = tmp_path / "RESULTS.md"
    report.write("before", "old\n\n| a |", path)
    report.write("after", "new", path)
    report.write("before", "newer", path)
    assert path.read_text().endswith("\n## before\n\nnewer\n\n## after\n\nnew\n")


def test_the_report_counts_tiers_and_names_what_nothing_reaches():
    site = {"line": 5, "original": "<"}
    state = {"commit": "0123456789", "commit_date": "2026-01-01", "date": "2026-01-02", "seed": 1, "broken": [],
             "mutants": [{"path": f"server/{name}.cpp", "site": site, "text": "a < b", "change": "<="} for name in "abc"]}
    outcomes = {0: measure.Outcome(1, 1, "x Y.Z", "failed"), 1: measure.Outcome(2, 2, "x Y.Q", "no end"), 2: measure.Outcome(0, 2)}
    text = report.part(state, outcomes, [KnownTest("x", "Y.Z", 1, 1.0, [0, 1])], "a machine")
    assert "| first tier | 1 of 3 | 33 % |" in text and "| all | 2 of 3 | 67 % |" in text
    assert "| 2 | server/c.cpp:5 | `a < b`: `<` to `<=` | **none**: no test reaches it |" in text
