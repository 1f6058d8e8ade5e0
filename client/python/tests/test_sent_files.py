"""Errors about a model file name the user's file, whatever call sent it."""

import pytest

import touchstone

WRONG = "touchstone: model/1\nname: mine\neffects:\n  - tip_radius: {radius_mm: -1}\n"
RIGHT = "touchstone: model/1\nname: right\neffects: []\n"
SET = ("touch,object,speed_mm_s,standoff_mm,target_x_mm,target_y_mm,target_z_mm,approach_x,approach_y,approach_z,"
       "lateral_x,lateral_y,lateral_z,t_l_us,t_m_us,t_r_us\n0,lat10,20,60,0,0,0,0,0,-1,1,0,0,100,0,100\n")


@pytest.fixture
def files(tmp_path):
    for name, text in {"wrong.yaml": WRONG, "right.yaml": RIGHT, "set.csv": SET, "own.yaml": WRONG}.items():
        (tmp_path / name).write_text(text)
    return tmp_path


CALLS = {
    "compare": lambda client, files: client.compare(files / "set.csv", files / "wrong.yaml"),
    "diagnose": lambda client, files: client.diagnose(files / "set.csv", str(files / "wrong.yaml")),
    "compare with another": lambda client, files: client.compare(
        files / "set.csv", files / "right.yaml", other_model=files / "wrong.yaml"),
    "plan": lambda client, files: client.plan(touchstone.faces(), "lat10", model=files / "wrong.yaml"),
    "touch": lambda client, files: client.touch(
        "lat10", client.plan(touchstone.faces(), "lat10", count=1), model=files / "wrong.yaml"),
    "dataset": lambda client, files: next(iter(client.dataset("lat10", samples=2, model=files / "wrong.yaml"))),
    "model": lambda client, files: client.model(files / "wrong.yaml"),
}


@pytest.mark.parametrize("call", CALLS)
def test_an_error_begins_with_the_path_line_and_column(server, files, call):
    with pytest.raises(touchstone.InvalidRequest) as raised:
        CALLS[call](touchstone.connect(server.target), files)
    assert str(raised.value).startswith(f"{files / 'wrong.yaml'}:4:")


def test_effects_of_the_users_own_are_named_too(server, files):
    with pytest.raises(touchstone.InvalidRequest) as raised:
        touchstone.connect(server.target).diagnose(files / "set.csv", files / "right.yaml", also=[files / "own.yaml"])
    assert str(raised.value).startswith(f"{files / 'own.yaml'}:4:")


def test_a_text_that_never_was_a_file_has_no_path(server, files):
    with pytest.raises(touchstone.InvalidRequest, match=r"^model\.yaml:4:"):
        touchstone.connect(server.target).compare(files / "set.csv", WRONG.replace("mine", "never_a_file"))
