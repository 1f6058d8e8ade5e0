"""The three kinds of tests: single GoogleTests, other programs that ctest knows, Python files. Each finds its tests, learns
which mutants each reaches, and runs some of them with a mutant on."""

import dataclasses
import json
import pathlib
import re
import subprocess
import threading

import processes

# A test that takes this many times its usual time, and at least so many seconds, hangs.
_TIMES_USUAL, _MIN_S = 10, 30
# Of a test's first run, when nothing is known of it. What takes longer is left out and named.
_FIRST_RUN_S = 600
_PYTHON_FOLDERS = ("client/python/tests", "client/training/tests", "tests/end_to_end", "tests/hidden_effects/images", "tests/faults")


@dataclasses.dataclass
class KnownTest:
    suite: str
    name: str
    tier: int  # 1 or 2
    seconds: float = 0.0
    reached: list = dataclasses.field(default_factory=list)


@dataclasses.dataclass
class Failure:
    test: str  # its name; "" where the program failed outside a test
    how: str


def limit_s(seconds):
    return max(_TIMES_USUAL * seconds, _MIN_S)


class GoogleTests:
    """The tests of one program, with the environment that ctest gives it."""

    def __init__(self, name, command, cwd, more, second_tier):
        self.name, self._command, self._cwd, self._more, self._second_tier = name, command, cwd, more, second_tier

    def list(self):
        listed = subprocess.run([*self._command, "--gtest_list_tests"], cwd=self._cwd, capture_output=True, text=True,
                                env=processes.environment(more=self._more), timeout=60, check=True).stdout
        names, group = [], ""
        for line in listed.splitlines():
            word = line.split("#")[0].rstrip()
            if re.fullmatch(r"\S+\.", word):
                group = word
            elif re.fullmatch(r"  \S+", word):
                names.append(group + word.strip())
        return [name for name in names if "DISABLED_" not in name]

    def _run(self, names, mutant, reached, all_tiers, limit, follow=None):
        command = [*self._command, "--gtest_filter=" + ":".join(names), "--gtest_fail_fast"]
        return processes.run(command, self._cwd, processes.environment(mutant, reached, all_tiers, self._more), limit, follow)

    def learn(self, name, reached):
        """(test or None where it skips itself in any case, Ended)."""
        for tier in (2,) if self._second_tier else (1, 2):
            pathlib.Path(reached).unlink(missing_ok=True)
            ended = self._run([name], None, reached, tier == 2, _FIRST_RUN_S)
            if "[  SKIPPED ]" not in ended.output:
                return KnownTest(self.name, name, tier, ended.seconds, processes.numbers(reached)), ended
        return None, ended

    def first_failure(self, tests, mutant):
        """Runs the tests, which are of one tier, in one process until one fails."""
        usual = {test.name: test.seconds for test in tests}
        running = [""]

        def follow(text):
            begun = re.findall(r"^\[ RUN      \] (\S+)$", text, re.MULTILINE)
            if not begun:
                return None
            running[0] = begun[-1]
            return limit_s(usual.get(begun[-1], 0))

        ended = self._run([test.name for test in tests], mutant, None, tests[0].tier == 2, limit_s(max(usual.values())), follow)
        if ended.passed:
            return None
        failed = re.findall(r"^\[  FAILED  \] ([^\s,]+).*\(\d+ ms\)$", ended.output, re.MULTILINE)
        if failed:
            return Failure(failed[0], "failed")
        begun = re.findall(r"^\[ RUN      \] (\S+)$", ended.output, re.MULTILINE)
        ends = re.findall(r"^\[       OK \] ([^\s,]+)", ended.output, re.MULTILINE)
        unfinished = begun[-1] if begun and begun[-1] not in ends else ""
        return Failure(unfinished, "no end" if ended.timed_out else f"ended with {ended.code}")

    def fails_again(self, failure, tests, mutant):
        named = [test for test in tests if test.name == failure.test]
        return self.first_failure(named or tests, mutant) is not None


