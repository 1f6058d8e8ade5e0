"""What goes beyond the seed's experiments: savings by simulation, touches to certainty, calibrated answers, other hands."""

import os
import pathlib
import subprocess
import types
from typing import Any

import numpy as np
import pytest

pytest.importorskip("xgboost", reason="XGBoost is not installed; touchstone.training needs it.")

import touchstone
from touchstone.own_server import find_server
from touchstone.training import calibration, ladder, plans, recognisers, sequential
from touchstone.training.experiments import other_rigs
from touchstone.training.ladder import words as ladder_words
from touchstone.training.prediction_powered import bootstrap_gain, powered_mean, simulated_per_measured
from touchstone.training.touch_data import collect


def correlated(rng, n, correlation) -> tuple[np.ndarray, np.ndarray]:
    predicted = rng.normal(size=n)
    return 2 + correlation * predicted + np.sqrt(1 - correlation**2) * rng.normal(size=n), predicted


# --- prediction-powered inference


@pytest.mark.parametrize("correlation", [0.0, 0.5, 0.9])
def test_the_powered_mean_is_unbiased_and_its_interval_covers(correlation):
    rng = np.random.default_rng(1)
    found = [powered_mean(*correlated(rng, 60, correlation), rng.normal(size=600)) for _ in range(1000)]
    values = np.array([f.value for f in found])
    assert abs(values.mean() - 2) < 4 * values.std() / np.sqrt(len(found))
    covered = np.mean([f.low <= 2 <= f.high for f in found])
    assert 0.93 < covered < 0.97
    # What it says of its own scatter is its scatter.
    assert np.mean([f.std_error for f in found]) == pytest.approx(values.std(), rel=0.08)


def test_wrong_predictions_cost_certainty_but_not_truth():
    rng = np.random.default_rng(2)
    values, gains = [], []
    for _ in range(1000):
        y, f = correlated(rng, 100, 0.8)
        found = powered_mean(y, 5 - 3 * f, 5 - 3 * rng.normal(size=1000))  # biased, and of the opposite sign
        values.append(found.value)
        gains.append(found.effective_over_measured)
    assert np.mean(values) == pytest.approx(2, abs=0.02)
    assert max(gains) == 1  # such predictions are left out


@pytest.mark.parametrize("correlation, more", [(0.5, 1), (0.5, 10), (0.9, 10), (0.9, 100)])
def test_the_effective_sample_size_is_the_closed_form(correlation, more):
    # With the best weight the variance is var(y) / n (1 - rho^2 N / (n + N)).
    rng = np.random.default_rng(3)
    n = 4000
    found = powered_mean(*correlated(rng, n, correlation), rng.normal(size=more * n))
    assert found.effective_over_measured == pytest.approx(1 / (1 - correlation**2 * more / (1 + more)), rel=0.06)


def test_with_weight_one_it_is_the_first_papers():
    rng = np.random.default_rng(4)
    y, f = correlated(rng, 50, 0.7)
    g = rng.normal(size=200)
    found = powered_mean(y, f, g, weight=1)
    assert found.value == pytest.approx(g.mean() + (y - f).mean())
    assert found.std_error**2 == pytest.approx(np.var(y - f, ddof=1) / 50 + np.var(g, ddof=1) / 200)


def test_the_bootstrap_interval_holds_the_closed_form_and_the_worth_follows():
    rng = np.random.default_rng(5)
    closed = 1 / (1 - 0.8**2 * 10 / 11)
    held = 0
    for _ in range(40):
        _, low, high = bootstrap_gain(*correlated(rng, 200, 0.8), rng.normal(size=2000), rng, 200)
        assert low <= high
        held += low <= closed <= high
    assert held >= 33  # of 40 at 95 %: fewer than 33 has a probability below 0.1 %
    assert simulated_per_measured(3.0, n=100, more=1000) == 5  # 1000 simulated stand for 200 measured
    assert simulated_per_measured(1.0, n=100, more=1000) == np.inf


# --- touches to certainty


def test_the_posterior_is_that_of_a_hand_calculation():
    # Two fingers, one candidate; the difference of the times is 0 for one object and 2 for the other.
    expected = sequential.Expected(np.array([[[0.0, 0.0], [0.0, 2.0]]]), scatter_us=1.0)
    said = expected.log_likelihood(np.array(0), np.array([0.0, 0.5]))
    # Contrast (t2 - t1) / sqrt 2 has the standard deviation 1: squares 0.5^2 / 2 and 1.5^2 / 2.
    normal = 0.98 * np.exp([-0.25 / 4, -2.25 / 4]) / np.sqrt(2 * np.pi)
    odd = 0.02 / 4 / 2e6
    np.testing.assert_allclose(np.exp(said), normal + odd, rtol=1e-12)
    by_hand = (normal + odd) / (normal + odd).sum()
    np.testing.assert_allclose(sequential.posterior(said), by_hand, rtol=1e-12)
    # Two touches multiply.
    np.testing.assert_allclose(sequential.posterior(said + said), by_hand**2 / (by_hand**2).sum(), rtol=1e-12)


