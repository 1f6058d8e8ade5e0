"""compare(), diagnose() and propose() on sets that were simulated with an effect that the given model lacks."""

import json
import os
import pathlib
import subprocess

import numpy as np
import pytest

import touchstone

NOMINAL = "touchstone: model/1\nname: nominal_rig\neffects:\n  - gaussian_noise: {sigma_us: 2000}\n"
HIDDEN = NOMINAL + "  - speed_error: {relative: 0.08}\n"
OBJECTS = ("lat10", "lat20")


def measure(server, path, poses):
    """A measurement file of two rounds of poses on six faces of each object, with the effect."""
    client = touchstone.connect(server.target)
    rows = []
    for number, object in enumerate(OBJECTS):
        touches = client.plan(touchstone.faces(samples_per_face=poses, rounds=2), object, count=12 * poses)
        batch = client.touch(object, touches, model=HIDDEN, seed=number)
        rows += [touchstone.Row(len(rows) + k, object, touches[k:k + 1], tuple(batch["contact_time_us"][k]))
                 for k in range(len(touches))]
    touchstone.write_measurements(path, rows)
    return path


@pytest.fixture(scope="module")
def measured(server, tmp_path_factory):
    return measure(server, tmp_path_factory.mktemp("measured") / "set.csv", 4)


@pytest.fixture(scope="module")
def report(server, measured):
    return touchstone.connect(server.target).diagnose(measured, NOMINAL)


def test_the_hidden_effect_is_found_and_the_error_falls(report):
    assert report.verdict == "missing_effects"
    assert [step.effect for step in report.steps] == ["speed_error"]
    step, = report.steps
    assert step.probability > 0.9
    value, = step.values
    assert value.interval[0] < 0.08 < value.interval[1] and value.std_error < 0.01
    assert report.final_rmse_us == pytest.approx(report.noise_floor_us, rel=0.15)
    assert report.rmse_us > 3 * report.final_rmse_us
    assert np.isnan(report.rmse_grey) and np.isnan(report.final_rmse_grey)
    data, = report.data
    assert (data.kind, data.unit, data.emulated) == ("touches", "us", False)
    assert report.p_nothing_missing < 1e-3 and report.suggested_model == ""
    assert data.after_step[-1].rmse == pytest.approx(data.final.rmse) and report.of("photographs") is None


def test_the_fall_is_found_again_by_compare(server, measured, report, tmp_path):
    client = touchstone.connect(server.target)
    before = client.compare(measured, NOMINAL)
    assert before.verdict == "" and before.steps == ()
    assert before.rmse_us == pytest.approx(report.rmse_us)
    report.save_model(tmp_path / "better.yaml")
    assert client.compare(measured, tmp_path / "better.yaml").rmse_us == pytest.approx(report.final_rmse_us, rel=0.01)
    assert client.compare(measured, report.improved_model).rmse_us == pytest.approx(report.final_rmse_us, rel=0.01)


def rounded(value):
    """Numbers to nine digits: two programs that write JSON round the last ones differently."""
    if isinstance(value, dict):
        return {name: rounded(entry) for name, entry in value.items()}
    if isinstance(value, list):
        return [rounded(entry) for entry in value]
    return float(f"{value:.9g}") if isinstance(value, (int, float)) and not isinstance(value, bool) else value


def test_it_says_what_the_command_line_says(server, server_program, measured, report, tmp_path):
    program = pathlib.Path(server_program).parent / "touchstone"
    if not program.exists():
        pytest.skip(f"{program} is not built")
    (tmp_path / "nominal.yaml").write_text(NOMINAL)
    subprocess.run([str(program), "diagnose", str(measured), "--model", str(tmp_path / "nominal.yaml"), "--server",
                    server.target, "--json", str(tmp_path / "report.json"), "--save-model", str(tmp_path / "better.yaml"),
                    "--quiet"], check=True, timeout=300)
    report.save_model(tmp_path / "ours.yaml")
    assert (tmp_path / "ours.yaml").read_bytes() == (tmp_path / "better.yaml").read_bytes()
    assert f'fitted_to:\n    - {{set: "{measured}", sha256: ' in (tmp_path / "ours.yaml").read_text()
    theirs, ours = json.loads((tmp_path / "report.json").read_text()), report.to_dict()
    for name in ("verdict", "summary", "warnings", "improved_model_yaml", "improved_model_hash"):
        assert ours[name] == theirs[name]
    for name in ("steps", "ambiguities", "next"):
        assert rounded(ours[name]) == rounded(theirs[name])
    assert set(theirs) == set(ours) and len(ours["data"]) == 1
    for name in ("kind", "unit", "session", "emulated", "count", "set_aside", "noise_floor", "initial", "after_step", "final",
                 "where", "candidates", "set"):
        assert rounded(ours["data"][0][name]) == rounded(theirs["data"][0][name])
    # Written by this one where it is there.
    assert set(theirs["data"][0]) - set(ours["data"][0]) <= {"unexplained"}
    report.save(tmp_path / "ours.json")
    assert json.loads((tmp_path / "ours.json").read_text())["verdict"] == "MISSING_EFFECTS"


