"""The whole circle: an emulated rig hides an effect, the gateway makes a session of touches on it, the diagnosis names
the effect and its size, and with it the model's error is the noise.

Over real sockets and a real pseudo-terminal, 192 touches an object, and few in the circle of the first tier. Half of the
sessions are made by `touchstone rig run`, half by the Python package. Nothing that the emulated rig reports was measured on anything.
"""
import contextlib
import csv
import dataclasses
import functools
import json
import os
import pathlib
import shutil
import subprocess
import sys
import tarfile
import time

import pytest

ROOT = pathlib.Path(__file__).resolve().parents[2]
BIN = pathlib.Path(os.environ.get("TOUCHSTONE_SERVER_PROGRAM", ROOT / "build/release/bin/touchstone-server")).parent
EXAMPLE = ROOT / "client/python/examples/rig_run.py"

# Simulated seconds in one second. A touch takes five of them; what is left is our own programs' time.
SPEEDUP = 120
SIGMA_US = 5000
GENEROUS_S = 900


@dataclasses.dataclass(frozen=True)
class Circle:
    name: str
    by: str  # "command line" or "python"
    # effect -> what is hidden, as `touchstone-rig-emulator --hide` takes it: (parameter, values), with the object's
    # name where only one object has it.
    hidden: dict = dataclasses.field(default_factory=dict)
    unlisted: str = ""
    objects: str = "lat10,lat20"
    seed: int = 1
    speedup: int = SPEEDUP
    # Touches of an object: poses of a face, and rounds of them.
    poses: int = 8
    rounds: int = 4
    # By how much errors that come down to the noise may differ from it.
    noise_rel: float = 0.1
    # The largest distance from the truth, whatever the standard error: a lab could use the number.
    near: dict = dataclasses.field(default_factory=dict)

    @property
    def touches(self):
        return 6 * self.poses * self.rounds * len(self.objects.split(","))

    @property
    def verdict(self):
        return "UNEXPLAINED" if self.unlisted else "MISSING_EFFECTS" if self.hidden else "ADEQUATE"


CIRCLES = [
    Circle("few_touches", "command line", {"tip_radius": ("radius_mm", [2])}, seed=23, speedup=60, poses=4, rounds=2,
           noise_rel=0.2, near={"tip_radius": 0.4}),
    Circle("nothing", "command line", seed=11),
    # Pose.
    Circle("tool_yaw", "python", {"tool_yaw": ("angle_deg", [3])}, seed=12, near={"tool_yaw": 0.5}),
    Circle("finger_length", "command line", {"finger_length": ("offset_mm", [0.25, -0.3, 0.05])}, seed=13,
           near={"finger_length": 0.05}),
    Circle("object_pose", "python", {"object_pose": ("translation_mm", [0.6, -0.4, 0.5], "lat20")}, seed=22,
           near={"object_pose": 0.2}),
    # Contact.
    Circle("tip_radius", "command line", {"tip_radius": ("radius_mm", [2])}, seed=14, near={"tip_radius": 0.2}),
    # Motion.
    Circle("object_push", "python", {"object_push": ("shift_mm", [0.4])}, seed=15, near={"object_push": 0.05}),
    Circle("contact_slowdown", "command line", {"contact_slowdown": ("fraction", [0.06])}, seed=16,
           near={"contact_slowdown": 0.01}),
    # Sensor.
    Circle("oblique_slip", "python", {"oblique_slip": ("travel_mm", [0.5])}, seed=17, near={"oblique_slip": 0.1}),
    # The simulated clock runs while our programs take their time: at a lower speed the drift depends less on theirs.
    Circle("thermal_drift", "command line", {"thermal_drift": ("rate_mm_per_h", [0.6, -0.15, -0.45])}, seed=18,
           speedup=100, near={"thermal_drift": 0.12}),
    Circle("return_hysteresis", "python", {"return_hysteresis": ("fraction", [0.08])}, seed=19,
           near={"return_hysteresis": 0.01}),
    Circle("pair", "command line", {"tip_radius": ("radius_mm", [1.5]), "object_push": ("shift_mm", [0.5])}, seed=20,
           near={"tip_radius": 0.25, "object_push": 0.06}),
    # Of no catalogue: a lead screw with a pitch of 5 mm that is not true.
    Circle("lead_screw", "python", unlisted="lead_screw=0.15,5", seed=21),
]


