"""The numbers that the READMEs give of the experiments are those of RESULTS.md, and what they say of the choices is the code's."""

import inspect
import json
import pathlib
import re

import pytest

pytest.importorskip("xgboost", reason="XGBoost is not installed; touchstone.training needs it.")

from touchstone.training import backbone, features, ladder, plans, results_page
from touchstone.training.context import Context
from touchstone.training.experiment import experiments
from touchstone.training.experiments import fusion, image_augmentation, image_recognition, noise_in_training, touches_per_set
from touchstone.training.settings import Settings

TRAINING = pathlib.Path(__file__).resolve().parent.parent
FRONT = " ".join((TRAINING.parent.parent / "README.md").read_text(encoding="utf-8").split())
README = " ".join((TRAINING / "README.md").read_text(encoding="utf-8").split())
RESULTS = (TRAINING / "RESULTS.md").read_text(encoding="utf-8")


def results_of_rigs():
    """[(before %, after %, gain in points)] of each rig, of RESULTS.md."""
    found = re.findall(r"^- (?:\w+) rig: .* ([\d.]+) % \([^)]*\) to ([\d.]+) % \([^)]*\), ([+-][\d.]+) points", RESULTS, re.MULTILINE)
    assert len(found) == len(ladder.RIGS) == 3
    return [tuple(map(float, each)) for each in found]


@pytest.mark.parametrize("page", [FRONT, README], ids=["front page", "client/training"])
def test_what_a_better_model_is_worth_is_said_of_all_rigs_with_their_spread(page):
    rigs = results_of_rigs()
    numbers = lambda pattern: [float(each) for each in re.search(pattern, page).groups()]
    three = r"([\d.]+), ([\d.]+) and ([\d.]+) %"
    assert numbers(rf"the nominal simulation knew {three}") == [before for before, _, _ in rigs]
    assert numbers(rf"the model that the diagnosis found {three}") == [after for _, after, _ in rigs]
    assert numbers(r"([+-][\d.]+), ([+-][\d.]+) and ([+-][\d.]+) points") == [gain for _, _, gain in rigs]


def test_what_single_effects_cost_is_that_of_the_results():
    large_ms, large, small_ms, small = re.search(
        r"A large residual that does not matter: .*?, RMSE (\d+) ms, costs ([+-][\d.]+) points .*? A small one that does: .*?, RMSE (\d+) ms, "
        r"costs ([+-][\d.]+) points", RESULTS).groups()
    said = re.search(r"one effect of (\d+) ms cost (\w+|\d+ points?), one of (\d+) ms cost (\d+) points", FRONT)
    assert said is not None
    assert (said[1], said[3], float(said[4])) == (large_ms, small_ms, round(float(small)))
    assert said[2] == "nothing" and abs(float(large)) < 0.5


def test_the_tables_numbers_are_those_of_the_code(tmp_path):
    sizes = image_recognition.sizes(Context(Settings(tmp_path)))
    for said in (
            f"{touches_per_set.TRAINING_TOUCHES} virtual, {noise_in_training.REAL} measured, 768 = 80 % of 960",
            f"poses are parted, so {960 - 5 * round(noise_in_training.TEST_SHARE * 192)} of 960",
            f"{plans.SIGMA_US / 1e6:g} as the standard deviation", f"{plans.SIGMA_US / 1e6 * 20:.2f} mm at our speed", "**20 mm/s, 30 mm**",
            f"averaged to {backbone.MAP_SIDE} x {backbone.MAP_SIDE}", f"{sizes.train_per_object} an object",
            (f"{sizes.measured_train} in training, {image_augmentation.COPIES * sizes.measured_train} scaled copies "
             f"({(1 + image_augmentation.COPIES) * sizes.measured_train} together), {sizes.measured_test} in testing"),
            f"({fusion.per_set(Context(Settings(tmp_path)))} here)"):
        assert said in README, said
    assert "spacing_mm: 30" in plans.NOISY and plans.measured(Settings(tmp_path)).samples(5) == 960
    assert inspect.signature(features.drawn_sets).parameters["features"].default is features.curvatures, "what every experiment uses"


def test_every_experiment_is_in_the_readme():
    for each in experiments():
        assert f"| `{each.name}` |" in README


def test_the_results_name_command_and_seeds_of_every_table():
    sections = RESULTS.split("\n## ")[1:]
    assert len(sections) == len(experiments())
    for section in sections:
        assert re.search(r"^`python -m touchstone\.training [^`]*`, \d+ seeds", section, re.MULTILINE), section[:200]


def test_the_results_page_has_every_number_of_its_report():
    result = {"name": "fusion", "title": "Fusion", "made_on": ["a"], "words": ["It is 5 %."], "seconds": 3.0, "data": {}, "figures": [],
              "comparisons": [{"what": "x", "ours": {"value": 0.5, "low": None, "high": 0.6}, "seeds": None, "made_on": "m", "why": "w"}],
              "tables": [{"title": "T", "columns": ["a", "b"], "rows": [["1", "x|y"]], "note": "n"}]}
    report = {"about": ["Seeds 1 to 4; intervals"], "command": "python -m touchstone.training all --out /tmp/x --seeds 4",
              "experiments": [result]}
    text = results_page.page([json.loads(json.dumps(report))], "On a day.")
    for part in (
            "`python -m touchstone.training fusion --seeds 4`, 4 seeds, 3 s", "- It is 5 %.",
            "| x | 50.0 % (? to 60.0) | shown without numbers | w |",
                 "| 1 | x\\|y |", "\nn\n"):
        assert part in text
    # A section of an earlier page stays where no report has its experiment, and goes where one has.
    earlier = "# Old\n\n## Fusion of touch and sight\n\nold fusion\n\n## A million samples, streamed into training\n\nold stream\n"
    later = results_page.page([report], "On a day.", earlier)
    assert "old stream" in later and "old fusion" not in later
