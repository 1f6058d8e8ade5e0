"""check(), explain() and compare() of two models."""

import numpy as np
import pytest

import touchstone

NOMINAL = "touchstone: model/1\nname: nominal_rig\neffects:\n  - gaussian_noise: {sigma_us: 2000}\n"
HIDDEN = NOMINAL.replace("nominal_rig", "fast_rig") + "  - speed_error: {relative: 0.08}\n"


@pytest.fixture(scope="module")
def client(server):
    return touchstone.connect(server.target)


@pytest.fixture(scope="module")
def measured(client, two_rounds):
    """By a rig that is too fast."""
    return two_rounds(client, HIDDEN)


def test_a_check_says_from_which_size_each_effect_is_found(client, measured):
    report = client.check(measured, NOMINAL)
    assert report.verdict == "" and report.summary.startswith("Of ")
    speed, = (value for value in report.detectable if value.effect == "speed_error")
    assert speed.name == "relative" and speed.stage == "motion"
    assert 0 < speed.std_error < speed.found_from < 0.08
    assert (speed.rival, speed.told_from) == ("clock_skew", None) and speed.parted_by


def test_twice_the_noise_takes_about_twice_the_size(client, measured):
    sizes = [next(value.found_from for value in client.check(measured, NOMINAL, noise_us=noise).detectable
                  if value.effect == "tip_radius") for noise in (1000, 2000)]
    assert sizes[1] / sizes[0] == pytest.approx(2, rel=0.15)


def test_improving_proposes_touches(client, measured):
    report = client.check(measured, NOMINAL, improve=5, between=("finger_length", "channel_latency"))
    assert len(report.next_touches) == 5
    with pytest.raises(touchstone.InvalidRequest, match="depends on the question"):
        client.check(measured, NOMINAL, improve=5)
    with pytest.raises(touchstone.InvalidRequest, match="noise_us is 0"):
        client.check(measured, NOMINAL, noise_us=0)


def test_the_hidden_effect_explains_itself(client, measured):
    explained = client.explain("speed_error", measured, NOMINAL).explained
    value, = explained.values
    assert value.interval[0] < 0.08 < value.interval[1]
    assert explained.probability > 0.3 and explained.taken_over["clock_skew"] > 0.99
    assert explained.message.speak_for[0].fall > 0
    assert client.compare(measured, NOMINAL).explained is None


def test_of_two_models_the_truth_errs_less(client, measured):
    versus = client.compare(measured, NOMINAL, other_model=HIDDEN).versus
    assert versus.rmse_difference < 0 and versus.interval[1] < 0 and versus.other_better == 1
    assert versus.other.rmse == pytest.approx(client.compare(measured, HIDDEN).rmse_us)
    assert "'fast_rig' errs less" in versus.words
    assert client.compare(measured, NOMINAL).versus is None


def test_a_report_of_a_set_says_what_it_could_not_have_shown(client, measured):
    report = client.diagnose(measured, NOMINAL)
    assert "speed_error" not in {value.effect for value in report.detectable}  # found
    assert any(value.power_at_typical < 0.8 for value in report.detectable)
    assert np.isfinite([value.std_error for value in report.detectable]).all()


@pytest.fixture(scope="module")
def sessions(client, tmp_path_factory):
    """Two sessions of one rig on the same poses: its arm is 8 % too fast in the second one."""
    folder = tmp_path_factory.mktemp("sessions")
    touches = client.plan(touchstone.faces(samples_per_face=4, rounds=3), "lat20", count=72)
    for seed, (name, model) in enumerate({"monday": NOMINAL, "friday": HIDDEN}.items()):
        times_us = client.touch("lat20", touches, model=model, seed=seed)["contact_time_us"]
        touchstone.write_measurements(folder / f"{name}.csv", [touchstone.Row(k, "lat20", touches[k:k + 1], tuple(times_us[k]))
                                                               for k in range(len(touches))])
    return [folder / "monday.csv", folder / "friday.csv"]


def test_what_changed_between_sessions_is_named(client, sessions):
    report = client.diagnose(sessions, NOMINAL)
    assert [data.session for data in report.data] == list(map(str, sessions))
    changed = [value for value in report.sessions.values if value.change == "changed"]
    assert [value.effect for value in changed] == [report.steps[0].effect]
    low, high = changed[0].interval
    assert low < changed[0].difference < high and set(changed[0].by_session) == {0, 1}
    assert "friday.csv" in report.sessions.words
    assert report.sessions.models[0] != report.sessions.models[1]
    assert report.data[1].final.rmse < 0.5 * report.data[1].initial.rmse
    assert "changed" in report.sessions.values._repr_html_()


def test_sessions_that_differ_are_told_without_a_fit(client, sessions):
    report = client.compare(sessions, NOMINAL)
    same, = report.sessions.message.same_poses
    assert same.poses > 20 and same.p < 1e-6 and not report.sessions.values
    assert client.compare(sessions[0], NOMINAL).sessions is None


def test_sessions_take_one_model(client, sessions):
    with pytest.raises(touchstone.InvalidRequest, match="several sessions take one model"):
        client.compare(sessions, NOMINAL, other_model=HIDDEN)
    with pytest.raises(touchstone.InvalidRequest, match="empty list"):
        client.diagnose([], NOMINAL)


def test_what_takes_the_place_of_touches_or_a_model_is_named(client, measured, tmp_path, monkeypatch):
    with pytest.raises(touchstone.InvalidRequest, match=r"touches is \[\]; Touches were expected, as touches\(\)"):
        client.touch("lat20", [])
    monkeypatch.chdir(tmp_path)
    (tmp_path / "set.csv").write_bytes(measured.read_bytes())
    with pytest.raises(touchstone.InvalidRequest, match="is a file, but no model file"):
        client.diagnose("set.csv", "set.csv")
