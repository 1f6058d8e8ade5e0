"""The two passes: which mutants each test reaches, and for each mutant the tests that reach it until one fails."""

import collections
import concurrent.futures
import dataclasses
import pathlib
import tempfile
import time

import suites as kinds

_WORKERS = 2
# Tests of at most so many seconds run first, then the longer ones; each round a process per program.
_ROUNDS_S = (0.3, 3.0, float("inf"))
_AT_ONCE = 200  # tests in one process
_UNCONFIRMED = 3  # failures that cannot be repeated, or come without the mutant too, before the program is left


@dataclasses.dataclass
class Outcome:
    tier: int = 0  # that noticed; 0: none
    tried: int = 0  # the last tier whose tests ran
    test: str = ""
    how: str = ""
    seconds: float = 0.0


def learn(suites, known, broken, save):
    """Adds to `known` the tests with what they reach, to `broken` those that fail without a mutant. `save` is called now and
    then; what is known already is not run again."""
    had = {(test.suite, test.name) for test in known} | {tuple(pair) for pair in broken}
    pending = [(suite, name) for suite in suites.values() for name in suite.list() if (suite.name, name) not in had]
    again = []
    with tempfile.TemporaryDirectory() as folder:
        with concurrent.futures.ThreadPoolExecutor(_WORKERS) as pool:
            runs = {pool.submit(suite.learn, name, pathlib.Path(folder) / str(index)): (suite, name)
                    for index, (suite, name) in enumerate(pending)}
            for count, run in enumerate(concurrent.futures.as_completed(runs)):
                test, ended = run.result()
                if test is None:
                    continue
                if ended.passed:
                    known.append(test)
                elif ended.timed_out:
                    broken.append((runs[run][0].name, runs[run][1]))
                else:
                    again.append(runs[run])
                if count % 50 == 0:
                    save()
        # With nothing beside it.
        for suite, name in again:
            _learn_alone(suite, name, pathlib.Path(folder) / "alone", known, broken)
    save()


def _learn_alone(suite, name, reached, known, broken):
    test, ended = suite.learn(name, reached)
    if not ended.passed and isinstance(suite, kinds.PythonFile):
        left_out = suite.leave_out(ended.output)
        broken += [(suite.name, test) for test in left_out]
        if left_out:
            test, ended = suite.learn(name, reached)
    if ended.passed and test:
        known.append(test)
    elif test:
        broken.append((suite.name, name))


def in_order(tests, number, tier):
    """[(suite, tests)] of the tier that reach the mutant, cheapest first."""
    ordered, begin = [], -1.0
    for end in _ROUNDS_S:
        by_suite = collections.defaultdict(list)
        for test in tests:
            if test.tier == tier and number in test.reached and begin < test.seconds <= end:
                by_suite[test.suite].append(test)
        for suite, some in sorted(by_suite.items(), key=lambda pair: sum(test.seconds for test in pair[1])):
            some.sort(key=lambda test: test.seconds)
            ordered += [(suite, some[at:at + _AT_ONCE]) for at in range(0, len(some), _AT_ONCE)]
        begin = end
    return ordered


def try_mutant(suites, tests, number, tiers, before):
    """Outcome of one mutant. `before`: of an earlier try that had fewer tiers."""
    began, outcome = time.monotonic(), dataclasses.replace(before)
    for tier in tiers:
        if outcome.tier or outcome.tried >= tier:
            continue
        for suite, some in in_order(tests, number, tier):
            failure = _confirmed(suites[suite], some, number)
            if failure:
                outcome.tier, outcome.how = tier, failure.how
                outcome.test = failure.test if failure.test.startswith(suite) else f"{suite} {failure.test}".strip()
                break
        outcome.tried = tier
    outcome.seconds += time.monotonic() - began
    return outcome


def _confirmed(suite, tests, number):
    """A failure that comes twice with the mutant and not without."""
    for _ in range(_UNCONFIRMED):
        failure = suite.first_failure(tests, number)
        if failure is None:
            return None
        if suite.fails_again(failure, tests, number) and not suite.fails_again(failure, tests, None):
            return failure
        tests = [test for test in tests if test.name != failure.test]
        if not tests:
            return None
    return None


def expected_seconds(tests, numbers, tier):
    """What the tests of a tier take for these mutants where none of them is noticed."""
    return sum(test.seconds * len(set(test.reached) & set(numbers)) for test in tests if test.tier == tier)


def try_all(suites, tests, numbers, tiers, outcomes, save):
    with concurrent.futures.ThreadPoolExecutor(_WORKERS) as pool:
        runs = {pool.submit(try_mutant, suites, tests, number, tiers, outcomes.get(number, Outcome())): number
                for number in numbers}
        for run in concurrent.futures.as_completed(runs):
            outcomes[runs[run]] = run.result()
            save(runs[run])
