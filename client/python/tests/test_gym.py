"""Recognition by touch as Gymnasium environments, judged by Gymnasium's own checker."""

import os
import pathlib
import subprocess
import sys
import warnings

import numpy as np
import pytest

import touchstone

gymnasium = pytest.importorskip("gymnasium", reason="Gymnasium is not installed; the tests of touchstone.gym need it.")

from gymnasium.utils.env_checker import check_env  # noqa: E402

import touchstone.gym  # noqa: E402

NOISY = "touchstone: model/1\nname: noisy\neffects:\n  - gaussian_noise: {sigma_us: 5000}\n"
EXAMPLE = pathlib.Path(__file__).resolve().parents[1] / "examples/gym_recognise.py"
TOUCHES = 24  # of default_touches()


@pytest.fixture
def make(server):
    """A function that makes one environment, or several."""
    made = []

    def new(num_envs=0, **options):
        options = {"targets": server.target, "model": NOISY, **options}
        made.append(gymnasium.make_vec("touchstone/Recognise-v0", num_envs=num_envs, **options) if num_envs
                    else gymnasium.make("touchstone/Recognise-v0", **options))
        return made[-1]

    yield new
    for each in made:
        each.close()


def episode(env, seed, actions):
    first, _ = env.reset(seed=seed)
    return [first, *(env.step(action)[0] for action in actions)]


def test_gymnasiums_checker_accepts_it(make):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_env(make(max_touches=5).unwrapped, skip_render_check=True)


def test_the_same_seed_gives_the_same_bytes(make):
    one, two = (episode(make(), 7, [0, 5, 5, 11]) for _ in range(2))
    assert b"".join(o.tobytes() for o in one) == b"".join(o.tobytes() for o in two)


def test_other_seeds_show_other_objects_and_noise(make):
    env = make()
    assert len({episode(env, seed, [0, 1, 2])[-1].tobytes() for seed in range(20)}) > 5


def test_a_touch_is_seen_as_the_source_gives_it(make, client):
    env = make(objects=("lat00", "lat20"))
    env.reset(seed=1, options={"object": "lat20"})
    observation, reward, terminated, truncated, info = env.step(4)
    touches = touchstone.gym.default_touches(client, ("lat00", "lat20"))
    times_us = client.touch("lat20", touches[4], model=touchstone_without_noise())["descriptor_us"][0]
    met = np.isfinite(times_us)
    assert touches.stroke_mm is not None
    stroke_us = touches.stroke_mm[4] / 20 * 1e6
    assert observation[4, 0] == 1 and observation[:4].sum() == 0 and observation[5:].sum() == 0
    np.testing.assert_array_equal(observation[4, 4:], met)
    np.testing.assert_allclose(observation[4, 1:4][met] * stroke_us, times_us[met], atol=6 * 5000)
    assert (reward, terminated, truncated, info) == (-0.05, False, False, {"touches": 1})


def touchstone_without_noise():
    return "touchstone: model/1\nname: bare\neffects: []\n"


def test_a_finger_that_passes_is_seen_as_such(make):
    # From above, from the middle outwards: the last ones have one finger, two or all beside the object.
    beside_mm = np.linspace(0, 90, 10)
    touches = touchstone.touches(target_mm=[[x, 0, 0] for x in beside_mm], approach=[[0, 0, -1]] * 10, lateral=[[1, 0, 0]] * 10,
                                 standoff_mm=100, speed_mm_s=20, stroke_mm=140)
    env = make(objects=("lat00", "lat20"), touches=touches)
    env.reset(seed=1)
    rows = np.array([env.step(k)[0][k] for k in range(10)])
    met = rows[:, 4:]
    assert (met == 0).any() and (met == 1).any()
    assert (rows[:, 1:4][met == 0] == 0).all()


def test_touches_of_its_own_favour_no_object(client):
    objects = ("lat00", "lat05", "lat20")
    touches = touchstone.gym.default_touches(client, objects)
    again = touchstone.gym.default_touches(client, objects[::-1])
    np.testing.assert_array_equal(touches.target_mm, again.target_mm)
    # Up to the rim: of every object some fingers pass.
    for thing in objects:
        times_us = client.touch(thing, touches, model=touchstone_without_noise())["descriptor_us"]
        assert 0 < np.isnan(times_us).sum() < times_us.size, thing


def test_an_object_that_is_not_there_is_named(make):
    with pytest.raises(touchstone.NotFound, match="lat21"):
        make(objects=("lat00", "lat21"))


