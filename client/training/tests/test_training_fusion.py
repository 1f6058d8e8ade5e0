"""Fusion of touch and sight: the rules by hand, weights from validation data alone, and that two senses beat one."""

import pathlib

import numpy as np
import pytest

from touchstone.training import fusion_rules, two_senses
from touchstone.training.context import Context
from touchstone.training.experiments import fusion
from touchstone.training.settings import Settings
from touchstone.training.touch_data import TouchData

_SQUEEZENET = pathlib.Path(__file__).resolve().parents[4] / "shared/data/backbone/squeezenet1.0.onnx"


def test_product_by_hand():
    # 0.6 * 0.1, 0.3 * 0.5, 0.1 * 0.4 = 0.06, 0.15, 0.04, of 0.25
    found = fusion_rules.product(np.array([[0.6, 0.3, 0.1]]), np.array([[0.1, 0.5, 0.4]]))
    np.testing.assert_allclose(found, [[0.24, 0.6, 0.16]])
    np.testing.assert_allclose(fusion_rules.product(np.array([[1.0, 0.0]]), np.array([[0.0, 1.0]])), [[0.5, 0.5]])


def test_weighted_sum_by_hand():
    touch, image = np.array([[0.6, 0.4]]), np.array([[0.1, 0.9]])
    np.testing.assert_allclose(fusion_rules.weighted_sum(touch, image, 0.75), [[0.475, 0.525]])
    assert np.array_equal(fusion_rules.weighted_sum(touch, image, 1.0), touch)
    with pytest.raises(ValueError, match=r"1\.5 is not from 0 to 1"):
        fusion_rules.weighted_sum(touch, image, 1.5)


def test_the_weight_goes_to_the_sense_that_knows():
    right, wrong, objects = np.eye(2)[[0, 1]] * 0.8 + 0.1, np.eye(2)[[1, 0]] * 0.8 + 0.1, np.array([0, 1])
    assert fusion_rules.choose_weight(right, wrong, objects) == 1
    assert fusion_rules.choose_weight(wrong, right, objects) == 0
    # Each is sure of one of two pairs and wrong by as much in the other: only the middle treats both the same.
    first, second = np.array([[0.9, 0.1], [0.6, 0.4]]), np.array([[0.4, 0.6], [0.1, 0.9]])
    assert fusion_rules.choose_weight(first, second, objects) == pytest.approx(0.5)


def test_pairs_are_of_one_object_and_all_of_them():
    touch, image = np.array([0, 0, 1]), np.array([1, 0, 0, 2])
    rows, columns = fusion_rules.pairs(touch, image)
    assert sorted(zip(rows.tolist(), columns.tolist())) == [(0, 1), (0, 2), (1, 1), (1, 2), (2, 0)]


def test_the_weight_is_chosen_on_validation_data_alone():
    said = lambda probabilities: two_senses.Said(probabilities, np.arange(5))
    right, wrong = said(np.eye(5) * 0.8 + 0.04), said(np.roll(np.eye(5), 1, 1) * 0.8 + 0.04)
    # In validation touch knows and sight errs, in the test it is the other way round: the weight must not follow the test.
    found = two_senses.fused(two_senses.Sense(wrong, right), two_senses.Sense(right, wrong))
    assert found.accuracy == {"touch": 0.0, "image": 1.0, "product": found.accuracy["product"], "weighted sum": 0.0} and found.weight == 1.0
    # The sweep shows what every weight would have given on the test.
    assert (found.sweep[0], found.sweep[-1]) == (1.0, 0.0) and len(found.sweep) == len(fusion_rules.WEIGHTS)
    assert np.trace(found.confusion["image"]) == 5 and np.trace(found.confusion["touch"]) == 0


def _touches(count):
    rng = np.random.default_rng(1)
    target, approach, lateral = rng.normal(size=(3, count, 3))
    return TouchData(("lat00", "lat05", "lat10", "lat15", "lat20"), np.arange(count) % 5, rng.normal(size=(count, 3)), target, approach, lateral,
                     None, 20.0, 30.0)


def test_no_pose_of_a_measured_touch_is_in_two_parts():
    touches = _touches(400)[np.tile(np.arange(400), 3)]  # three rounds
    for seed in range(10):
        found = fusion.measured_touches(touches, 5, np.random.default_rng(seed))
        train, validation, test = (set(sets.poses.ravel()) for sets in (found.train, found.validation, found.test))
        assert not train & validation and not train & test and not validation & test
        assert found.touches == 160


def test_virtual_validation_shares_no_touch_with_training():
    train, validation = two_senses.virtual_sets(_touches(640), 15, np.random.default_rng(1))
    assert len(train) == 640 and not set(train.poses.ravel()) & set(validation.poses.ravel())


@pytest.mark.second_tier("statistical: recognition rates over seeds")
@pytest.mark.skipif(not _SQUEEZENET.exists(), reason=f"there is no backbone file {_SQUEEZENET}")
def test_two_senses_beat_each_alone(tmp_path):
    with Context(Settings(tmp_path, quick=True, backbone=_SQUEEZENET)) as context:
        cache = fusion.FeatureCache(context)
        runs = [fusion.all_virtual(context, cache, seed) for seed in range(1, 4)]
    for alone in ("touch", "image"):
        gained = [run.accuracy["product"] - run.accuracy[alone] for run in runs]
        assert np.mean(gained) > 0, (alone, [run.accuracy for run in runs])
