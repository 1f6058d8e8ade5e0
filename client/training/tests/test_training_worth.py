"""What a better model is worth to a user's recogniser: sets with a known truth, the intervals, and mistakes of the user's file."""

import json
import math
import pathlib
import re
import subprocess
import sys

import numpy as np
import pytest

pytest.importorskip("xgboost", reason="XGBoost is not installed; touchstone.training needs it.")

import touchstone
from touchstone.training import ladder
from touchstone.training.touch_data import collect
from touchstone.training.worth import FileError, Worth, __main__ as command_line, worth
from touchstone.training.worth.__main__ import main
from touchstone.training.worth.intervals import Resampling, exchange

OBJECTS = ("lat00", "lat10", "lat20")
# With the size of better_model's ALONE: the tilt cancels in the curvature, what one finger adds does not.
TILT = "  - tool_tilt: {angle_deg: 1.5}\n"
LONGER = "  - finger_length: {offset_mm: [-0.4536, 0.9072, -0.4536]}\n"
# Fast, so that a test takes a second.
BAYES = """from sklearn.naive_bayes import GaussianNB

def fit(features, labels, seed):
    return GaussianNB(var_smoothing=1e-3).fit(features, labels)
"""


@pytest.fixture(scope="module")
def client():
    with touchstone.connect() as connected:
        yield connected


@pytest.fixture(scope="module")
def folder(client, tmp_path_factory):
    """A set of a rig whose tool is tilted and whose middle finger is longer, and models."""
    folder = tmp_path_factory.mktemp("worth")
    (folder / "nominal.yaml").write_text(ladder.NOMINAL)
    (folder / "tilted.yaml").write_text(ladder.NOMINAL.replace("nominal", "tilted") + TILT)
    (folder / "better.yaml").write_text(ladder.NOMINAL.replace("nominal", "better") + TILT + LONGER)
    (folder / "bayes.py").write_text(BAYES)
    plan = touchstone.faces(samples_per_face=14, rounds=1)
    ladder.write_set(collect(client, OBJECTS, plan, 252, model=ladder.NOMINAL + TILT + LONGER, seed=99), folder / "set.csv")
    ladder.write_set(collect(client, OBJECTS, plan, 252, model=ladder.NOMINAL + TILT, seed=98), folder / "tilted.csv")
    return folder


def ask(folder, client, measurements="set.csv", better="better.yaml", train="bayes.py", **how) -> Worth:
    return worth(folder / measurements, folder / "nominal.yaml", folder / better, folder / train, client=client,
                 **{"samples": 240, "seeds": 3, **how})


@pytest.fixture(scope="module")
def found(folder, client):
    return ask(folder, client)


def test_a_better_model_wins_where_the_effect_harms_recognition(found):
    nominal, tilt, longer = found.steps
    assert [each.rung.name for each in found.steps] == ["nominal", "+ tool_tilt", "+ finger_length"]
    assert longer.gain.low > 0.1 and found.words[0].startswith("Worth it: ")
    assert nominal.accuracy.low <= nominal.accuracy.value <= nominal.accuracy.high
    assert longer.rung.rmse_us == pytest.approx(ladder.SIGMA_US, rel=0.1) and longer.rmse_change_us.high < 0
    # The gains of the steps are those of the accuracies.
    assert longer.gain.value == pytest.approx(longer.accuracy.value - nominal.accuracy.value)
    assert tilt.step.value + longer.step.value == pytest.approx(longer.gain.value)


def test_an_effect_that_lowers_the_error_and_not_the_mistakes_is_said_to(folder, client):
    found = ask(folder, client, "tilted.csv", "tilted.yaml")
    (_, tilt) = found.steps
    assert tilt.rung.rmse_us < 0.3 * found.steps[0].rung.rmse_us
    assert abs(tilt.gain.value) < 0.02 and tilt.judgement().startswith("lowers the error and not the mistakes")
    assert found.words[0].startswith("Not shown to be worth it") and "is excluded" in found.words[0]
    assert any(each.startswith("+ tool_tilt: lowers the error and not the mistakes") for each in found.words)