def test_the_stages_are_told(server, tmp_path):
    told = []
    path = measure(server, tmp_path / "large.csv", 60)
    touchstone.connect(server.target).diagnose(path, NOMINAL, on_progress=lambda *progress: told.append(progress))
    assert told[0] == ("reading", 0) and all(stage and 0 <= done <= 1 for stage, done in told)


def test_next_touches_can_be_made(server, measured):
    client = touchstone.connect(server.target)
    report = client.propose(measured, NOMINAL, touches=6)
    assert 0 < len(report.next_touches) <= 6
    for row in report.next_touches:
        assert row.object in OBJECTS
        assert client.touch(row.object, row.command)["complete"].all()


def test_why_nothing_is_proposed_is_said_at_the_line_that_asked(client, measured, tmp_path):
    (tmp_path / "few.csv").write_text("".join(measured.read_text().splitlines(keepends=True)[:6]))
    with pytest.warns(UserWarning, match=r"Nothing is proposed: .*Make more touches first \(\d+ usable ones\)") as warned:
        report = client.propose(tmp_path / "few.csv", NOMINAL)
    assert report.verdict == "too_little_data" and len(report.next_touches) == 0
    assert warned[0].filename == __file__


def test_meshes_of_this_machine_go_along(server, tmp_path):
    corners = [(x, y, z) for x in (-30, 30) for y in (-40, 40) for z in (-20, 20)]
    faces = [(0, 1, 3), (0, 3, 2), (4, 6, 7), (4, 7, 5), (0, 4, 5), (0, 5, 1), (2, 3, 7), (2, 7, 6), (0, 2, 6), (0, 6, 4),
             (1, 5, 7), (1, 7, 3)]
    meshes = tmp_path / "meshes"
    meshes.mkdir()
    (meshes / "brick.off").write_text("\n".join(
        ["OFF", f"{len(corners)} {len(faces)} 0", *(" ".join(map(str, c)) for c in corners),
         *("3 " + " ".join(map(str, f)) for f in faces)]) + "\n")
    touch = touchstone.touches([dict(target_mm=(0, 0, 0), approach=(0, 0, -1), lateral=(0, 1, 0), standoff_mm=100)])
    path = tmp_path / "set.csv"
    touchstone.write_measurements(path, [
        touchstone.Row(k, "brick", touch, (4e6 + 10 * k, 4e6 - 20 * k, 4e6)) for k in range(24)])
    client = touchstone.connect(server.target)
    with pytest.raises(touchstone.NotFound, match="brick"):
        client.compare(path, NOMINAL)
    by_folder = client.compare(path, NOMINAL, meshes=meshes)
    by_name = client.compare(path, NOMINAL, meshes={"brick": touchstone.Mesh(meshes / "brick.off", unit="mm")})
    assert by_folder.rmse_us == by_name.rmse_us < 1000


@pytest.mark.parametrize("arguments, says", [
    (dict(measurements="no/such.csv"), "no/such.csv: No such file"),
    (dict(measurements="set.csv"), "set.csv: No such file"),
    (dict(meshes="no/such/folder"), "give a folder of mesh files"),
    (dict(meshes={"lat10": "lat10.step"}), "must end in .off, .obj, .stl, .ply"),
    (dict(model="no/such.yaml"), "no/such.yaml: No such file"),
])
def test_a_mistake_names_what_is_wrong(client, measured, arguments, says):
    with pytest.raises(touchstone.InvalidRequest, match=says):
        client.compare(**{"measurements": measured, **arguments})


def test_a_session_that_is_not_kept_is_not_found(client):
    with pytest.raises(touchstone.NotFound, match="never_stored"):
        client.compare("never_stored", NOMINAL)


def test_a_mistake_in_the_file_is_told_in_the_sources_words(client, measured, tmp_path):
    lines = measured.read_text().splitlines()
    lines[5] = lines[5].replace("lat10", "lat10").rsplit(",", 1)[0] + ",soon"
    (tmp_path / "bad.csv").write_text("\n".join(lines) + "\n")
    with pytest.raises(touchstone.InvalidRequest, match=f"{os.fspath(tmp_path / 'bad.csv')}:6.*soon"):
        client.compare(tmp_path / "bad.csv", NOMINAL)


def test_nothing_to_improve_is_no_model(server, measured):
    report = touchstone.connect(server.target).compare(measured, HIDDEN)
    with pytest.raises(touchstone.InvalidRequest, match="no improved model"):
        report.save_model("nowhere.yaml")
