#!/usr/bin/env python3
"""An agent that learns to recognise objects by touch, in Gymnasium's words; put your own in place of Agent.

    python3 client/python/examples/gym_recognise.py [HOST:PORT] [--episodes 2000] [--environments 64] [--seed 1]

Without an address a touchstone-server is started. The agent makes three touches that it chose once, remembers what they
were like for the object that each answer turned out to be, and answers what was most alike.
"""

import argparse

import gymnasium
import numpy as np

import touchstone.gym  # noqa: F401 - makes the environments known to Gymnasium

MODEL = "touchstone: model/1\nname: noisy\neffects:\n  - gaussian_noise: {sigma_us: 47790}\n"


class Agent:
    """Nearest mean of the observations after the same three touches."""

    def __init__(self, touches, objects, rng):
        self.plan = rng.choice(touches, 3, replace=False)
        self.touches = touches
        self.sum = np.zeros((objects, 0))
        self.count = np.zeros(objects)
        self.rng = rng

    def act(self, observations, made):
        """Actions for (N, touches, features) observations after `made` touches of each."""
        features = observations.reshape(len(observations), -1)
        if not self.sum.size:
            self.sum = np.zeros((len(self.count), features.shape[1]))
        known = self.count.min() >= 10
        means = self.sum / np.maximum(self.count, 1)[:, None]
        distance = ((features[:, None] - means) ** 2).sum(-1)
        answers = distance.argmin(1) if known else self.rng.integers(len(self.count), size=len(features))
        return np.where(made < 3, self.plan[np.minimum(made, 2)], self.touches + answers)

    def learn(self, observation, thing):
        self.sum[thing] += observation.ravel()
        self.count[thing] += 1


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("targets", nargs="?", help="HOST:PORT of a touchstone-server")
    parser.add_argument("--episodes", type=int, default=2000)
    parser.add_argument("--environments", type=int, default=64)
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    environments = gymnasium.make_vec("touchstone/Recognise-v0", num_envs=options.environments, targets=options.targets, model=MODEL)
    touches, _ = environments.single_observation_space.shape or (0, 0)
    objects = list(environments.unwrapped.objects)
    agent = Agent(touches, len(objects), np.random.default_rng(options.seed))
    observations, info = environments.reset(seed=options.seed)
    ended = np.zeros(options.environments, bool)
    rights = []
    while len(rights) < options.episodes:
        actions = agent.act(observations, np.where(ended, 0, info["touches"]))
        observations, _, terminated, truncated, info = environments.step(actions)
        for k in np.flatnonzero(terminated):
            rights.append(bool(info["right"][k]))
            agent.learn(observations[k], objects.index(info["object"][k]))
        ended = terminated | truncated
    environments.close()
    tenth = max(len(rights) // 10, 1)
    print(f"{np.mean(rights[:tenth]):.0%} of the first {tenth} answers were right, {np.mean(rights[-tenth:]):.0%} of the last; "
          f"{1 / len(objects):.0%} by chance")


if __name__ == "__main__":
    main()
