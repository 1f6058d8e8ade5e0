"""Recognition by touch: features, splits, and the seed's orderings on small data."""

import os

import numpy as np
import pytest

pytest.importorskip("xgboost", reason="XGBoost is not installed; touchstone.training needs it.")

from touchstone.training import features, measured_sets, plans, recognisers
from touchstone.training.context import Context
from touchstone.training.settings import Settings
from touchstone.training.touch_data import TouchData


def made_of(objects, times_us=None, targets=None, spacing_mm=30.0):
    n = len(objects)
    zeros = np.zeros((n, 3))
    return TouchData(tuple(f"o{k}" for k in range(max(objects) + 1)), np.array(objects), zeros if times_us is None else times_us,
                     zeros if targets is None else targets, zeros, zeros, None, 20.0, spacing_mm)


def test_curvature_of_a_sphere():
    """Fingers 30 mm apart touch a sphere of radius R beside its pole R - sqrt(R^2 - s^2) later: for a large R the curvature
    speed (t_l - 2 t_m + t_r) / s^2 is 1/R."""
    radius_mm, spacing_mm, speed = 5000.0, 30.0, 20.0
    late_us = (radius_mm - np.sqrt(radius_mm**2 - spacing_mm**2)) / speed * 1e6
    convex = made_of([0], np.array([[late_us, 0, late_us]]))
    assert convex.curvature() == pytest.approx([1e3 / radius_mm], rel=1e-4)
    concave = made_of([0], np.array([[0, late_us, 0]]))
    assert concave.curvature() == pytest.approx([-1e3 / radius_mm], rel=1e-4)


def test_recognisers_are_given_curvatures_or_contact_times_themselves():
    times_us = np.random.default_rng(1).integers(0, 500_000, (40, 3)).astype(float)
    data = made_of([0, 1] * 20, times_us)
    rows = np.array([[0, 2, 4, 6, 8], [1, 3, 5, 7, 9]])
    seen = features.curvatures(data, rows) * features.RANGE_PER_M
    for values, row in zip(seen, rows):
        assert values == pytest.approx(np.sort(data.curvature()[row]))
    assert features.triples(data, rows).reshape(2, 5, 3) * 1e5 == pytest.approx(times_us[rows])


def test_a_set_has_no_order():
    data = made_of([0] * 10, np.random.default_rng(1).uniform(0, 1e6, (10, 3)))
    rows = np.arange(10)[None]
    assert np.array_equal(features.curvatures(data, rows), features.curvatures(data, rows[:, ::-1]))


def test_a_dealt_touch_is_in_one_set_at_most_and_of_one_object():
    data = made_of([0] * 23 + [1] * 40, np.arange(189.0).reshape(63, 3))
    rows = features.dealt_rows(data, 5, np.random.default_rng(0))
    assert len(rows) == 4 + 8 and len(np.unique(rows)) == rows.size
    assert all(len(set(data.object[row])) == 1 for row in rows)
    with pytest.raises(ValueError, match="13 sets are wanted, there are 12"):
        features.some(features.dealt_sets(data, 5, np.random.default_rng(0)), 13, np.random.default_rng(0))


def test_histograms_hold_every_touch_however_far_out():
    times_us = np.zeros((5, 3))
    times_us[:, 0] = np.array([-1e9, -59.9, 0.1, 59.9, 1e9]) / 1e3 * 900 / 20 * 1e6
    counts = 5 * features.histogram(made_of([0] * 5, times_us), np.arange(5)[None])
    assert counts.sum() == 5 and counts[0, 0] == 2 and counts[0, -1] == 2


def test_rounds_of_a_pose_are_on_one_side_of_a_split():
    rng = np.random.default_rng(4)
    targets = np.tile(rng.normal(size=(20, 3)), (4, 1))  # 20 poses in 4 rounds
    data = made_of([0, 1] * 40, targets=targets)
    train, test = measured_sets.split(data, 0.4, rng)
    pose = data.poses()
    assert not set(pose[train]) & set(pose[test])
    assert len(train) + len(test) == 80 and len(test) == 32
    loose_train, loose_test = measured_sets.split(data, 0.4, rng, by_pose=False)
    assert set(pose[loose_train]) & set(pose[loose_test]), "what is compared in the sensitivity table is another split"


def test_drawn_sets_are_of_different_touches_of_one_object():
    data = made_of([0] * 20 + [1] * 20, np.column_stack([np.arange(40.0) * 1e6] * 2 + [np.zeros(40)]))
    seen = features.drawn_sets(data, 15, 30, np.random.default_rng(5), features.curvatures_as_touched)
    for row, k in zip(seen.values * features.RANGE_PER_M, seen.objects):
        assert len(set(row)) == 15
        assert set(row.round(6)) <= set(data.curvature()[data.object == k].round(6))
    with pytest.raises(ValueError, match="sets of 21 touches of o0"):
        features.drawn_sets(data, 21, 2, np.random.default_rng(5))


def test_a_part_has_of_every_object_as_many():
    data = made_of([0] * 50 + [1] * 60)
    assert np.bincount(measured_sets.part(data, 41, np.random.default_rng(1)).object).tolist() == [21, 20]


@pytest.fixture(scope="module")
def pools(tmp_path_factory):
    """(simulated without noise, with noise, emulated) touches: as the experiments have them, fewer."""
    with Context(Settings(tmp_path_factory.mktemp("training"), quick=True, rig=os.environ.get("TOUCHSTONE_RIG", ""))) as context:
        context.begin("test")
        yield (context.simulated(640, model=plans.IDEAL), context.simulated(640, model=plans.NOISY),
               context.measured(plans.measured(context.settings), options=(*plans.RIG, "--speedup", "60")))


def rates(test):
    """Marks what trains on touches of the emulated rig, which exists once."""
    return pytest.mark.second_tier("statistical: recognition rates over seeds")(pytest.mark.xdist_group("training_touches")(test))


def accuracies(pool, rig, touches, shuffle=False):
    """Of XGBoost on 400 emulated sets, one for each of three seeds."""
    found = []
    for seed in range(3):
        rng = np.random.default_rng(seed)
        train = features.drawn_sets(pool, touches, 640, rng)
        if shuffle:
            train = recognisers.shuffled(train, rng)
        found.append(recognisers.accuracy(recognisers.SEEDS["XGBoost"](seed), train, features.drawn_sets(rig, touches, 400, rng)))
    return np.array(found)


@rates
def test_noise_in_training_helps_on_emulated_touches(pools):
    ideal, noisy, rig = pools
    gain = accuracies(noisy, rig, 15) - accuracies(ideal, rig, 15)
    assert gain.min() > 0.05, gain


@rates
def test_more_touches_help(pools):
    _, noisy, rig = pools
    gain = accuracies(noisy, rig, 20) - accuracies(noisy, rig, 3)
    assert gain.min() > 0.05, gain


@rates
def test_shuffled_labels_give_chance(pools):
    _, noisy, rig = pools
    # Twelve hundred sets of few touches are not independent: twice the spread of as many independent ones, at 4 sigma.
    assert abs(accuracies(noisy, rig, 5, shuffle=True).mean() - 0.2) < 8 * np.sqrt(0.2 * 0.8 / 1200)
