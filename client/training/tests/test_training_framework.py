"""The command: what it says, what it keeps, how it goes on, and that nothing outlives it."""

import contextlib
import dataclasses
import io
import json
import math
import os
import pathlib
import re
import signal
import subprocess
import sys
import time

import numpy as np
import pytest

pytest.importorskip("xgboost", reason="XGBoost is not installed; touchstone.training needs it.")

import touchstone
from touchstone.training import (
    __main__ as command,
    report,
    statistics,
)
from touchstone.training.context import Context
from touchstone.training.emulated_rig import EmulatedRig
from touchstone.training.experiment import Experiment, experiments
from touchstone.training.result import Comparison, Estimate, Figure, Result, Table
from touchstone.training.settings import Settings


def training(*arguments, check=None):
    done = subprocess.run([sys.executable, "-m", "touchstone.training", *map(str, arguments)], capture_output=True, text=True,
                          timeout=600, check=False)
    if check is not None:
        assert done.returncode == check, done.stdout + done.stderr
    return done


@pytest.mark.parametrize("arguments, says", [
    (["no_such_experiment"], "invalid choice: 'no_such_experiment'"),
    (["all", "--backbone", "no.onnx"], "--backbone no.onnx: no such file"),
    (["all", "--everyday", "no/such"], "--everyday no/such: no such folder"),
    (["all", "--rig-is-real"], "--rig-is-real needs --rig"),
    (["all", "--seeds", "1"], "--seeds 1: at least 2"),
])
def test_a_mistake_is_named_in_words(tmp_path, monkeypatch, arguments, says):
    monkeypatch.setattr(sys, "argv", ["touchstone.training", *arguments, "--out", str(tmp_path)])
    told = io.StringIO()
    with contextlib.redirect_stderr(told), pytest.raises((SystemExit, touchstone.InvalidRequest)) as raised:
        command.main()
    assert getattr(raised.value, "code", 2) != 0 and says in f"{told.getvalue()}{raised.value}"


def test_a_folder_that_cannot_be_made_is_one_sentence_with_an_exit_status():
    done = subprocess.run([sys.executable, "-m", "touchstone.training", "curvature_histograms", "--out", "/proc/x"], capture_output=True, text=True,
                          check=False)
    assert (done.returncode, done.stderr) == (2, "touchstone: error: /proc/x: No such file or directory\n")


def test_an_experiment_runs_to_its_report(tmp_path, monkeypatch):
    with touchstone.connect() as client:
        # The rig of this run is another simulator, which takes no time, and which no user may name: the emulated one is tried below.
        monkeypatch.setattr(command, "_check_rig", lambda target, is_real: None)
        monkeypatch.setattr(sys, "argv", ["touchstone.training", "curvature_histograms", "--quick", "--server", client.target, "--rig",
                                          client.target, "--out", str(tmp_path)])
        assert command.main() == 0
    (found,) = json.loads((tmp_path / "report.json").read_text())["experiments"]
    assert found["name"] == "curvature_histograms" and found["words"]
    for figure in found["figures"]:
        assert (tmp_path / figure["file"]).read_text().lstrip().startswith("<")
    assert "Histograms of local curvature" in (tmp_path / "report.html").read_text()


def test_a_simulator_is_no_rig(tmp_path):
    with touchstone.connect() as client:
        done = training("all", "--rig", client.target, "--out", tmp_path / "out")
    assert done.returncode != 0 and "this is a virtual source, which has no arm" in done.stderr and "Traceback" not in done.stderr
    assert not (tmp_path / "out").exists()


def test_an_emulated_rig_is_not_called_real(tmp_path):
    rig = EmulatedRig("", ["--no-camera"])
    try:
        done = training("all", "--rig", rig.client.target, "--rig-is-real", "--out", tmp_path / "out")
    finally:
        rig.stop()
    assert done.returncode != 0 and "says that its rig is emulated" in done.stderr and not (tmp_path / "out").exists()


def test_a_source_that_does_not_answer_is_named_without_a_traceback(tmp_path):
    done = training("curvature_histograms", "--server", "127.0.0.1:1", "--quick", "--out", tmp_path)
    assert done.returncode != 0 and "127.0.0.1:1" in done.stderr and "Traceback" not in done.stderr


