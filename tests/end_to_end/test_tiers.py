"""The tiers of the Python tests, as conftest.py of the repository makes them."""
import os
import pathlib
import shutil
import subprocess
import sys

import pytest

ROOT = pathlib.Path(__file__).resolve().parents[2]
TESTS = """
import pytest

def test_quick():
    pass

@pytest.mark.second_tier("long: an hour")
@pytest.mark.parametrize("number", [1, 2])
def test_slow(number):
    pass

@pytest.mark.xdist_group("rig")
def test_of_a_group():
    pass
"""


@pytest.fixture
def run(tmp_path):
    """A function: runs pytest on TESTS in a folder of its own; gives (exit status, output, lines of the times' file)."""
    for name in ("conftest.py", "pytest.ini"):
        shutil.copy(ROOT / name, tmp_path)
    (tmp_path / "test_some.py").write_text(TESTS)

    def go(*options, **environment):
        kept = {name: value for name, value in os.environ.items() if not name.startswith(("TOUCHSTONE_TEST", "PYTEST"))}
        done = subprocess.run([sys.executable, "-m", "pytest", "-q", *options], cwd=tmp_path, capture_output=True, text=True, timeout=60, check=False,
                              env={**kept, "TOUCHSTONE_TEST_TIMES": str(tmp_path / "times"), **environment})
        times = (tmp_path / "times").read_text().splitlines() if (tmp_path / "times").exists() else []
        return done.returncode, done.stdout + done.stderr, sorted(line.split("\t")[1:] for line in times)

    return go


@pytest.fixture(params=["in one process", "in workers"])
def options(request):
    if request.param == "in one process":
        return ()
    pytest.importorskip("xdist", reason="pytest-xdist is not installed (deploy/python-packages.txt)")
    return "-n", "1", "--dist", "loadgroup"


FIRST = [["first", "test_some.py::test_of_a_group"], ["first", "test_some.py::test_quick"]]
SECOND = [["second", f"test_some.py::test_slow[{number}]"] for number in (1, 2)]


def test_the_second_tier_is_left_out_and_counted(run, options):
    status, said, times = run(*options)
    assert status == 0 and "2 passed" in said, said
    assert "2 tests, long: an hour; deploy/test --all runs them" in said
    assert times == FIRST


def test_all_are_run_where_all_are_asked_for(run, options):
    status, said, times = run(*options, TOUCHSTONE_TEST_TIER="all")
    assert status == 0 and "4 passed" in said and "deploy/test --all" not in said, said
    assert times == FIRST + SECOND


@pytest.mark.parametrize("marker, says", [
    ('second_tier', "takes one text"), ('second_tier("slow")', "takes one text"), ('secnd_tier("long: x")', "'secnd_tier' not found"),
])
def test_a_marker_that_says_no_reason_or_is_misspelt_is_an_error(run, tmp_path, marker, says):
    (tmp_path / "test_other.py").write_text(f"import pytest\n@pytest.mark.{marker}\ndef test_a(): pass\n")
    status, said, _ = run()
    assert status != 0 and says in said, said
