"""Where the mutator finds sites, what it makes of them, and that its switches work."""

import os
import pathlib
import shutil
import subprocess
import sys

import cpp_sites
import pytest
import python_sites
import sites


@pytest.mark.parametrize("text, changed", [("0", "1"), ("7", "8"), ("7u", "8u"), ("0x1F", "32"), ("010", "9"), ("1'000", "1001"),
                                           ("0.5", "0.75"), ("0.0", "1.0"), ("2.f", "3.0f"), ("1e3", "1500.0"), (".5", "0.75")])
def test_constants_change(text, changed):
    assert sites.changed_constant(text) == (changed,)


def test_what_is_no_constant_does_not_change():
    assert sites.changed_constant("TWICE") == () and sites.changed_constant("10ms") == ()


def test_cpp_sites_are_what_is_computed(library):
    assert not library.errors
    found = [(site.line, site.original) for site in library.sites()]
    # Neither comments, strings, macros, enums, constexpr, static_assert, labels, default nor template arguments; that
    # `std::array<int, 4>` cannot change the compiler says.
    assert found == [(11, "4"), (12, "+="), (14, "1"), (15, "*"), (18, "0.5"), (18, "*"), (20, "<="), (20, "&&"), (20, "<"),
                     (23, "0"), (24, ">"), (24, "0"), (24, "-="), (24, "1")]


def test_a_site_that_does_not_compile_is_told(library):
    found = {(site.line, site.original): site for site in library.sites()}

    def compiles(*key):
        return library.compiles(1, sites.Mutant(library.path, found[key], found[key].changes[0]))

    assert not compiles(11, "4")
    assert compiles(20, "&&") and compiles(18, "0.5")
    text = cpp_sites.mutated(library.source, 1, sites.Mutant(library.path, found[20, "&&"], "||")).decode()
    assert "(::touchstone_mutant::On(1) ? ((low <= x )||( x < high)) : (low <= x && x < high))" in text


def test_the_drawn_order_stays_when_other_lines_change():
    source = b"int F(int x) {\n  return x + 1;\n}\nint G(int x) {\n  return x - 2;\n}\n"
    longer = b"// A line more.\n" + source.replace(b"int G", b"int Longer(int y) { return 3; }\nint G")

    def order(text):
        found = [site_at(text, operator) for operator in (b"+", b"-")]
        return [mutant.site.original for mutant in sites.in_drawn_order(5, "a.cpp", text, found)]

    def site_at(text, operator):
        at = text.index(operator)
        return sites.Site(at - 2, at + 3, at, at + 1, text.count(b"\n", 0, at) + 1, operator.decode(), sites.OPERATORS[operator.decode()])

    assert order(source) == order(longer)
    assert len({tuple(mutant.site.original for mutant in sites.in_drawn_order(
        seed, "a.cpp", source, [site_at(source, b"+"), site_at(source, b"-")])) for seed in range(20)}) == 2


def test_switches_of_cpp_change_one_expression_and_tell_what_was_reached(program, tmp_path):
    tests, numbers = program
    binary, reached = tests._command[0], tmp_path / "reached"

    def passes(name, mutant=None):
        environment = {name: value for name, value in os.environ.items() if not name.startswith("TOUCHSTONE_")}
        environment["TOUCHSTONE_MUTANT_REACHED"] = str(reached)
        if mutant is not None:
            environment["TOUCHSTONE_MUTANT"] = str(mutant)
        return subprocess.run([binary, f"--gtest_filter={name}"], env=environment, capture_output=True, check=False).returncode == 0

    half, both = numbers[18, "*"], numbers[20, "&&"]
    assert passes("Half.*")
    assert reached.read_text() == f"{half}\n"
    assert passes("Half.*", both)
    assert not passes("Half.*", half) and not passes("Between.*", both)
    assert reached.read_text() == f"{half}\n{half}\n{half}\n{both}\n"  # once per process


PYTHON = '''"""Two < three."""
from __future__ import annotations

import math

LIMIT = 2.5


def f(x, low=1, text="a" + "b"):
    """Below 3."""
    if low <= x < 9 and x != 4:
        return x + LIMIT
    return f"{x + 1}" * 2 or math.pi


@property(3)
def g(x: 5) -> 6:
    return (x
            - 1) / 2
'''


def test_python_sites_are_what_is_computed(tmp_path):
    path = tmp_path / "a.py"
    path.write_text(PYTHON)
    file = python_sites.File(path)
    assert [(site.line, site.original) for site in file.sites()] == [
        (6, "2.5"), (11, "9"), (11, "and"), (11, "!="), (11, "4"), (12, "+"), (13, "2"), (13, "or"),
        (19, "-"), (19, "1"), (19, "/"), (19, "2")]
    assert all(file.compiles(1, mutant) for mutant in sites.in_drawn_order(1, "a.py", file.source, file.sites()))


def test_switches_of_python_change_one_expression_and_tell_what_was_reached(tmp_path):
    package = tmp_path / "touchstone"
    package.mkdir()
    (package / "__init__.py").touch()
    shutil.copy(pathlib.Path(python_sites.__file__).with_name("touchstone_mutant.py"), package / "_mutant.py")
    path = package / "a.py"
    path.write_text('"""Doc."""\nfrom __future__ import annotations\ndef f(x):\n    return x < 3\n')
    file = python_sites.File(path)
    mutant = next(mutant for mutant in sites.in_drawn_order(1, "a.py", file.source, file.sites()) if mutant.site.original == "<")
    mutant.change = ">"
    path.write_bytes(python_sites.mutated(file.source, 7, mutant))

    def run(mutant):
        environment = {**os.environ, "TOUCHSTONE_MUTANT": mutant, "TOUCHSTONE_MUTANT_REACHED": str(tmp_path / "reached"),
                       "PYTHONPATH": str(tmp_path)}
        return subprocess.run([sys.executable, "-c", "from touchstone.a import f; print(f(2), f(4))"], env=environment,
                              capture_output=True, text=True, check=True).stdout.strip()

    assert run("6") == "True False"
    assert run("7") == "False True"
    assert (tmp_path / "reached").read_text() == "7\n7\n"