def test_an_interrupted_run_ends_without_a_traceback_and_with_the_exit_status_of_one(tmp_path):
    command_line = [sys.executable, "-m", "touchstone.training", "curvature_histograms", "--out", str(tmp_path)]
    with subprocess.Popen(command_line, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        begun = process.stderr.readline()
        assert begun.startswith("1/1 curvature_histograms: ")
        process.send_signal(signal.SIGINT)
        said, told = process.communicate(timeout=120)
    assert (process.returncode, said, told) == (130, "", "")
    assert not (tmp_path / "report.json").exists()


def counting(tmp_path, monkeypatch, run=None):
    """The command with one experiment that counts its runs."""
    runs = []

    def count(context):
        runs.append(context.settings.seed)
        (context.settings.out / "figures").mkdir(exist_ok=True)
        (context.settings.out / "figures/a.svg").write_text("<svg/>")
        return Result("", "", words=["Done."], made_on=["nothing"], figures=[Figure("figures/a.svg", "A.")])

    each = Experiment("one", "One", "", run or count, (1, 1))
    monkeypatch.setattr(command, "experiments", lambda: [each])
    monkeypatch.setattr(sys, "argv", ["x", "all", "--out", str(tmp_path)])
    return runs


def test_what_is_finished_is_not_done_again_unless_something_changed(tmp_path, monkeypatch):
    runs = counting(tmp_path, monkeypatch)
    command.main()
    command.main()
    assert len(runs) == 1
    monkeypatch.setattr(sys, "argv", ["x", "all", "--out", str(tmp_path), "--seed", "5"])
    command.main()
    assert runs == [1, 5]
    (tmp_path / "figures/a.svg").unlink()
    command.main()
    assert len(runs) == 3, "a figure is missing"
    monkeypatch.setattr(sys, "argv", [*sys.argv, "--again"])
    command.main()
    assert len(runs) == 4


def test_a_run_of_one_experiment_leaves_the_others_in_the_report(tmp_path, monkeypatch):
    counting(tmp_path, monkeypatch)
    (one,) = command.experiments()
    other = dataclasses.replace(one, name="other", title="Other")
    monkeypatch.setattr(command, "experiments", lambda: [one, other])
    titles = lambda: [each["title"] for each in json.loads((tmp_path / "report.json").read_text())["experiments"]]
    for name in ("other", one.name):
        monkeypatch.setattr(sys, "argv", ["x", name, "--out", str(tmp_path)])
        command.main()
    assert titles() == [one.title, "Other"]
    monkeypatch.setattr(sys, "argv", ["x", one.name, "--out", str(tmp_path), "--seed", "5"])
    command.main()
    assert titles() == [one.title], "the other one was of another seed"


@pytest.mark.parametrize("torn", ["", "{", "[1, 2]", '{"digest": "of other code"}'])
def test_a_result_that_is_torn_or_of_other_code_is_not_taken(tmp_path, monkeypatch, torn):
    runs = counting(tmp_path, monkeypatch)
    (tmp_path / "one.json").write_text(torn)
    command.main()
    assert len(runs) == 1


def test_the_report_has_everything_and_escapes_it(tmp_path):
    settings = Settings(tmp_path, seeds=2)
    each = Experiment("one", "<b>One</b>", "figure 1", None, (1, 1))  # type: ignore[arg-type]  # not run
    result = Result("one", "One", made_on=["a & b"], words=["5 < 6"], seconds=1, figures=[Figure("figures/a.svg", 'says "so"')],
                    tables=[Table("T", ["x"], [["<script>"]])],
                    comparisons=[Comparison("c", Estimate(0.5, math.nan, 0.6), 0.6, "m", "w")], data={"v": [math.inf, 1.0]})
    page = report.write(settings, [(each, result)], [(dataclasses.replace(each, title="Two"), "no backbone")], "run", "2026-11-24")
    text = page.read_text()
    assert "<script>" not in text and "&lt;script&gt;" in text and "5 &lt; 6" in text and "a &amp; b" in text
    assert "Two: no backbone" in text and "-10.0 points" in text
    assert "nothing here was measured on anything" in text
    found = json.loads((tmp_path / "report.json").read_text(), parse_constant=lambda name: pytest.fail(f"{name} is no JSON"))
    assert found["experiments"][0]["data"]["v"] == [None, 1.0]


def test_every_experiment_says_what_it_is():
    names = [each.name for each in experiments()]
    assert len(set(names)) == len(names) >= 15
    for each in experiments():
        assert re.fullmatch("[a-z_]+", each.name) and each.title and min(each.expected_s) > 0


def test_intervals_over_seeds_cover_the_mean():
    rng = np.random.default_rng(3)
    found = [statistics.estimate(rng.normal(2, 1, 10)) for _ in range(2000)]
    assert 0.935 < np.mean([f.low <= 2 <= f.high for f in found]) < 0.965
    assert math.isnan(statistics.estimate([1.0]).low)


def test_random_numbers_depend_on_what_they_are_for_and_on_the_seed(tmp_path):
    def drawn(seed, *words):
        context = Context(Settings(tmp_path, seed=seed))
        context.begin("x")
        return context.rng(*words).integers(1 << 60)

    assert drawn(1, "a", 2) == drawn(1, "a", 2)
    assert len({drawn(1, "a", 2), drawn(2, "a", 2), drawn(1, "a", 3), drawn(1, "b", 2)}) == 4


def processes():
    """{number: (its parent's number, its program)} of all that run; not of those that ended and were not waited for."""
    found = {}
    for entry in pathlib.Path("/proc").iterdir():
        try:
            if entry.name.isdigit():
                parent = (entry / "stat").read_text().rpartition(")")[2].split()[1]
                found[int(entry.name)] = int(parent), os.path.basename(os.readlink(entry / "exe"))
        except OSError:
            continue
    return found


def descendants(ancestor, names):
    """Numbers of the processes that descend from that one and whose program has one of these names."""
    running = processes()

    def descends(number):
        parent = running.get(number, (None,))[0]
        return parent == ancestor or (parent in running and descends(parent))

    return {number for number, (_, program) in running.items() if program in names and descends(number)}


def test_a_rig_of_its_own_ends_with_the_process_that_is_killed(tmp_path):
    script = """
from touchstone.training.emulated_rig import EmulatedRig
rig = EmulatedRig("")
print(rig.client.describe().kind, flush=True)
import time; time.sleep(600)
"""
    with subprocess.Popen([sys.executable, "-c", script], stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout.readline().strip() == "physical"
        started = descendants(process.pid, {"touchstone-rig-emulator", "touchstone-gateway"})
        assert len(started) == 2
        process.send_signal(signal.SIGKILL)
    deadline = time.monotonic() + 60
    while started & set(processes()):
        assert time.monotonic() < deadline, "they outlive the process that started them"
        time.sleep(0.01)