def run(*command, cwd):
    """One of our programs, to its end; what it printed is shown if it fails."""
    result = subprocess.run([str(part) for part in command], cwd=cwd, capture_output=True, text=True,
                            timeout=GENEROUS_S, check=False)
    if result.returncode != 0:
        raise AssertionError(f"{' '.join(map(str, command))}\nended with {result.returncode}:\n"
                             f"{result.stdout[-2000:]}{result.stderr[-4000:]}")
    return result.stdout


@contextlib.contextmanager
def started(ready, log, *command):
    """A program that runs until the block ends; yields what follows `ready` in the line that begins so."""
    with open(log, "w", encoding="utf-8") as errors:
        process = subprocess.Popen([str(part) for part in command], stdout=subprocess.PIPE, stderr=errors, text=True)
    with process:
        try:
            for line in process.stdout:
                if line.startswith(ready):
                    break
            else:
                raise AssertionError(f"{command[0]} ended: {log.read_text()}")
            yield line[len(ready):].strip()
        finally:
            process.terminate()
            try:
                status = process.wait(timeout=60)
            except subprocess.TimeoutExpired:
                process.kill()
                raise
    assert status == 0, f"{command[0]} ended with {status}: {log.read_text()[-2000:]}"


@contextlib.contextmanager
def emulated_rig(folder, circle):
    """An emulator and its gateway; yields the gateway's address."""
    hide = [f"--hide={'.'.join([effect, *thing, parameter])}={','.join(map(str, values))}"
            for effect, (parameter, values, *thing) in circle.hidden.items()]
    unlisted = [f"--unlisted={circle.unlisted}"] if circle.unlisted else []
    emulator = [BIN / "touchstone-rig-emulator", "--dir", folder / "rig", "--speedup", circle.speedup,
                "--sigma-us", SIGMA_US, "--seed", circle.seed, "--finger-give-mm", 1000, "--no-camera", *hide, *unlisted]
    gateway = [BIN / "touchstone-gateway", "--listen", "127.0.0.1:0", "--config"]
    with started("ready ", folder / "emulator.log", *emulator) as config:
        with started("listening on ", folder / "gateway.log", *gateway, config) as address:
            yield address


def measure(folder, circle, measured):
    """Makes the touches of plan.csv on an emulated rig in `folder`; what was measured lies beside the plan then."""
    shutil.copy(folder.parent / "plan.csv", folder)
    with emulated_rig(folder, circle) as address:
        if circle.by == "command line":
            run(BIN / "touchstone", "rig", "run", "plan.csv", "--server", address, "-o", measured, cwd=folder)
        else:
            run(sys.executable, EXAMPLE, address, "plan.csv", circle.name, measured, cwd=folder)
    shutil.move(folder / measured, folder.parent / measured)


# What a rig says whose programs did not get the processor.
STARVED = ("PROTECTIVE_STOP", "it hung for")


def measure_as_fast_as_the_machine_bears(folder, circle, measured):
    """On an accelerated clock a few milliseconds without the processor are half a second in which the emulated arm
    goes on, or its gateway says of itself that it hung. Then the session is made anew on a slower clock."""
    for slower in (1, 4, 16):
        attempt = folder / f"slower-{slower}"
        attempt.mkdir()
        try:
            measure(attempt, dataclasses.replace(circle, speedup=circle.speedup / slower), measured)
            return
        except AssertionError as error:
            if slower == 16 or not any(words in str(error) for words in STARVED):
                raise
            print(f"{circle.name}: a stop for want of the processor at {circle.speedup / slower} times real time, again at a quarter")


def go_round(folder, circle):
    """The circle's report, and what went into it."""
    cli = BIN / "touchstone"
    run(cli, "plan", circle.objects, "--plan", "faces", "--samples-per-face", circle.poses, "--rounds", circle.rounds, "-o", "plan.csv",
        cwd=folder)
    began = time.monotonic()
    measured = "session.db" if circle.by == "command line" else "set.csv"
    measure_as_fast_as_the_machine_bears(folder, circle, measured)
    session_s = time.monotonic() - began
    run(cli, "model", "new", "-o", "bare.yaml", cwd=folder)
    run(cli, "model", "add", "bare.yaml", "gaussian_noise", f"sigma_us={SIGMA_US}", "-o", "nominal.yaml", cwd=folder)
    run(cli, "diagnose", measured, "--model", "nominal.yaml", "--json", "report.json", "--save-model", "better.yaml",
        cwd=folder)
    report = json.loads((folder / "report.json").read_text())
    print(f"{circle.name}: {report['summary']} [session {session_s:.0f} s, diagnosis {report['duration_s']:.1f} s]")
    return report


