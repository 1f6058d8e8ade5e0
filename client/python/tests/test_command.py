"""What the commands in Python share: counts and seeds, progress."""

import argparse
import io
import os
import pty
import sys

import pytest

from touchstone import command
from touchstone.formats import __main__ as formats
from touchstone.progress import Progress, left


@pytest.mark.parametrize("text, value", [("0", 0), ("1000", 1000), ("010", 10), ("1_000_000", 10**6), ("1e6", 10**6), ("1E+6", 10**6),
                                         ("2.5e3", 2500), ("3.0", 3), ("18446744073709551615", 2**64 - 1)])
def test_whole_numbers_are_read_as_people_write_them(text, value):
    assert command.whole_number(text) == value


@pytest.mark.parametrize("text, why", [("-1", "no whole number"), ("1.5", "no whole number"), ("1e-3", "no whole number"),
                                       ("1__0", "no whole number"), ("_1", "no whole number"), ("", "no whole number"),
                                       ("nan", "no whole number"), ("0x10", "no whole number"), ("18446744073709551616", "too large"),
                                       ("1e999999999", "too large")])
def test_other_numbers_are_refused_with_what_would_be_right(text, why):
    with pytest.raises(argparse.ArgumentTypeError, match=why):
        command.whole_number(text)


class Lines(io.StringIO):
    """Text that somebody waits for."""

    def __init__(self):
        super().__init__()
        self.reading, self.writing = os.pipe()

    def write(self, text):
        os.write(self.writing, text.encode())
        return len(text)

    def line(self):
        with os.fdopen(os.dup(self.reading), buffering=1, closefd=True) as reader:
            return reader.readline()


def test_without_a_terminal_lines_come_also_where_the_work_is_silent():
    lines = Lines()
    with Progress(False, lines, first_s=0, interval_s=0.001) as progress:
        progress("reading data", 0.5)
        while not (line := lines.line()).startswith("50 % after "):
            pass
    assert "reading data" in line
    assert "\x1b" not in line


def test_a_terminal_has_one_line_that_is_wiped():
    ours, theirs = pty.openpty()
    with os.fdopen(theirs, "w") as terminal, Progress(False, terminal, first_s=0, interval_s=0.001) as progress:
        progress.rows(5, 20)
        text = ""
        while "25.0 %  5 of 20 rows" not in text:
            text += os.read(ours, 4096).decode()
    rest = text
    while not rest.endswith("\r\x1b[K"):
        rest += os.read(ours, 4096).decode()
    assert "\n" not in rest
    os.close(ours)


def test_what_is_done_at_once_and_what_is_quiet_shows_nothing():
    for quiet, first_s in ((False, 3600), (True, 0)):
        output = io.StringIO()
        with Progress(quiet, output, first_s=first_s) as progress:
            progress("reading", 0.5)
        assert output.getvalue() == ""


def test_the_time_left_is_open_until_it_can_be_told():
    assert left(0.5, 0.1) == ""
    assert left(0.001, 20) == ""
    assert left(0.25, 20) == "1 min 0 s left"


@pytest.mark.parametrize("columns", [60, 80, 120])
@pytest.mark.parametrize("parser", [formats.export_parser, formats.import_parser, formats.verify_parser, formats.recover_parser])
def test_help_is_as_wide_as_the_terminal(parser, columns, monkeypatch):
    monkeypatch.setattr(command, "_columns", lambda: columns)
    monkeypatch.setattr(sys.stdout, "isatty", lambda: True, raising=False)
    lines = parser().format_help().split("\n")
    assert max(map(len, lines)) <= columns
    # An example that was broken goes on behind a backslash.
    assert all(line.endswith(" \\") for line, after in zip(lines, lines[1:]) if line.startswith("  touchstone ") and after.startswith("     -"))