def test_answers_end_an_episode_with_their_reward(make):
    env = make(objects=("lat00", "lat20"))
    for thing, answer, expected in (("lat00", 0, 1.0), ("lat00", 1, -1.0), ("lat20", 1, 1.0)):
        env.reset(seed=1, options={"object": thing})
        _, reward, terminated, truncated, info = env.step(TOUCHES + answer)
        assert (reward, terminated, truncated) == (expected, True, False)
        assert info == {"touches": 0, "object": thing, "right": expected > 0}


def test_without_an_answer_it_is_truncated(make):
    env = make(max_touches=3)
    env.reset(seed=1)
    assert [env.step(k)[3] for k in range(3)] == [False, False, True]


def test_many_environments_are_as_each_alone(make):
    actions = [[0, 9, 9], [4, 4, TOUCHES], [TOUCHES + 1, 0, 2]]  # of three environments, step by step
    together = make(3)
    seen = [together.reset(seed=11)[0]]
    rewards = []
    for step in np.transpose(actions):
        observation, reward, *_ = together.step(step)
        seen.append(observation)
        rewards.append(reward)
    for k in (0, 1):
        alone = make()
        assert b"".join(o.tobytes() for o in episode(alone, 11 + k, actions[k])) == b"".join(s[k].tobytes() for s in seen)
    # The third answered at once; the next step only began its next episode.
    assert abs(rewards[0][2]) == 1 and rewards[1][2] == 0 and seen[2][2].sum() == 0
    assert rewards[2][2] == -0.05 and seen[3][2, 2, 0] == 1


def test_a_step_of_all_environments_is_one_request(make, monkeypatch):
    from touchstone.samples import Samples

    asked = []
    batch = Samples._batch
    monkeypatch.setattr(Samples, "_batch", lambda self, indices: asked.append(len(indices)) or batch(self, indices))
    together = make(32)
    together.reset(seed=1)
    together.step(np.arange(32) % TOUCHES)
    assert asked == [32]


def test_it_counts_as_a_vector_environment(make):
    together = make(4)
    observation, info = together.reset(seed=[5, 6, 7, 8])
    assert together.observation_space.contains(observation) and info["touches"].tolist() == [0] * 4
    wrapped = gymnasium.wrappers.vector.RecordEpisodeStatistics(together)
    wrapped.reset(seed=1)
    _, _, ended, _, info = wrapped.step(np.full(4, TOUCHES))
    assert ended.all() and np.isin(info["episode"]["r"], (-1.0, 1.0)).all()


@pytest.mark.parametrize("options, words", [
    (dict(objects=("lat00",)), "at least two"),
    (dict(objects=("lat00", "no_such")), "no_such"),
    (dict(max_touches=0), "max_touches is 0"),
    (dict(model="touchstone: model/1\nname: x\neffects:\n  - tip_radios: {radius_mm: 1}\n"), "tip_radios"),
])
def test_wrong_arguments_are_refused_in_words(make, options, words):
    with pytest.raises(touchstone.TouchstoneError, match=words):
        make(**options)


def test_wrong_use_is_refused_in_words(make):
    env, together = make().unwrapped, make(2).unwrapped
    with pytest.raises(touchstone.InvalidRequest, match="call reset"):
        env.step(0)
    env.reset(seed=1)
    for action in (-1, TOUCHES + 5, 1.5):
        with pytest.raises(touchstone.InvalidRequest, match="to answer"):
            env.step(action)
    with pytest.raises(touchstone.InvalidRequest, match="lat00"):
        env.reset(options={"object": "cup"})
    with pytest.raises(touchstone.InvalidRequest, match="options has no"):
        env.reset(options={"thing": "lat00"})
    together.reset(seed=1)
    with pytest.raises(touchstone.InvalidRequest, match="2 whole numbers"):
        together.step(np.array([0, 99]))


@pytest.mark.parametrize("num_envs", [0, 2])
def test_a_closed_environment_stays_closed(make, num_envs):
    env = make(num_envs).unwrapped
    env.reset(seed=1)
    env.close()
    for use in (lambda: env.reset(seed=1), lambda: env.step(np.zeros(num_envs, int) if num_envs else 0)):
        with pytest.raises(touchstone.Refused, match="The environment is closed; make a new one"):
            use()


def test_the_example_learns(server):
    package = os.path.dirname(os.path.dirname(touchstone.__file__))
    done = subprocess.run([sys.executable, EXAMPLE, server.target, "--episodes", "600"], capture_output=True, text=True, timeout=120,
                          check=True, env={**os.environ, "PYTHONPATH": package})
    shares = [float(word[:-1]) for word in done.stdout.split() if word.endswith("%")]
    assert shares[1] > 50 and shares[2] == 20, done.stdout