class Program:
    """A test that ctest runs as a whole, with what it needs before it."""

    _one_at_a_time = threading.Lock()  # they leave files for one another

    def __init__(self, name, build, second_tier):
        self.name, self._build, self._tier = name, build, 2 if second_tier else 1

    def list(self):
        return [self.name]

    def _run(self, mutant, reached, limit):
        command = ["ctest", "--test-dir", self._build, "--output-on-failure", "--no-tests=error", "-R", f"^{re.escape(self.name)}$"]
        with self._one_at_a_time:
            return processes.run(command, self._build, processes.environment(mutant, reached, True), limit)

    def learn(self, name, reached):
        ended = self._run(None, reached, _FIRST_RUN_S)
        return KnownTest(self.name, name, self._tier, ended.seconds, processes.numbers(reached)), ended

    def first_failure(self, tests, mutant):
        ended = self._run(mutant, None, limit_s(tests[0].seconds))
        return None if ended.passed else Failure(self.name, "no end" if ended.timed_out else "failed")

    def fails_again(self, failure, tests, mutant):
        return self.first_failure(tests, mutant) is not None


class PythonFile:
    """The tests of a Python file: those of the first tier together, and those of the second."""

    def __init__(self, name, tree):
        self.name, self._tree = name, tree
        self.broken = []  # tests that fail without a mutant

    def list(self):
        return [self.name, f"{self.name} (second tier)"]

    def _run(self, words, mutant, reached, second, limit):
        command = [self._tree.python, "-m", "pytest", "-p", "no:cacheprovider", "-q", "-rfE", *words]
        command += [word for test in self.broken for word in ("--deselect", test)] + (["-m", "second_tier"] if second else [])
        more = {"TOUCHSTONE_SERVER_PROGRAM": str(self._tree.bin / "touchstone-server")}
        return processes.run(command, self._tree.root, processes.environment(mutant, reached, second, more), limit)

    def learn(self, name, reached):
        second = name != self.name
        ended = self._run([self.name], None, reached, second, _FIRST_RUN_S)
        if ended.code == 5:  # nothing collected
            return None, ended
        return KnownTest(self.name, name, 2 if second else 1, ended.seconds, processes.numbers(reached)), ended

    def leave_out(self, output):
        """The tests of a run that failed without a mutant; their names."""
        names = _failed(output)
        self.broken += names
        return names

    def first_failure(self, tests, mutant):
        ended = self._run(["-x", self.name], mutant, None, tests[0].tier == 2, limit_s(tests[0].seconds))
        if ended.passed or ended.code == 5:
            return None
        names = _failed(ended.output)
        return Failure(names[0] if names else self.name, "no end" if ended.timed_out else "failed")

    def fails_again(self, failure, tests, mutant):
        words = failure.test if "::" in failure.test else self.name
        return not self._run([words], mutant, None, tests[0].tier == 2, limit_s(sum(test.seconds for test in tests))).passed


def _failed(output):
    return [name.split(" - ")[0] for name in re.findall(r"^(?:FAILED|ERROR) (.*)$", output, re.MULTILINE)]


def find(tree):
    """Every suite of a tree of which the program is built, by name."""
    build = tree.root / "build/release"
    listed = subprocess.run(["ctest", "--test-dir", build, "--show-only=json-v1"], capture_output=True, text=True, check=True).stdout
    suites: dict = {}
    known = set()
    for test in json.loads(listed)["tests"]:
        properties = {entry["name"]: entry["value"] for entry in test.get("properties", [])}
        more = dict(pair.split("=", 1) for pair in properties.get("ENVIRONMENT", []) if pair and not pair.startswith("GTEST_"))
        # What is not built has no command.
        command, second_tier = test.get("command"), "second_tier" in properties.get("LABELS", [])
        if command is None:
            continue
        # Shards are one suite.
        key = (*command, *sorted(more.items()))
        if key in known:
            continue
        known.add(key)
        name = test["name"]
        if all(word.startswith("--gtest_filter=") for word in command[1:]) and command[0].endswith("_test"):
            name = pathlib.Path(command[0]).name + "".join(f" {key}={value}" for key, value in sorted(more.items()))
            suites[name] = GoogleTests(name, command, properties.get("WORKING_DIRECTORY", build), more, second_tier)
        else:
            suites[name] = Program(name, build, second_tier)
    for folder in _PYTHON_FOLDERS:
        for path in sorted((tree.root / folder).glob("test_*.py")) if tree.python.exists() else []:
            name = str(path.relative_to(tree.root))
            suites[name] = PythonFile(name, tree)
    return suites