def test_the_recogniser_may_choose_what_it_sees(folder, client):
    (folder / "blind.py").write_text(BAYES + """
def features(times_us, speed_mm_s, spacing_mm):
    assert times_us.shape[1:] == (8, 3) and times_us.min() == 0 and (speed_mm_s, spacing_mm) == (20, 30)
    return 0 * times_us[:, :, 0]
""")
    blind = ask(folder, client, train="blind.py")
    assert all(each.accuracy.value == pytest.approx(1 / 3) for each in blind.steps)  # the same answer to every set
    assert blind.own.value == pytest.approx(1 / 3)


def test_equal_models_have_no_step_between_them(folder, client):
    found = ask(folder, client, better="nominal.yaml")
    assert len(found.steps) == 1 and "the same effects" in found.words[0] and not found.cautions
    assert found.to_dict()["steps"][0]["gain"] is None


def test_a_measured_touch_is_worth_more_of_the_worse_model(found):
    assert found.own.value > found.steps[0].accuracy.value
    assert math.isinf(found.exchange["nominal"].value) and found.exchange["better"].value < found.exchange["nominal"].value
    assert found.to_dict()["simulated_per_measured"]["nominal"]["value"] is None
    assert found.own_touches < found.about["touches"]


def test_it_is_a_table_and_a_figure(found):
    table = found._table()
    assert table["trained_on"] == ["nominal", "+ tool_tilt", "+ finger_length", "measured touches"]
    assert table["accuracy"][-1] == found.own.value and table["gain"][0] is None and table["gain_low"][2] == found.steps[2].gain.low
    assert "Caution" in found._repr_html_() and found._repr_html_().count("<tr>") == 5
    assert found.plot().get_xlabel() == "trained on"


def test_what_the_better_model_was_fitted_to_is_not_tested(folder, client):
    lines = (folder / "set.csv").read_text().splitlines(keepends=True)
    (folder / "fitted.csv").write_text("".join([lines[0], *lines[1:84]]))
    found = ask(folder, client, "tilted.csv", fitted=folder / "fitted.csv", seeds=2)
    assert found.about["fitted"] == 0 and not any("not known" in each for each in found.cautions)
    left = ask(folder, client, fitted=folder / "fitted.csv", touches=4, seeds=2, poses="set")
    assert left.about["fitted"] == 83 and left.about["touches"] == 252 - 83
    assert any("it is not known whether the better model was fitted" in each for each in ask(folder, client, seeds=2).cautions)
    with pytest.raises(touchstone.InvalidRequest, match=r"every pose is also in .*set\.csv"):
        ask(folder, client, fitted=folder / "set.csv")


def test_the_same_seed_gives_the_same_answer(folder, client, found):
    assert ask(folder, client).to_dict() == found.to_dict()


@pytest.mark.second_tier("statistical: 60 sets, each asked anew")
def test_intervals_of_the_gain_hold_what_a_large_set_says(folder, client, tmp_path):
    slight = ladder.NOMINAL + "  - finger_length: {offset_mm: [-0.15, 0.3, -0.15]}\n"
    (tmp_path / "slight.yaml").write_text(slight)

    def ask_of(per_face, poses, **how):
        plan = touchstone.faces(samples_per_face=per_face, rounds=1)
        ladder.write_set(collect(client, OBJECTS, plan, 18 * per_face, model=slight, seed=poses), tmp_path / "set.csv")
        return ask(folder, client, tmp_path / "set.csv", tmp_path / "slight.yaml", **how).steps[-1].gain

    truth = ask_of(400, 12345, seeds=30)
    found = [ask_of(14, 1000 + k, seeds=5, seed=100 + 10 * k) for k in range(60)]
    # Of 60 at 95 % fewer than 52 would come once in 300 times.
    assert sum(each.low <= truth.value <= each.high for each in found) >= 52
    assert np.mean([each.low > 0 for each in found]) > 0.9


# --- mistakes


