"""Figures 14 and 15 of the seed: measured pictures, and scaled copies of them, beside the simulated ones in training."""

from __future__ import annotations

import numpy as np

from .. import figures, image_head, paired
from ..context import Context
from ..experiment import Experiment
from ..features import FeatureSets, joined
from ..picture_data import FeatureCache, Pictures, measured, scaled, virtual
from ..result import Comparison, Result, Table
from ..settings import SUPERSHAPES
from ..statistics import estimate_share
from .image_recognition import CLASSES, measured_split, sizes

COPIES = 3


class MeasuredFeatures:
    """Features of the measured pool and of COPIES randomly scaled copies of each picture, made once for all seeds.

    Attributes:
      pool: the pictures as they were photographed.
      seen: their features.
      copies: COPIES times the features of a scaled copy of each.
    """

    def __init__(self, context: Context, cache: FeatureCache):
        self.pool: Pictures = measured(context, sizes(context).measured_per_object)
        self.seen = cache(self.pool)
        changed = cache(scaled(self.pool, COPIES, np.random.default_rng(context.settings.seed)))
        self.copies = [changed[np.arange(len(self.pool)) * COPIES + k] for k in range(COPIES)]

    def training(self, rows: np.ndarray, copies: int) -> FeatureSets:
        """These pictures and the first `copies` of each."""
        return joined(self.seen[rows], *(each[rows] for each in self.copies[:copies]))


def train_with(features: FeatureSets, real: MeasuredFeatures, rows: np.ndarray, copies: int, seed: int) -> image_head.Head:
    """A head on virtual and measured pictures; `rows` of the latter."""
    return image_head.train(joined(features, real.training(rows, copies)), CLASSES, seed)


def run(context: Context) -> Result:
    settings, size, cache = context.settings, sizes(context), FeatureCache(context)
    real = MeasuredFeatures(context, cache)
    accuracies = np.zeros((settings.seeds, COPIES + 2))
    confused = np.zeros((2, CLASSES, CLASSES))
    for step, seed in enumerate(settings.runs):
        context.progress(step / settings.seeds, f"seed {seed}")
        features = cache(virtual(context, size.train_per_object, seed))
        training, testing = measured_split(context, real.pool, seed)
        heads = [image_head.train(features, CLASSES, seed),
                 *(train_with(features, real, training, copies, seed) for copies in range(COPIES + 1))]
        accuracies[step] = [head.accuracy(real.seen[testing]) for head in heads]
        for matrix, head in zip(confused, (heads[0], heads[-1])):
            np.add.at(matrix, (real.pool.object[testing], head.probabilities(real.seen[testing]).argmax(1)), 1)
    return _result(context, cache, accuracies, confused)


def _result(context, cache, accuracies, confused):
    size, kind = sizes(context), context.settings.measured_kind
    names = ["virtual alone", f"+ {kind}", *(f"+ {kind} and {k} scaled {'copy' if k == 1 else 'copies'} of each"
                                             for k in range(1, COPIES + 1))]
    all_estimates = [estimate_share(column) for column in accuracies.T]
    made_on = [f"{size.train_per_object * CLASSES:,} virtual pictures, others for every seed",
               (f"{size.measured_train} {kind} pictures in training and {size.measured_test} others in testing, drawn anew for every "
                f"seed from {size.measured_per_object * CLASSES} that were photographed, and scaled (by 0.75 to 1.3), once"),
               f"features of {cache.backbone}, frozen; the head is trained anew for every seed"]
    result = Result("", "", made_on=made_on, words=[
        (f"With {size.measured_train} {kind} pictures and {COPIES} scaled copies of each in training, "
         f"{all_estimates[-1].words()} of the {kind} test pictures are recognised, without them {all_estimates[0].words()}: "
         f"{paired.order('training with them', accuracies[:, -1], 'training without', accuracies[:, 0])}."),
        f"Of the copies alone: {paired.order(f'training with {COPIES} copies', accuracies[:, -1], 'training without copies', accuracies[:, 1])}.",
        cache.rate()])
    result.comparisons = [Comparison(
        f"virtual + {size.measured_train} {kind} pictures, {COPIES} scaled copies of each", all_estimates[-1], 0.806, "; ".join(made_on[:2]),
        f"backbone {cache.backbone.path.name} instead of ResNet-50; {kind} pictures lie closer to ours than the seed's did to its "
        "simulation; the seed does not say by how much it scaled")]
    result.tables = [Table(f"Accuracy on {size.measured_test} {kind} pictures", ["training set", "accuracy (95 % interval)"],
                           [[name, each.words()] for name, each in zip(names, all_estimates)],
                           "No picture, and no copy of one, is in training and testing both.")]
    result.figures = [figures.curves(
        context.figure_path("curve"), f"Accuracy on {kind} pictures with {size.measured_train} others in training, by scaled copies "
        "of each. Bands: 95 % over seeds.", list(range(COPIES + 1)), {"image": all_estimates[1:]},
        x_label=f"scaled copies of each {kind} picture", chance=1 / CLASSES, marks={"virtual alone": all_estimates[0].value}),
        figures.confusion(context.figure_path("confusion"), f"What {kind} pictures are taken for, all seeds together: percent of each true object.",
                          SUPERSHAPES, {"virtual alone": confused[0], f"+ {kind} and {COPIES} copies of each": confused[1]})]
    result.data = {"names": names, "accuracy": accuracies.tolist(), "confusion": confused.tolist()}
    return result


EXPERIMENT = Experiment("image_augmentation", "The rig's photographs in training, and scaled copies of them",
                        "figures 14 and 15: 74 measured images, scaled at random 1, 2, 3 times each (296 with 222 copies), raise 58.3 % to 80.6 %",
                        run, (8, 60), needs_backbone=True)
