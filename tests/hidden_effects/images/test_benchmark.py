"""The benchmark's own parts: sets, strengths, unlisted causes, mistakes, judge."""
import copy
import math

import numpy as np
import pytest

cv2 = pytest.importorskip("cv2", reason="opencv-python-headless is not installed (deploy/python-packages.txt)")

import arms  # noqa: E402
import data_errors  # noqa: E402
import judge  # noqa: E402
import sets  # noqa: E402
import strengths  # noqa: E402
import unlisted  # noqa: E402

SCENE = sets.make_scene(2, pictures=4, repeats=1)
SIGNAL = strengths.Signal(SCENE)


def test_seeds_of_tuning_and_table_share_no_number():
    used = [{arms.seed_of(a, k, name) for a in arms.ARMS for k in range(a.sets)} for name in ("tuning", "held-out")]
    assert not used[0] & used[1]
    assert len(used[0]) == sum(a.sets for a in arms.ARMS)


def test_a_scene_is_five_objects_by_twenty_pictures_with_repeats_in_every_other_seed():
    with_repeats, without = sets.make_scene(10), sets.make_scene(11)
    for scene, repeats in ((with_repeats, 5), (without, 0)):
        assert len(scene.shots) == 100
        for number in range(5):
            poses = [tuple(s.pose.eye) for s in scene.shots if s.object == number]
            assert len(poses) == 20 and len(set(poses)) == 20 - repeats


def test_what_is_hidden_changes_neither_poses_nor_noise():
    plain = sets.make_files(SCENE, sets.Truth("a", 2), lambda n: sets.make_physics({}))
    brighter = sets.make_files(SCENE, sets.Truth("b", 2), lambda n: sets.make_physics({"background_level": 40}))
    darker = sets.make_files(SCENE, sets.Truth("c", 2), lambda n: sets.make_physics({"background_level": 80}))
    for one, two in zip(brighter.pictures, darker.pictures):
        background = (one < 60) & (two < 110) & (two > 60)
        assert np.abs(two[background].astype(int) - one[background] - 40).max() <= 1
    assert [r["eye"].tolist() for r in plain.rows] == [r["eye"].tolist() for r in darker.rows]


# Drawn again at every step of a search; the principal point is of their kind and stays.
REDRAWN = pytest.mark.second_tier("repeated: strengths of the other effects of geometry and shadow")


@pytest.mark.parametrize("effect", [pytest.param(effect, marks=REDRAWN) if effect in (
    "radial_distortion", "focal_error", "camera_rotation", "camera_translation", "cast_shadow") else effect
    for effect in strengths.EFFECTS])
def test_weak_effects_are_of_10_to_15_standard_errors_a_picture_and_realistic_ones_stronger(effect):
    low, high = strengths.WEAK
    assert 0.95 * low < SIGNAL.of({effect: strengths.weak(effect, SCENE, SIGNAL)}) < 1.05 * high
    assert SIGNAL.of({effect: strengths.realistic(effect, SCENE, SIGNAL)}) >= strengths.MIN_REALISTIC


@pytest.mark.parametrize("name", unlisted.NAMES)
def test_unlisted_causes_change_pictures_and_grow_with_their_size(name):
    small, large = (SIGNAL.of({}, unlisted.physics_of(name, size, SCENE)) for size in (0.05, 0.1))
    assert 0 < small < large


def test_albedo_is_smooth_and_has_the_spread_that_is_asked():
    field = unlisted.smooth_albedo(SCENE, 0.05, 40)(0).albedo
    points = sets.objects()[0].vertices
    values = field(points)
    assert values.mean() == pytest.approx(1, abs=1e-9) and values.std() == pytest.approx(0.05, rel=1e-6)
    assert np.abs(field(points + [1.0, 0, 0]) - values).max() < 0.01


@pytest.mark.parametrize("name", data_errors.NAMES)
def test_mistakes_change_the_set_and_are_written(name, tmp_path):
    files = sets.make_files(SCENE, sets.Truth("x", 2), lambda n: sets.make_physics({}))
    before = copy.deepcopy(files)
    data_errors.make(name, files, np.random.default_rng(3))
    sets.write_set(before, tmp_path / "before")
    sets.write_set(files, tmp_path / "after")
    texts = lambda folder: [(tmp_path / folder / f).read_text() for f in ("images.csv", "camera.yaml")]
    pictures = lambda folder: [cv2.imread(str(tmp_path / folder / r["file"])).tobytes() for r in files.rows]
    assert texts("before") != texts("after") or pictures("before") != pictures("after")
    assert (tmp_path / "after.truth.json").exists() and not list((tmp_path / "after").glob("*.json"))