@pytest.fixture(scope="module")
def gone_round(tmp_path_factory):
    """A function: circle -> (folder, report). Each circle is gone round once."""

    @functools.cache
    def of(circle_name):
        folder = tmp_path_factory.mktemp(circle_name)
        return folder, go_round(folder, next(circle for circle in CIRCLES if circle.name == circle_name))

    return lambda circle: of(circle.name)


def parameter(circles, *names):
    """The circles of these names, or all: one of few touches in the first tier, each in one process."""
    statistical = pytest.mark.second_tier("statistical: hidden effects on an emulated rig")
    return pytest.mark.parametrize("circle", [
        pytest.param(circle, id=circle.name, marks=[pytest.mark.xdist_group(f"circle_{circle.name}"),
                                                    *([] if circle.name == "few_touches" else [statistical])])
        for circle in circles if not names or circle.name in names])


def named(step):
    return [step["effect"], *step["equivalent"]]


def step_for(report, effect):
    found = [step for step in report["steps"] if effect in named(step)]
    assert len(found) == 1, f"{effect}: {[named(step) for step in report['steps']]}"
    return found[0]


@parameter(CIRCLES)
def test_the_verdict_is_right_and_nothing_is_named_that_is_not_there(gone_round, circle):
    _, report = gone_round(circle)
    assert report["verdict"] == circle.verdict, report["summary"]
    assert report["data"][0]["count"] > 0.98 * circle.touches
    # What no catalogue lists may look like something that a catalogue lists, as long as the rest is owned up to.
    if not circle.unlisted:
        assert len(report["steps"]) == len(circle.hidden), report["summary"]


@parameter([c for c in CIRCLES if c.hidden])
def test_the_hidden_effects_are_named_and_their_values_are_right(gone_round, circle):
    _, report = gone_round(circle)
    for effect, (name, values, *thing) in circle.hidden.items():
        step = step_for(report, effect)
        if step["effect"] != effect:
            continue  # an exact tie: its value has another unit
        found = [p for p in step["parameters"] if p["name"].split(".")[0] == name and p["object"] in (thing or [""])]
        assert len(found) == len(values)
        for value, truth in zip(found, values):
            error = abs(value["value"] - truth)
            assert error < 4 * value["std_error"], (effect, value, truth)
            assert error < circle.near[effect], (effect, value, truth)


@parameter([c for c in CIRCLES if not c.unlisted])
def test_the_error_comes_down_to_the_noise(gone_round, circle):
    _, report = gone_round(circle)
    # From 760 differences to a touch's mean, or 570 to a pose's: one standard error is 2.6 or 3 %.
    data, = report["data"]
    assert data["final"]["rmse"] == pytest.approx(SIGMA_US, rel=circle.noise_rel)
    assert data["noise_floor"] == pytest.approx(SIGMA_US, rel=1.2 * circle.noise_rel)
    if circle.hidden:
        assert data["initial"]["rmse"] > 1.15 * SIGMA_US


@parameter([c for c in CIRCLES if c.unlisted])
def test_what_no_catalogue_lists_is_reported_with_what_it_depends_on(gone_round, circle):
    _, report = gone_round(circle)
    data, = report["data"]
    assert data["final"]["rmse"] > 1.1 * data["noise_floor"], report["summary"]
    assert "travel_mm" in json.dumps(data["unexplained"]), data["unexplained"]


@parameter(CIRCLES, "few_touches", "tip_radius")
def test_the_better_model_is_adequate_and_makes_a_dataset(gone_round, circle):
    folder, _ = gone_round(circle)
    cli = BIN / "touchstone"
    run(cli, "diagnose", "session.db", "--model", "better.yaml", "--json", "again.json", cwd=folder)
    assert json.loads((folder / "again.json").read_text())["verdict"] == "ADEQUATE"
    run(cli, "stream", "--objects", "lat10,lat20", "--samples", 40, "--model", "better.yaml", "--image", "32x32",
        "--out", "pairs", cwd=folder)
    with tarfile.open(next((folder / "pairs").glob("*.tar"))) as shard:
        assert len(shard.getnames()) >= 80


@parameter(CIRCLES, "few_touches", "tip_radius")
def test_the_journal_says_that_its_data_are_emulated_and_repeats_nothing(gone_round, circle):
    folder, _ = gone_round(circle)
    run(BIN / "touchstone", "session", "export", "session.db", "plan", "-o", "exported.csv", cwd=folder)
    with open(folder / "exported.csv", encoding="utf-8") as file:
        assert len(list(csv.DictReader(file))) == circle.touches
    assert b"emulated" in (folder / "session.db").read_bytes()