@pytest.mark.parametrize("text, says", [
    ("def fit(features, labels, seed):\n    x = 1\n    return 1 / (x - 1)\n", r"wrong\.py:3: fit\(\) raised ZeroDivisionError"),
    ("def fit(features, labels, seed)\n    return 1\n", r"wrong\.py:1: "),
    ("def train():\n    pass\n", r"wrong\.py has no function fit\(features, labels, seed\)"),
    ("\nimport nothing_there\n", r"wrong\.py:2: the file raised ModuleNotFoundError"),
    ("def fit(f, l, s):\n    return 3\n", r"wrong\.py:1: fit\(\) returned int, which has no predict"),
    ("class A:\n    def predict(self, f):\n        return f[:, 0] * 0 + 7\ndef fit(f, l, s):\n    return A()\n",
     r"wrong\.py:2: predict\(\) gave 7\.0; labels are whole numbers from 0 to 2"),
    ("class A:\n    def predict(self, f):\n        return f.nothing\ndef fit(f, l, s):\n    return A()\n", r"wrong\.py:3: predict\(\) raised Attr"),
    ("def fit(f, l, s):\n    raise SystemExit(0)\n", r"wrong\.py:2: fit\(\) raised SystemExit"),
])
def test_a_mistake_of_the_recognisers_file_names_file_and_line(folder, client, text, says):
    (folder / "wrong.py").write_text(text)
    with pytest.raises(FileError, match=says):
        ask(folder, client, train="wrong.py")


def test_a_set_that_does_not_do_is_refused_in_words(folder, client):
    lines = (folder / "set.csv").read_text().splitlines(keepends=True)
    (folder / "one.csv").write_text("".join([lines[0], *(line for line in lines if ",lat00," in line)]))
    with pytest.raises(touchstone.InvalidRequest, match="touches of one object, lat00; a recogniser tells two or more apart"):
        ask(folder, client, "one.csv")
    (folder / "few.csv").write_text("".join(lines[:40]))
    with pytest.raises(touchstone.InvalidRequest, match=r"13 poses of lat00 .* sets of 8 touches need 16"):
        ask(folder, client, "few.csv")
    (folder / "cup.csv").write_text("".join(lines).replace("lat10", "cup"))
    with pytest.raises(touchstone.InvalidRequest, match="touches of cup, which the source does not have"):
        ask(folder, client, "cup.csv")
    (folder / "two.csv").write_text("".join([*lines[:-1], lines[-1].replace(",20.0,", ",40.0,", 1)]))
    with pytest.raises(touchstone.InvalidRequest, match="touches at 20 and 40 mm/s"):
        ask(folder, client, "two.csv")


def test_the_command_writes_what_the_function_gives(folder, client, found, capsys, tmp_path):
    asked = [str(folder / "set.csv"), "--model", str(folder / "nominal.yaml"), "--better", str(folder / "better.yaml"), "--train",
             str(folder / "bayes.py"), "--server", client.target, "--samples", "240", "--seeds", "3"]
    main([*asked, "--figure", str(tmp_path / "w.svg")])
    told = capsys.readouterr().out
    assert told.startswith("Worth it: ") and "+ finger_length" in told
    assert "<svg" in (tmp_path / "w.svg").read_text()
    main([*asked, "--json"])
    assert json.loads(capsys.readouterr().out) == json.loads(json.dumps(found.to_dict()))
    with pytest.raises(touchstone.InvalidRequest, match="--mesh: works only without --server"):
        main([*asked, "--mesh", "cup=cup.off"])
    (tmp_path / "w.svg").write_text("mine")
    with pytest.raises(touchstone.InvalidRequest, match=r"w\.svg: exists already; --force replaces it"):
        main([*asked, "--figure", str(tmp_path / "w.svg")])
    assert (tmp_path / "w.svg").read_text() == "mine"


def test_the_program_completes_the_options_of_the_module():
    rows = (pathlib.Path(__file__).resolve().parents[2] / "cli/python_command.cpp").read_text(encoding="utf-8")
    listed = re.search(r'"touchstone\.training\.worth", "", "touchstone-training",([^}]*)}', rows)
    assert listed is not None
    known = {name for action in command_line._parser()._actions for name in action.option_strings}
    assert set(re.findall(r"--?[a-z-]+", listed[1])) == known