def test_a_common_delay_says_nothing():
    expected = sequential.Expected(np.array([[[0.0, 3.0, 1.0], [0.0, 2.0, 5.0]]]), scatter_us=2.0)
    once, later = (expected.log_likelihood(np.array(0), np.array([0.0, 2.5, 2.0]) + delay) for delay in (0, 100.0))
    np.testing.assert_allclose(once, later)


def test_a_finger_that_passes_is_evidence_unless_it_is_ignored():
    nan = np.nan
    times = np.array([[[0.0, 5.0, nan], [0.0, 5.0, 4.0]]])  # the last finger passes the first object
    seen = sequential.Expected(times, 1.0).log_likelihood(np.array(0), np.array([0.0, 5.0, nan]))
    assert sequential.posterior(seen)[0] > 0.99
    ignored = sequential.Expected(times, 1.0, free_space=False).log_likelihood(np.array(0), np.array([0.0, 5.0, nan]))
    np.testing.assert_array_equal(ignored, [0, 0])


def test_expected_information_picks_the_telling_touch():
    same, apart = [[0.0, 1.0, 2.0]] * 2, [[0.0, 1.0, 2.0], [0.0, 9.0, 2.0]]
    expected = sequential.Expected(np.array([same, apart, same]), scatter_us=1.0)
    outcomes = expected.outcomes(np.random.default_rng(1), 64)
    information = sequential.expected_information(np.zeros(2), outcomes)
    assert information.argmax() == 1
    np.testing.assert_allclose(information[[0, 2]], 0, atol=1e-9)
    # Never more than there is to know, log 2; nearly all of it where the objects lie far apart.
    assert 0.6 < information[1] <= np.log(2) + 1e-9
    # Nor anything when the object is known.
    assert sequential.expected_information(np.array([0.0, -50.0]), outcomes).max() < 1e-9


def test_answers_at_95_percent_are_right_as_often_and_information_needs_fewest_touches():
    rng = np.random.default_rng(2)
    expected = sequential.Expected(rng.normal(0, 1.2, (20, 5, 3)), scatter_us=1.0)
    outcomes = expected.outcomes(rng, 16)
    went = {policy: [] for policy in ("information", "random", "fixed")}
    for number in range(300):
        observed = expected.times_us[:, number % 5] + rng.normal(0, 1, (20, 3))
        for policy, values in went.items():
            episode = sequential.recognise(expected, observed, np.arange(20), policy, rng, outcomes=outcomes)
            values.append((episode.touches, episode.sure, episode.answer == number % 5))
    for policy, values in went.items():
        _, sure, right = np.transpose(values)
        assert right[sure > 0].mean() > 0.92, policy
    touches = {policy: np.array(values)[:, 0] for policy, values in went.items()}
    assert touches["information"].mean() + 0.3 < min(touches["random"].mean(), touches["fixed"].mean())


# --- calibrated answers


def drawn_from_stated(rng, n, objects=5, sharpness=3.0):
    """Probabilities, and objects that are drawn from them: true ones."""
    shares = sequential.posterior(sharpness * rng.normal(size=(n, objects)))
    return shares, (rng.random((n, 1)) > shares.cumsum(1)).sum(1).clip(max=objects - 1)


def test_true_probabilities_have_no_calibration_error_and_boasting_ones_have_it():
    shares, objects = drawn_from_stated(np.random.default_rng(1), 20_000)
    assert calibration.expected_calibration_error(shares, objects) < 0.02
    boasting = sequential.posterior(3 * np.log(shares))
    stated, right = boasting.max(1).mean(), (boasting.argmax(1) == objects).mean()
    assert stated - right > 0.05
    assert calibration.expected_calibration_error(boasting, objects) == pytest.approx(stated - right, abs=0.02)


@pytest.mark.parametrize("coverage", [0.8, 0.9])
def test_conformal_sets_cover_as_stated_on_exchangeable_data(coverage):
    rng = np.random.default_rng(2)
    covered = []
    for _ in range(300):
        shares, objects = drawn_from_stated(rng, 300)
        shares = sequential.posterior(3 * np.log(shares))  # boasting probabilities must not spoil it
        answer = calibration.conformal_sets(shares[100:], shares[:100], objects[:100], coverage)
        covered.append(answer[np.arange(200), objects[100:]].mean())
    assert coverage - 0.01 < np.mean(covered) < coverage + 0.02


