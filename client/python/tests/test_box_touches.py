"""Touches that know no object."""

import warnings

import numpy as np
import pytest

import touchstone

BOX = ((-75, -60, -50), (75, 60, 90))


def test_targets_are_on_the_faces_and_directions_within_the_cone():
    touches = touchstone.box_touches(*BOX, samples_per_face=500, seed=1, max_tilt_deg=20, spread=0.6)
    assert len(touches) == 3000
    for face in range(6):
        rows = slice(500 * face, 500 * (face + 1))
        axis, side = face // 2, face % 2 == 0
        target, approach = touches.target_mm[rows], touches.approach[rows]
        np.testing.assert_allclose(target[:, axis], BOX[1 if side else 0][axis])
        for other in {0, 1, 2} - {axis}:
            half = (BOX[1][other] - BOX[0][other]) / 2
            off = target[:, other] - (BOX[0][other] + half)
            assert 0.57 * half < np.abs(off).max() <= 0.6 * half
            assert abs(off.mean()) < 0.1 * half
        inward = -approach[:, axis] if side else approach[:, axis]
        assert np.cos(np.radians(20)) <= inward.min() < np.cos(np.radians(19))
        # Uniform over the cone's solid angle: the cosine is uniform.
        assert inward.mean() == pytest.approx((1 + np.cos(np.radians(20))) / 2, abs=0.002)
    np.testing.assert_allclose(np.linalg.norm(touches.lateral, axis=1), 1)
    np.testing.assert_allclose(np.sum(touches.lateral * touches.approach, 1), 0, atol=1e-12)


def test_the_seed_alone_decides_them():
    one, same, other = (touchstone.box_touches(*BOX, seed=seed) for seed in (1, 1, 2))
    np.testing.assert_array_equal(one.approach, same.approach)
    assert (one.approach != other.approach).all(1).all()


def test_one_finger_tells_objects_apart_by_them_as_it_cannot_by_faces(client):
    one_finger = "touchstone: model/1\nname: one\nend_effector: {fingers: 1, spacing_mm: 30}\neffects: []\n"
    depth = lambda touches, thing: client.touch(thing, touches, model=one_finger)["contact_time_us"][:, 0] * 20 / 1e6 - touches.standoff_mm
    blind = touchstone.box_touches((-75,) * 3, (75,) * 3, 20, seed=1, stroke_mm=120)
    assert np.nanmedian(np.abs(depth(blind, "lat00") - depth(blind, "lat20"))) > 2
    for thing in ("lat00", "lat20"):
        aimed = client.plan(touchstone.faces(samples_per_face=20, rounds=1), thing, 120, seed=1)
        assert np.abs(depth(aimed, thing)).max() < 0.01


@pytest.mark.parametrize("options, words", [
    ({"max_mm": (75, -60, 90)}, "every number of the former must be the smaller"),
    ({"min_mm": (1, 2)}, "min_mm is .* three finite numbers"),
    ({"spread": 1.5}, "spread is 1.5; it must lie between 0 and 1"),
    ({"max_tilt_deg": 70}, "max_tilt_deg is 70"),
    ({"samples_per_face": 0}, "samples_per_face is 0"),
    ({"stroke_mm": 0}, "stroke_mm is 0; it must be above 0"),
])
def test_mistakes_are_named(options, words):
    with pytest.raises(touchstone.InvalidRequest, match=words):
        touchstone.box_touches(**{"min_mm": BOX[0], "max_mm": BOX[1], **options})


def test_a_dataset_that_ends_before_the_last_face_says_so(client):
    with pytest.warns(UserWarning, match="200 touches of each, which reach 1 of the 6 faces.*samples_per_face=34 they reach all"):
        client.dataset(["lat00", "lat20"], touchstone.faces(samples_per_face=1000, rounds=1), samples=400)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        client.dataset(["lat00", "lat20"], touchstone.faces(samples_per_face=34, rounds=1), samples=400)
