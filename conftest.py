"""The two tiers of the Python tests, and the time that each test takes.

TOUCHSTONE_TEST_TIER=all runs the tests that are marked second_tier too; without it they are left out, and the summary counts
them. TOUCHSTONE_TEST_TIMES names a file for a line per test that ran: seconds of set-up, call and teardown, tier ("first" or
"second") and the test's id, separated by tabs. Both work alike with and without pytest-xdist.
"""

import collections
import os
import pathlib
import re
import signal

import pytest

_MARKER = "second_tier"
_KINDS = ("statistical: ", "repeated: ", "long: ")
_GROUP = re.compile(r"@\w+$")  # which pytest-xdist appends to the id of a test with an xdist_group
_COUNTS = pytest.StashKey[collections.Counter]()


class _Times:
    """Writes a line per test as soon as its teardown is reported, in the process that hears of all tests."""

    def __init__(self, path):
        self._path = pathlib.Path(path)
        self._path.write_text("")
        self._seconds = collections.Counter()

    def pytest_runtest_logreport(self, report):
        self._seconds[report.nodeid] += report.duration
        if report.when == "teardown":
            tier = "second" if _MARKER in report.keywords else "first"
            with self._path.open("a", encoding="utf-8") as file:
                file.write(f"{self._seconds.pop(report.nodeid):.3f}\t{tier}\t{_GROUP.sub('', report.nodeid)}\n")


def pytest_configure(config):
    config.addinivalue_line("markers", f"{_MARKER}(why): runs only with TOUCHSTONE_TEST_TIER=all; why begins with one of: "
                                       + ", ".join(map(repr, _KINDS)))
    # Of pytest-xdist, which may not be there.
    config.addinivalue_line("markers", "xdist_group(name): tests that run in the same process")
    config.stash[_COUNTS] = collections.Counter()
    if hasattr(config, "workerinput"):
        # Each worker has a core, and programs that it starts; threads of matrix products that wait for one another do not fit.
        os.environ.setdefault("OMP_NUM_THREADS", "1")
    # For programs that tests start, and for touchstone.connect() without an address.
    os.environ.setdefault("TOUCHSTONE_SERVER_PROGRAM", str(config.rootpath / "build/release/bin/touchstone-server"))
    os.environ.pop("TOUCHSTONE_SERVER", None)
    # Tests talk to this machine; a test of a proxy sets its own.
    for name in ("http_proxy", "https_proxy", "grpc_proxy", "all_proxy"):
        os.environ.pop(name, None)
        os.environ.pop(name.upper(), None)
    path = os.environ.get("TOUCHSTONE_TEST_TIMES")
    if path and not hasattr(config, "workerinput"):
        config.pluginmanager.register(_Times(path))


@pytest.fixture(scope="session")
def stop_and_wait():
    """Stops a child process and returns once all of its threads stand: kill() returns before, and a thread may still answer."""
    def stop(process):
        process.send_signal(signal.SIGSTOP)
        # Also where it ended instead; its exit status is left for its owner.
        os.waitid(os.P_PID, process.pid, os.WSTOPPED | os.WEXITED | os.WNOWAIT)

    return stop


def _reason(item):
    """Why a test is of the second tier; None where it is of the first."""
    marker = item.get_closest_marker(_MARKER)
    if marker is None:
        return None
    if len(marker.args) != 1 or marker.kwargs or not str(marker.args[0]).startswith(_KINDS):
        raise pytest.UsageError(f"{item.nodeid}: {_MARKER} takes one text that begins with one of {_KINDS}")
    return marker.args[0]


def pytest_collection_modifyitems(config, items):
    reasons = [_reason(item) for item in items]
    if os.environ.get("TOUCHSTONE_TEST_TIER") == "all":
        return
    config.stash[_COUNTS].update(filter(None, reasons))
    config.hook.pytest_deselected(items=[item for item, reason in zip(items, reasons) if reason])
    items[:] = [item for item, reason in zip(items, reasons) if not reason]


def pytest_sessionfinish(session):
    if hasattr(session.config, "workeroutput"):
        session.config.workeroutput[_MARKER] = dict(session.config.stash[_COUNTS])


@pytest.hookimpl(optionalhook=True)
def pytest_testnodedown(node):
    # Every worker collects all tests, and counts the same.
    node.config.stash[_COUNTS] = collections.Counter(getattr(node, "workeroutput", {}).get(_MARKER, {}))


def pytest_terminal_summary(terminalreporter, config):
    counts = config.stash[_COUNTS]
    if counts:
        terminalreporter.section("left to the second tier")
        for reason, count in sorted(counts.items()):
            terminalreporter.line(f"{count} {'test' if count == 1 else 'tests'}, {reason}; deploy/test --all runs them")