def test_conformal_sets_of_too_few_measurements_hold_everything():
    assert calibration.conformal_threshold(np.zeros(5), 0.9) == np.inf
    assert calibration.conformal_threshold(np.arange(9.0), 0.9) == 8
    assert calibration.conformal_threshold(np.arange(19.0), 0.9) == 17


def test_none_of_these_keeps_its_false_alarms_and_finds_what_lies_apart():
    rng = np.random.default_rng(3)
    known = lambda n: rng.normal(size=(n, 6)) + 4 * rng.integers(2, size=(n, 1))
    novelty = calibration.Novelty(known(400))
    limit = calibration.conformal_threshold(novelty.distance(known(400)), 0.9)
    assert 0.05 < np.mean(novelty.distance(known(2000)) > limit) < 0.15
    assert np.mean(novelty.distance(known(500) + 12) > limit) > 0.99


# --- the ladder's models, and other hands


def test_the_ladder_adds_one_effect_of_the_report_after_the_other():
    improved = ladder.NOMINAL.replace("nominal", "nominal_better") + (
        "  - object_push: {shift_mm: 0.8}\n  - tip_radius:\n      scope: object\n      radius_mm: 0\n      objects:\n        lat00: {radius_mm: 2}\n")
    lookup = "  - lookup:\n      name: rest\n      adds: travel_mm\n      covariate: travel_mm\n      knots: [0, 1]\n      values: [0, 1]\n"
    report = types.SimpleNamespace(
        improved_model=improved, steps=[types.SimpleNamespace(effect="tip_radius"), types.SimpleNamespace(effect="object_push")],
        suggested_model=improved + lookup)
    names, models = zip(*ladder.models(report))  # type: ignore[arg-type]  # a stand-in
    assert names == ("nominal", "+ tip_radius", "+ object_push", "+ suggestion")
    assert [("tip_radius" in m, "object_push" in m, "lookup" in m) for m in models] == [
        (False, False, False), (True, False, False), (True, True, False), (True, True, True)]
    assert all(m.count("gaussian_noise") == 1 for m in models)
    # Terms stand in the order of the file, in which they were fitted; the last rungs are the files that are saved.
    assert models[2:] == (improved, improved + lookup)
    assert "sigma_us: 7000" in ladder.with_noise(models[-1], 7000) and "gaussian_noise" not in ladder.with_noise(models[-1], 0)
    assert ladder.with_noise(ladder.NOMINAL, 0).endswith("effects: []\n")


def test_what_any_number_of_fingers_sees_of_a_sphere():
    radius, spacing, standoff = 50.0, 10.0, 60.0
    for fingers in (1, 2, 3, 5):
        x = (np.arange(fingers) - (fingers - 1) / 2) * spacing
        travel = standoff + radius - np.sqrt(radius**2 - x**2)
        values, _, _ = other_rigs.seen(travel[None] / other_rigs.SPEED_MM_S * 1e6, spacing)
        if fingers == 1 or fingers == 2:
            np.testing.assert_allclose(values, [[0.0]], atol=1e-9)
        else:  # 1 / radius, up to the sphere's departure from a parabola
            assert values.shape == (1, fingers - 2)
            np.testing.assert_allclose(values, 1e3 / radius, rtol=0.15)


def test_the_last_rung_is_what_the_command_line_saves(client, tmp_path):
    """Of a set with a lead screw that is no effect, touched anew."""
    rig = ladder.with_noise(ladder.NOMINAL, 5000) + (
        "  - tip_radius: {radius_mm: 3}\n  - formula:\n      name: screw\n      adds: travel_mm\n      expression: \"k * sin(2*pi*travel_mm/5)\"\n"
        "      parameters:\n        k: {value: 0.5, unit: mm, min: -1, max: 1}\n")
    context: Any = types.SimpleNamespace(simulator=client)
    data = collect(client, ladder.DIAGNOSED, touchstone.faces(samples_per_face=8, rounds=1), 96, model=rig, seed=4)
    ladder.write_set(data, tmp_path / "set.csv")
    (tmp_path / "nominal.yaml").write_text(ladder.NOMINAL)
    rungs = ladder.models(context.simulator.diagnose(tmp_path / "set.csv", ladder.NOMINAL, seed=1))
    program = pathlib.Path(find_server()).parent / "touchstone"
    subprocess.run([str(program), "diagnose", "set.csv", "--model", "nominal.yaml", "--save-model", "nominal_better.yaml", "--with-formula"],
                   cwd=tmp_path, check=True, capture_output=True)
    terms = lambda model: model.partition("effects:")[2].partition("provenance:")[0]
    assert len(rungs) >= 3
    assert terms(rungs[-1][1]) == terms((tmp_path / "nominal_better.yaml").read_text())


