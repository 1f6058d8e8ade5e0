"""The numbers of the front page are those that its commands print."""

import json
import pathlib
import re
import shlex
import subprocess

import pytest

from touchstone.own_server import find_server

ROOT = pathlib.Path(__file__).resolve().parents[3]
README = (ROOT / "README.md").read_text(encoding="utf-8")
_NUMBER = r"(\d+(?:\.\d+)?)"


@pytest.fixture(scope="module")
def printed(tmp_path_factory):
    """(folder, what each command of the page's first diagnosis prints, by command) of the commands as they stand there."""
    folder = tmp_path_factory.mktemp("readme")
    blocks = re.findall(r"```sh\n(.*?)```", README, re.DOTALL)
    lines = [line.partition("  #")[0].strip() for block in blocks for line in block.splitlines()]
    wanted = re.compile(r"touchstone (model (new|add)|plan lat00|touch --plan plan\.csv --model|compare set\.csv|diagnose set\.csv --model|"
                        r"propose set|uncertainty)")
    program = str(pathlib.Path(find_server()).parent / "touchstone")
    found = {}
    for line in filter(wanted.match, lines):
        command = [program, *shlex.split(line)[1:]]
        if "diagnose" in command and "--json" not in command:
            command += ["--json", "report.json"]
        found[line] = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=True).stdout
    return folder, found


def said(pattern):
    """The numbers of one sentence of the page, whatever its line breaks."""
    match = re.search(pattern, " ".join(README.split()))
    assert match, f"README.md does not say: {pattern}"
    return [float(each) for each in match.groups()]


def test_the_error_falls_as_the_page_says(printed):
    before, ratio, after = said(rf"the error falls from {_NUMBER} ms, {_NUMBER} times the noise, to {_NUMBER} ms, the noise")
    _, outputs = printed
    compared = [re.search(rf"The model is off by {_NUMBER} ms, {_NUMBER} times the noise floor", text) for line, text in outputs.items()
                if line.startswith("touchstone compare") and line.count("--model") == 1]
    (first, first_ratio), (last, last_ratio) = ([float(each) for each in match.groups()] for match in compared if match)
    assert (first, first_ratio, last) == (before, ratio, after) and last_ratio == pytest.approx(1, abs=0.05)


def test_the_sizes_that_are_found_are_those_of_the_page(printed):
    found_mm, planted_mm, found_ms, planted_ms = said(
        rf"the balls at the finger tips \({_NUMBER} mm of {_NUMBER}\) and the noise \({_NUMBER} ms of {_NUMBER}\)")
    folder, outputs = printed
    report = json.loads((folder / "report.json").read_text())
    assert [step["effect"] for step in report["steps"]] == ["tip_radius", "gaussian_noise"]
    shown = next(text for line, text in outputs.items() if line.startswith("touchstone diagnose"))
    assert f"{found_mm:g} +-" in shown and f"{found_ms:g} +-" in shown
    planted = " ".join(outputs)
    assert f"radius_mm={planted_mm:g}" in planted and f"sigma_us={1e3 * planted_ms:g}" in planted


def test_how_sure_the_predictions_are_is_what_the_page_says(printed):
    at_plan_ms, at_next_ms, share = said(
        rf"within a standard uncertainty of {_NUMBER} ms, nearly all of it noise; of the twelve in `next.csv`, chosen for what they "
        rf"would tell, {_NUMBER} ms, {_NUMBER} % of its square from the tip radius")
    folder, outputs = printed
    shown = " ".join(next(text for line, text in outputs.items() if line.startswith("touchstone uncertainty")).split())
    assert f"standard uncertainty of {at_next_ms:g} ms; {share:g} % of its square is tip_radius" in shown
    program = str(pathlib.Path(find_server()).parent / "touchstone")
    again = subprocess.run([program, "uncertainty", "report.json", "plan.csv"], cwd=folder, capture_output=True, text=True, check=True)
    assert f"standard uncertainty of {at_plan_ms:g} ms" in " ".join(again.stdout.split())


def test_what_the_photographs_of_the_page_hid_is_what_made_them():
    made = (ROOT / "tests/hidden_effects/images/make_example.py").read_text(encoding="utf-8")
    stops, k1 = said(r"hid (\d\.\d+) stops of exposure and a lens with k1 = (-\d\.\d+)")
    assert f'"exposure": {stops:g}' in made and f'"radial_distortion": ({k1:g}, 0.0)' in made
