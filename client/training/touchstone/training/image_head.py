"""The seed's head on a frozen image network: dense 128, dense classes, Adam 0.001, 4 epochs, 20 % for validation."""

from __future__ import annotations

import dataclasses

import numpy as np
import torch
from torch import nn

from .features import FeatureSets
from .separation import check

UNITS = 128
LEARNING_RATE = 0.001
EPOCHS = 4
VALIDATION = 0.2
# Left open by the seed: pictures a step.
BATCH = 32


@dataclasses.dataclass
class Head:
    """A trained one.

    Attributes:
      classes: how many.
      validation: (V,) rows of its training set that it was not trained on; of every object the same share.
      trained_poses: of the pictures that it was trained on.
    """

    network: nn.Module
    mean: np.ndarray
    deviation: float
    classes: int
    validation: np.ndarray
    trained_poses: np.ndarray

    def probabilities(self, pictures: FeatureSets) -> np.ndarray:
        """(N, classes); each row adds up to 1. separation.Leak if one of them was trained on."""
        check(self.trained_poses, pictures.poses)
        with torch.no_grad():
            return torch.softmax(self.network(_tensor(pictures.values, self.mean, self.deviation)), 1).double().numpy()

    def accuracy(self, pictures: FeatureSets) -> float:
        return float(np.mean(self.probabilities(pictures).argmax(1) == pictures.objects))


def train(pictures: FeatureSets, classes: int, seed: int, epochs: int = EPOCHS) -> Head:
    """Pictures of one pose, as copies of one picture are, stay together on one side of the split. From the features
    goes their mean over those trained on, and one number scales them all: a pixel of a map that is black in all of these would have
    no deviation of its own."""
    rng = np.random.default_rng(seed)
    features, objects, groups = pictures.values, pictures.objects, pictures.poses
    held = np.isin(groups, _validation_groups(groups, objects, classes, rng))
    rows = np.flatnonzero(~held)
    mean, deviation = features[rows].mean(0), float(features[rows].std()) + 1e-6
    generator = torch.Generator().manual_seed(seed)
    network = nn.Sequential(nn.Linear(features.shape[1], UNITS), nn.ReLU(), nn.Linear(UNITS, classes))
    with torch.no_grad():  # PyTorch's own initial values, but drawn from this seed
        for layer in (network[0], network[2]):
            reach = layer.in_features**-0.5
            for values in (layer.weight, layer.bias):
                values.copy_(torch.rand(values.shape, generator=generator) * 2 * reach - reach)
    inputs, targets = _tensor(features[rows], mean, deviation), torch.as_tensor(objects[rows]).long()
    optimizer = torch.optim.Adam(network.parameters(), LEARNING_RATE)
    for _ in range(epochs):
        for batch in torch.randperm(len(rows), generator=generator).split(BATCH):
            optimizer.zero_grad()
            nn.functional.cross_entropy(network(inputs[batch]), targets[batch]).backward()
            optimizer.step()
    return Head(network.eval(), mean, deviation, classes, np.flatnonzero(held), np.unique(groups[rows]))


def _validation_groups(groups, objects, classes, rng):
    found = []
    for k in range(classes):
        mine = rng.permutation(np.unique(groups[objects == k]))
        found.append(mine[: round(VALIDATION * len(mine))])
    return np.concatenate(found)


def _tensor(features, mean, deviation):
    # In place where it can be: a whole run's maps take 200 MB.
    scaled = features - mean
    scaled /= deviation
    return torch.as_tensor(scaled).float()
