"""read_plan() takes and refuses the files that the command line does: both read the same ones here."""
import math
import os
import pathlib
import subprocess

import numpy as np
import pytest

import touchstone
from touchstone.own_server import find_server

HEAD = ("touch,object,speed_mm_s,standoff_mm,target_x_mm,target_y_mm,target_z_mm,approach_x,approach_y,approach_z,"
        "lateral_x,lateral_y,lateral_z,t_l_us,t_m_us,t_r_us,session_time_s,round,face,cov_room")
ROWS = ("3,lat20,20,60.5,0,1.5,0,0,0,-1,1,0,0,1000000.25,1000100.5,,12.5,0,4,21.5",
        '7,"lat20, left",20,60,0,0,0,-1,0,0,0,1,0,1000000,1000200,1000300,20,1,0,')
PLAIN = "\n".join((HEAD, *ROWS)) + "\n"


def replaced(old, new):
    assert old in PLAIN
    return PLAIN.replace(old, new, 1).encode()


def decimal_commas(separator):
    return "\n".join(separator.join(field.replace(".", ",") for field in line.split(",")) for line in (HEAD, ROWS[0])).encode() + b"\n"


GOOD = {
    "plain": PLAIN.encode(), "bom": b"\xef\xbb\xbf" + PLAIN.encode(), "utf16": PLAIN.encode("utf-16"), "crlf": PLAIN.replace("\n", "\r\n").encode(),
    "blanks": PLAIN.replace("\n", "\n\n").replace(",", ", ").encode(), "semicolons": decimal_commas(";"), "tabs": decimal_commas("\t"),
    "sep": b"sep=;\n" + decimal_commas(";"), "minus": replaced(",-1,1,0,0", ",\u22121,1,0,0"),
}
BAD = {
    "number twice": replaced("\n7,", "\n3,"), "column twice": replaced("cov_room", "round"), "unknown column": replaced("cov_room", "room"),
    "no speed": replaced("lat20,20,60.5", "lat20,0,60.5"), "standoff": replaced("lat20,20,60.5", "lat20,20,-1"),
    "no unit vector": replaced("0,0,-1,1,0,0,1000000.25", "0,0,-0.9,1,0,0,1000000.25"),
    "no right angle": replaced("0,0,-1,1,0,0,1000000.25", "0,0,-1,0.6,0,0.8,1000000.25"),
    "infinite time": replaced("1000000.25", "inf"), "negative time": replaced("1000000.25", "-1"), "time of ages": replaced("1000000.25", "1e300"),
    "no target": replaced("target_z_mm", "cov_z"), "no touch": replaced("touch,", "cov_touch,"), "half a number": replaced("\n7,", "\n7.5,"),
    "underscore": replaced("1000000.25", "1_000"), "word": replaced("12.5", "noon"), "cell too many": replaced("21.5", "21.5,1"),
    "finger missing": replaced("t_m_us", "cov_m"), "thousands": replaced("1000000.25", '"1,000,000.25"'), "header alone": (HEAD + "\n").encode(),
    "no file": b"", "no text": b"\xff\xfe\x00", "negative round": replaced(",12.5,0,4,", ",12.5,-1,4,"),
}


@pytest.fixture
def command_takes(tmp_path):
    program = os.environ.get("TOUCHSTONE_PROGRAM") or pathlib.Path(find_server()).parent / "touchstone"

    def takes(path):
        words = ["session", "import", path, "-o", tmp_path / "set.db"]
        done = subprocess.run([program, *words], capture_output=True, text=True, timeout=60, check=False)
        assert done.returncode in (0, 2), done.stderr
        return done.returncode == 0

    return takes


@pytest.mark.parametrize("kind", GOOD)
def test_a_file_as_spreadsheets_write_it_is_read(kind, tmp_path, command_takes):
    path = tmp_path / "set.csv"
    path.write_bytes(GOOD[kind])
    row = touchstone.read_plan(path)[0]
    assert command_takes(path)
    assert (row.touch, row.object, row.round, row.face, row.session_time_s) == (3, "lat20", 0, 4, 12.5)
    assert row.time_us[:2] == (1000000.25, 1000100.5) and math.isnan(row.time_us[2])
    assert row.command.standoff_mm[0] == 60.5 and row.command.target_mm[0].tolist() == [0, 1.5, 0]
    np.testing.assert_array_equal(row.command.approach, [[0, 0, -1]])
    assert row.command.covariates["cov_room"].tolist() == [21.5]


@pytest.mark.parametrize("kind", BAD)
def test_what_the_command_line_refuses_is_refused_with_its_place(kind, tmp_path, command_takes):
    path = tmp_path / "set.csv"
    path.write_bytes(BAD[kind])
    with pytest.raises(touchstone.InvalidRequest, match=r"set\.csv"):
        touchstone.read_plan(path)
    assert not command_takes(path)


def test_what_is_read_is_written_again_as_it_was(tmp_path):
    (tmp_path / "set.csv").write_text(PLAIN)
    touchstone.write_measurements(tmp_path / "again.csv", touchstone.read_plan(tmp_path / "set.csv"))
    assert touchstone.read_plan(tmp_path / "again.csv")[1].object == "lat20, left"
    header, *rows = (tmp_path / "again.csv").read_text().splitlines()
    assert header == HEAD and len(rows) == 2 and rows[0].endswith(",12.5,0,4,21.5")
