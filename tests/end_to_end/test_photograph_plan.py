"""A plan of photographs, as `touchstone propose FOLDER` writes it, taken by the emulated rig."""
import csv
import json
import subprocess

import pytest

from test_rig_commands import BIN, PATIENCE_S, SPEEDUP, emulated_rig, touchstone

# The emulated rig exists once.
pytestmark = pytest.mark.xdist_group("photograph_plan")
COLUMNS = ["image", "file", "object", "eye_x_mm", "eye_y_mm", "eye_z_mm", "at_x_mm", "at_y_mm", "at_z_mm", "up_x", "up_y",
           "up_z"]


@pytest.fixture(scope="module")
def rig(tmp_path_factory):
    with emulated_rig(tmp_path_factory.mktemp("rig"), SPEEDUP, "--seed", "3") as address:
        yield address


def rows_of(path):
    with open(path, newline="") as file:
        return list(csv.DictReader(file))


def write_plan(path, rows):
    with open(path, "w", newline="") as file:
        writer = csv.DictWriter(file, COLUMNS)
        writer.writeheader()
        writer.writerows({column: row[column] for column in COLUMNS} for row in rows)


def test_rig_photos_takes_the_rows_of_a_plan(rig, tmp_path):
    options = ["--image", "64x48", "--json"]
    touchstone("rig", "photos", "lat20", "-o", tmp_path / "ring", "--sequence", "seed", "--turns", "1", *options, server=rig)
    # Views that the rig can take, turned about the viewing axis, in a plan with one of another object.
    views = [dict(row, image=n, file=f"lat20_from_{n}.png", up_x=row["up_y"], up_y=1)
             for n, row in enumerate(rows_of(tmp_path / "ring/images.csv")[:2])]
    plan = tmp_path / "next.csv"
    write_plan(plan, [*views, dict(views[0], image=2, file="other.png", object="lat10")])
    command = ["rig", "photos", "lat20", "--plan", plan, "-o", tmp_path / "more", *options]
    taken = json.loads(touchstone(*command, server=rig))
    rows = rows_of(tmp_path / "more/images.csv")
    assert taken["left_out"] == 0 and [row["file"] for row in rows] == [view["file"] for view in views]
    for row, view in zip(rows, views):
        for column in COLUMNS[3:]:
            assert float(row[column]) == pytest.approx(float(view[column]), abs=1e-6), (row["file"], column)
    # Again, nothing is taken twice.
    assert json.loads(touchstone(*command, server=rig))["kept"] == 2

    absent = ["rig", "photos", "lat00", "--plan", plan, "-o", tmp_path / "none", *options]
    assert "has no picture of 'lat00'; it has pictures of lat20, lat10" in touchstone(*absent, server=rig, code=2)
    touches = tmp_path / "touches.csv"
    touchstone("plan", "lat20", "--plan", "faces", "--samples-per-face", "1", "--rounds", "1", "-o", touches)
    wrong = ["rig", "photos", "lat20", "--plan", touches, "-o", tmp_path / "none", *options]
    assert "is no plan of photographs" in touchstone(*wrong, server=rig, code=2)


def test_a_picture_that_the_rig_cannot_take_is_named_with_quiet_and_in_json(rig, tmp_path):
    view = dict(image=0, file="near.png", object="lat20", eye_x_mm=0, eye_y_mm=0, eye_z_mm=300, at_x_mm=0, at_y_mm=0, at_z_mm=0,
                up_x=1, up_y=0, up_z=0)
    write_plan(tmp_path / "next.csv", [view, dict(view, image=1, file="far.png", eye_z_mm=9000)])
    command = [BIN / "touchstone", "rig", "photos", "lat20", "--plan", tmp_path / "next.csv", "-o", tmp_path / "taken", "--image", "64x48",
               "--quiet", "--json", "--server", rig]
    result = subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE_S, stdin=subprocess.DEVNULL, check=True)
    taken = json.loads(result.stdout)
    assert [row["file"] for row in rows_of(tmp_path / "taken/images.csv")] == ["near.png"] and taken["left_out"] == 1
    (left_out,) = taken["impossible"]
    assert left_out["file"] == "far.png" and left_out["reason"]
    assert "far.png" in result.stderr and "1 of 2 views is left out; nothing has moved yet" in result.stderr
    assert "near.png" not in result.stderr