@pytest.mark.parametrize("changes, said", [
    ([0.5, 0.6, 0.4], ["recognises more", "HARMS: recognises less"]), ([0.5, 0.5, 0.6], ["no difference can be told", "recognises more"])])
def test_a_step_that_harms_is_called_so(changes, said):
    rng = np.random.default_rng(1)
    accuracy = np.array(changes) + rng.normal(0, 0.001, (8, 1)) + rng.normal(0, 0.002, (8, 3))
    rungs = [ladder.Rung(name, "", rmse) for name, rmse in (("nominal", 40e3), ("+ a", 20e3), ("+ b", 21e3))]
    climb = ladder_words.Climb(ladder.RIGS[0], rungs, 100, 200, {
        "rig": accuracy, "simulated": accuracy, "again": accuracy, "ranks": np.full((8, 3), np.nan)})
    assert [climb.judgement(1), climb.judgement(2)] == [said[0], said[1] + ", and the RMSE rises"]
    first = ladder_words.words([climb] * 3, {"x": (1.0, [0.0] * 8), "y": (1.0, [0.0] * 8)}, {
        name: [{"gain": (1, 1, 1)}] * 2 for name in ("mean curvature", "accuracy")}, "emulated", 10)[0]
    assert "b of the first rig" in first and "3 rigs" in first


@pytest.fixture(scope="module")
def client():
    program = pathlib.Path(os.environ["TOUCHSTONE_SERVER_PROGRAM"])
    if not program.exists():
        pytest.skip(f"{program} does not exist; build it, or set TOUCHSTONE_SERVER_PROGRAM.")
    with touchstone.connect() as connected:
        yield connected


def test_where_a_hand_touches_does_not_tell_what_it_touches(client):
    rig = other_rigs.Rig("test", 1)
    found = other_rigs._columns(client, other_rigs.lines(10, 1), 1, rig.model)
    targets = [{tuple(row) for row in found["target_mm"][found["object"] == k].round(3)} for k in range(5)]
    commanded = {tuple(row) for row in other_rigs.lines(10, 1).target_mm.astype(np.float32).astype(float).round(3)}
    # Those that pass an object are left out; nothing else differs.
    assert all(len(each) > 50 and each <= commanded for each in targets)


@pytest.mark.parametrize("fingers", [1, 3, 5])
def test_shuffled_labels_give_chance_and_true_ones_do_not(client, fingers):
    rig = other_rigs.Rig("test", fingers, 20.0)
    rng = np.random.default_rng(1)
    train, test = (other_rigs._sets(other_rigs._columns(client, other_rigs.lines(67, seed), seed, rig.model), 20.0, rng)
                   for seed in (1, 2))
    of = lambda sets: recognisers.accuracy(recognisers.SEEDS["naive Bayes"](1), sets, test)
    shuffled = [of(recognisers.shuffled(train, rng)) for _ in range(60)]
    assert abs(np.mean(shuffled) - 0.2) < 4 * np.std(shuffled) / np.sqrt(60)
    assert of(train) > 0.2 + 4 * np.std(shuffled)


def test_simulated_touches_come_from_all_sides_alike(client):
    data = collect(client, plans.OBJECTS, plans.simulated(600), 600)
    axis = np.abs(data.approach).argmax(1)
    side = 2 * axis + (data.approach[np.arange(600), axis] > 0)
    for k in range(5):
        assert np.bincount(side[data.object == k], minlength=6).tolist() == [20] * 6
    assert len(np.unique(data.target_mm.round(6), axis=0)) == 600  # none of them twice


def test_a_touch_is_simulated_again_as_it_was(client):
    data = collect(client, plans.OBJECTS, plans.simulated(100), 100, model=ladder.with_noise(ladder.NOMINAL, 0), seed=3)
    context: Any = types.SimpleNamespace(simulator=client)
    again = ladder.simulate_again(context, data, ladder.with_noise(ladder.NOMINAL, 0), 1)
    # Directions and targets came as float32: near an edge that is another triangle.
    assert np.nanmedian(np.abs(again - data.times_us)) < 50
    assert np.mean(np.abs(again - data.times_us) < 1000) > 0.95
