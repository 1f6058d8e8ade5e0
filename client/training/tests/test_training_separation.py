"""No pose that is tested lies in training: of any seed, source and experiment; and what shuffled labels are judged by."""

import re

import numpy as np
import pytest

pytest.importorskip("xgboost", reason="XGBoost is not installed; touchstone.training needs it.")

from touchstone.training import controls, features, ladder, picture_data, plans, recognisers, separation
from touchstone.training.context import Context
from touchstone.training.experiments import other_rigs
from touchstone.training.settings import Settings

SEEDS = range(1, 11)  # of a whole run
# Every `use` of simulated touches and pictures but "training": what is tested, calibrated or predicted.
TESTED = ("testing", "calibration", "more", "alone", "novel testing", "novel calibration")


@pytest.fixture(scope="module")
def context(tmp_path_factory):
    """Its rig is the simulator: the poses that a source draws are the same functions of plan and seed."""
    with Context(Settings(tmp_path_factory.mktemp("separation"))) as one:
        target = one.simulator.target
        with Context(Settings(one.settings.out, server=target, rig=target)) as both:
            yield both


@pytest.fixture(scope="module")
def trained_poses(context):
    """Of the simulated touches of all seeds that are trained on."""
    return np.concatenate([context.simulated(800, seed=seed, use=use).poses() for seed in SEEDS for use in ("training", "novel training")])


@pytest.mark.parametrize("plan", ["measured", "measured_in_rounds"])
def test_no_pose_of_the_rig_is_simulated_for_training(context, trained_poses, plan):
    separation.check(trained_poses, context.measured(getattr(plans, plan)(context.settings)).poses())


def test_no_pose_of_the_ladders_rigs_is_simulated_for_training(context, trained_poses):
    for data in ladder.measured(context):
        separation.check(trained_poses, data.poses())


def test_no_simulated_pose_is_trained_on_and_tested(context, trained_poses):
    for seed in SEEDS:
        for use in TESTED:
            separation.check(trained_poses, context.simulated(100, seed=seed, use=use).poses())


def test_a_source_draws_the_same_poses_for_the_same_seed(context):
    """Which is why seeds of the rig must be other ones: it shared 40 of 240 poses with the training of seed 1."""
    same = separation.pose_seed("training", 1)
    by_simulator = context.simulated(800, seed=1).poses()
    rig = picture_data.touchstone.faces(samples_per_face=8, rounds=4)
    from touchstone.training.touch_data import collect
    by_rig = collect(context.rig(), plans.OBJECTS, rig, rig.samples(5), seed=same).poses()
    with pytest.raises(separation.Leak, match=r"of 240 poses that are tested are trained on"):
        separation.check(by_simulator, by_rig)


def test_no_line_of_other_rigs_is_trained_on_and_tested():
    numbers = lambda use, *seed: separation.pose_numbers(np.column_stack([
        (touches := other_rigs.lines(20, separation.pose_seed(use, "lines", *seed))).target_mm, touches.approach, touches.lateral]))
    trained = np.concatenate([numbers("training", seed) for seed in SEEDS])
    separation.check(trained, numbers("rig"))
    for seed in SEEDS:
        separation.check(trained, numbers("testing", seed))


def test_no_pose_of_a_camera_is_trained_on_and_tested(context):
    def poses(use, seed):
        views = picture_data.virtual_poses(context.simulator, "lat00", 400, separation.pose_seed(use, "pictures", seed))
        return separation.command_numbers(("lat00",), np.zeros(400, int), views.target_mm, views.approach, views.lateral)

    trained = np.concatenate([poses("training", seed) for seed in SEEDS])
    rig = picture_data.rig_poses(12, separation.pose_seed("rig", "pictures", "lat00"))
    separation.check(trained, separation.command_numbers(("lat00",), np.zeros(len(rig), int), rig.target_mm, rig.approach, rig.lateral))
    for seed in SEEDS:
        separation.check(trained, poses("testing", seed))


def sets_of(poses):
    poses = np.array(poses)
    return features.FeatureSets(np.random.default_rng(0).normal(size=poses.shape), np.arange(len(poses)) % 2, poses)


def test_a_recogniser_refuses_a_test_on_a_pose_that_it_was_trained_on():
    trained = recognisers.Trained(recognisers.SEEDS["naive Bayes"](1), sets_of([[1, 2], [3, 4], [5, 6], [7, 8]]))
    assert 0 <= trained.accuracy(sets_of([[9, 10], [11, 12]])) <= 1
    for ask in (trained.predict, trained.probabilities, trained.accuracy):
        with pytest.raises(separation.Leak, match=re.escape("1 of 4 poses that are tested are trained on")):
            ask(sets_of([[9, 10], [11, 3]]))


def test_seeds_of_another_use_are_other_ones():
    seeds = {separation.pose_seed(use, seed) for use in ("rig", "training", *TESTED) for seed in range(2000)}
    assert len(seeds) == 2000 * (2 + len(TESTED)) and max(seeds) < 1 << 48


def test_a_pose_has_the_same_number_in_every_call_and_with_every_neighbour():
    commands = np.random.default_rng(1).normal(size=(20, 9)).astype(np.float32).astype(float)
    numbers = separation.pose_numbers(commands)
    assert len(set(numbers)) == 20 and np.array_equal(separation.pose_numbers(commands[5:7]), numbers[5:7])
    assert separation.pose_numbers(np.array([[0.0]])) == separation.pose_numbers(np.array([[-0.0]]))


# --- controls


def shuffles(rng, seeds=3, count=40, told=0.0):
    """Accuracies of recognisers that know nothing, or a share of the answers: all of a test is judged by one of them."""
    return 0.2 + told + rng.normal(0, 0.06, (seeds, count))


def test_a_dozen_controls_of_nothing_are_all_called_chance_in_19_of_20_reports():
    rng = np.random.default_rng(1)
    reports = [all(controls.control(shuffles(rng), 0.2).is_chance for _ in range(controls.CONTROLS)) for _ in range(400)]
    assert 0.92 < np.mean(reports) < 0.98


def test_a_leak_of_three_points_is_no_chance():
    found = controls.control(shuffles(np.random.default_rng(2), told=0.03), 0.2)
    assert not found.is_chance and "NOT CHANCE" in found.words()
