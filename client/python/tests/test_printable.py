"""What comes from a source, a file or a person stays one line as it is, in messages and reprs."""

import pytest

from touchstone.errors import TouchstoneError
from touchstone.printable import printable
from touchstone.report import Report
from touchstone.samples import Samples
from touchstone.v1 import diagnosis_pb2, source_pb2

TURNED, SHOWN = "left \u202ethgir\x1b[31m", r"left \xe2\x80\xaethgir\x1b[31m"


@pytest.mark.parametrize("text, shown", [
    (TURNED, SHOWN), ("Jürgen 木 ok", "Jürgen 木 ok"), ("two\nlines", "two\nlines"), ("a\rb\x00", r"a\x0db\x00"),
    ("\u2028\u200b\x9b", r"\xe2\x80\xa8\xe2\x80\x8b\xc2\x9b"),
    ("\udc80", r"\xed\xb2\x80")])
def test_what_turns_hides_or_ends_a_line_is_escaped(text, shown):
    assert printable(text) == shown


def test_errors_and_reprs_are_printable():
    message = diagnosis_pb2.Report(summary=TURNED)
    message.steps.add(effect=TURNED)
    samples = object.__new__(Samples)
    samples.spec = source_pb2.DatasetSpec(objects=[TURNED], samples=3)
    report = Report(message)
    for said in (str(TouchstoneError(TURNED)), str(report), repr(report), repr(samples)):
        assert SHOWN in said and TURNED not in said