def a_truth(**fields):
    return {"effects": {}, "unlisted": "", "data_error": "", "strength": "realistic", **fields}


def a_step(effect, value=1.0, error=0.1, name="stops", probability=0.99, **fields):
    return {"effect": effect, "probability": probability,
            "parameters": [{"name": name, "value": value, "std_error": error, "lower": value - 2 * error,
                            "upper": value + 2 * error}], **fields}


def test_the_judge_marks_what_is_right_and_what_is_confidently_wrong():
    hidden = a_truth(effects={"exposure": 1.1})
    found = judge.judge({"verdict": "MISSING_EFFECTS", "steps": [a_step("exposure")]}, hidden, 1)
    assert found.right_first and found.all_found and found.right and found.covered == [True]
    wrong = judge.judge({"verdict": "MISSING_EFFECTS", "steps": [a_step("gamma")]}, hidden, 1)
    assert wrong.confidently_wrong and not wrong.right_first
    unsure = judge.judge({"verdict": "MISSING_EFFECTS", "steps": [a_step("gamma", probability=0.6)]}, hidden, 1)
    assert not unsure.confidently_wrong and not unsure.right
    far = judge.judge({"verdict": "MISSING_EFFECTS", "steps": [a_step("exposure", value=2)]}, hidden, 1)
    assert far.covered == [False]
    nobody = judge.judge(None, hidden, 1)
    assert not nobody.report and not nobody.right and not nobody.confidently_wrong


def test_an_equivalent_counts_only_within_its_class():
    hidden = a_truth(effects={"principal_point": (1, 0)})
    turned = a_step("camera_rotation", equivalent=["principal_point"])
    assert judge.judge({"verdict": "MISSING_EFFECTS", "steps": [turned]}, hidden, 1).right_first
    brighter = a_step("exposure", equivalent=["principal_point"])
    assert not judge.judge({"verdict": "MISSING_EFFECTS", "steps": [brighter]}, hidden, 1).right_first


def test_claims_where_nothing_is_hidden_are_false_and_noise_is_none():
    assert judge.judge({"verdict": "UNEXPLAINED"}, a_truth(), 1).false_claim
    assert judge.judge({"verdict": "MISSING_EFFECTS", "steps": [a_step("gamma")]}, a_truth(), 1).false_claim
    assert judge.judge({"verdict": "CHECK_DATA"}, a_truth(), 1).false_claim
    noise = {"verdict": "ADEQUATE", "refitted": [{"effect": "image_noise"}]}
    assert not judge.judge(noise, a_truth(), 1).false_claim


def test_unlisted_causes_must_be_left_nameless_and_mistakes_named():
    dirt = a_truth(unlisted="dirt", strength="strong")
    assert judge.judge({"verdict": "UNEXPLAINED"}, dirt, 1).right
    assert judge.judge({"verdict": "ADEQUATE"}, dirt, 1).confidently_wrong
    assert judge.judge({"verdict": "MISSING_EFFECTS", "steps": [a_step("vignetting")]}, dirt, 1).confidently_wrong
    mirrored = a_truth(data_error="mirrored")
    named = lambda kind: {"verdict": "CHECK_DATA", "data_problems": [{"kind": kind.upper()}]}
    assert judge.judge(named("mirrored"), mirrored, 1).right
    assert judge.judge(named("wrong_object"), mirrored, 1).confidently_wrong


def test_intervals_of_shares_are_clopper_and_pearsons():
    assert judge.interval(0, 100) == (0.0, pytest.approx(1 - 0.025 ** (1 / 100)))
    assert judge.interval(100, 100) == (pytest.approx(0.025 ** (1 / 100)), 1.0)
    low, high = judge.interval(7, 20)
    tail = lambda p, ks: sum(math.comb(20, k) * p ** k * (1 - p) ** (20 - k) for k in ks)
    assert tail(low, range(7, 21)) == pytest.approx(0.025) and tail(high, range(8)) == pytest.approx(0.025)