def test_the_module_is_a_command_that_ends_without_a_traceback(folder):
    done = subprocess.run([sys.executable, "-m", "touchstone.training.worth", "no.csv", "--model", folder / "nominal.yaml", "--better",
                           folder / "better.yaml"], capture_output=True, text=True, check=False)
    assert done.returncode == 2 and done.stderr == "touchstone: error: no.csv: No such file or directory.\n"


# --- steps


def test_steps_stand_in_the_order_of_the_better_models_file():
    nominal = ladder.NOMINAL + "  - tip_radius: {radius_mm: 1}\n"
    lookup = "  - lookup:\n      name: rest\n      adds: travel_mm\n      covariate: travel_mm\n      knots: [0, 1]\n      values: [0, 1]\n"
    better = ladder.NOMINAL + LONGER + "  - tip_radius: {radius_mm: 2}\n" + lookup
    names, models = zip(*ladder.between(nominal, better))
    assert names == ("nominal", "+ finger_length", "+ rest") and models[-1] == better
    assert "radius_mm: 2" in models[1] and "lookup" not in models[1]  # refitted values come with the first step
    only_values = ladder.between(nominal, nominal.replace("radius_mm: 1", "radius_mm: 3"))
    assert [name for name, _ in only_values] == ["nominal", "+ refitted values"]
    assert len(ladder.between(nominal, nominal.replace("name: nominal", "name: other"))) == 1
    saved = better + "provenance:\n  fitted_to:\n    - {set: set.csv}\n"  # what the model was fitted to is no effect
    assert ladder.between(nominal, saved) == list(zip(names, models))
    assert ladder.between("touchstone: model/1\nname: a\neffects: []\n", "touchstone: model/1\nname: a\neffects:\n" + TILT)[-1][0] == "+ tool_tilt"


# --- intervals


def test_intervals_cover_the_truth_of_groups_and_seeds():
    rng = np.random.default_rng(1)
    held = []
    for _ in range(200):
        logit = 0.5 + rng.normal(0, 0.7, (1, 60)) + rng.normal(0, 0.3, (5, 1))
        cells = (rng.random((5, 60)) < 1 / (1 + np.exp(-logit))).astype(float)
        truth = np.mean(1 / (1 + np.exp(-(0.5 + np.hypot(0.7, 0.3) * np.random.default_rng(2).normal(size=20_000)))))
        found = Resampling(np.arange(60) % 3, 5, rng, 400).estimate(cells)
        held.append(found.low <= truth <= found.high)
    assert 0.9 <= np.mean(held)


def test_cells_that_are_all_alike_still_leave_something_open():
    draws = Resampling(np.zeros(20, int), 3, np.random.default_rng(1))
    all_right = draws.estimate(np.ones((3, 20)))
    assert all_right.high == 1 and all_right.low == pytest.approx(0.025 ** (1 / 20))
    none = draws.difference(np.ones((3, 20)), np.ones((3, 20)))
    assert (none.value, none.low, none.high) == pytest.approx((0, -(1 - 0.025 ** (1 / 20)), 1 - 0.025 ** (1 / 20)))


def test_the_exchange_rate_is_read_off_the_learning_curve():
    # Deterministic cells of half of the groups: accuracy 0.25, 0.5, 0.75, 1 at 100, 200, 400, 800 simulated touches.
    cells = [np.tile(np.arange(4) <= k, (2, 30)).astype(float) for k in range(4)]
    curve = list(zip((100, 200, 400, 800), cells))
    draws = Resampling(np.zeros(120, int), 2, np.random.default_rng(1))
    half = exchange(cells[1], 50, curve, draws)
    assert half.value == pytest.approx(4) and half.low == pytest.approx(4) and half.high == pytest.approx(4)
    assert exchange(cells[3], 50, curve[:3], draws).value == math.inf
    assert exchange(np.zeros((2, 120)), 50, curve, draws).value == 0
    assert "more than 8" in exchange(cells[3], 50, curve[:3], draws).words()
