"""Figure 5 of the seed: pictures as they are, binarised, inverted, and normalised at the source."""

from __future__ import annotations

import matplotlib.pyplot as plt
import numpy as np

from .. import figures, image_head, paired
from ..context import Context
from ..experiment import Experiment
from ..picture_data import SUPERSHAPES, FeatureCache, Pictures, binarised, inverted, measured, virtual
from ..result import Result, Table
from ..statistics import estimate_share
from .image_recognition import CLASSES, sizes

KINDS = ("as it is", "binarised", "inverted", "normalised")


def variants(plain: Pictures, normalised: Pictures) -> dict[str, Pictures]:
    """The four kinds of the same pictures; the normalised ones are made so by the source, from the same poses."""
    return dict(zip(KINDS, (plain, binarised(plain), inverted(plain), normalised)))


def run(context: Context) -> Result:
    settings, cache = context.settings, FeatureCache(context)
    per_object, test_per_object = settings.pick((8, 5), (30, 15))
    # The first poses of the pool of other experiments are those of the pictures as they are.
    pool, pool_per_object = measured(context, sizes(context).measured_per_object), sizes(context).measured_per_object
    normalised = pool[np.flatnonzero(np.arange(len(pool)) % pool_per_object < test_per_object)]
    test = variants(measured(context, test_per_object, normalize=False), normalised)
    test_features = {name: cache(pictures) for name, pictures in test.items()}
    accuracies, train = {name: [] for name in KINDS}, None
    for step, seed in enumerate(settings.runs):
        context.progress(step / settings.seeds, f"seed {seed}")
        train = variants(virtual(context, per_object, seed, normalize=False), virtual(context, per_object, seed))
        for name, pictures in train.items():
            head = image_head.train(cache(pictures), CLASSES, seed, epochs=settings.pick(12, image_head.EPOCHS))
            accuracies[name].append(head.accuracy(test_features[name]))
    return _result(context, cache, accuracies, train, test, per_object, test_per_object)


def _result(context, cache, accuracies, train, test, per_object, test_per_object):
    kind = context.settings.measured_kind
    best = max(KINDS, key=lambda name: np.mean(accuracies[name]))
    orders = [paired.order(f"'{name}'", accuracies[name], "'as it is'", accuracies["as it is"]) for name in KINDS[1:]]
    empty = {name: int((pictures.image.reshape(len(pictures), -1).min(1) == 255).sum()) for name, pictures in
             (("virtual", train["normalised"]), (kind, test["normalised"]))}
    result = Result("", "", made_on=[
        (f"{per_object * CLASSES} virtual pictures for training, others for every seed, and {test_per_object * CLASSES} {kind} ones for "
         "testing, the same for all seeds; both prepared in the same way"),
        f"features of {cache.backbone}, frozen; the head is trained anew for every seed"], words=[
        f"On {kind} pictures '{best}' is recognised best on average, {estimate_share(accuracies[best]).words()}. Against pictures as they are: "
        + "; ".join(orders) + ".",
        (f"Normalisation found no object in {empty['virtual']} of {len(train['normalised'])} virtual and {empty[kind]} of "
         f"{len(test['normalised'])} {kind} pictures, which then are white.")])
    result.tables = [Table(f"Accuracy on {kind} pictures, trained on virtual ones", ["preparation", "accuracy (95 % interval)"],
                           [[name, estimate_share(accuracies[name]).words()] for name in KINDS])]
    result.figures = [_sheet(context, train, test, per_object, test_per_object)]
    result.data = {"accuracy": accuracies, "white": empty}
    return result


def _sheet(context, train, test, per_object, test_per_object):
    """Two sources below each other for each of two objects, the four kinds side by side."""
    kind = context.settings.measured_kind
    rows = [(f"{SUPERSHAPES[k]}, {source}", pictures, k * count + k % count)
            for k in (0, 4) for source, pictures, count in (("virtual", train, per_object), (kind, test, test_per_object))]
    figure, all_axes = plt.subplots(len(rows), len(KINDS), figsize=(7, 1.75 * len(rows)))
    for axes_row, (label, pictures, row) in zip(all_axes, rows):
        for axes, name in zip(axes_row, KINDS):
            axes.imshow(pictures[name].image[row][:, :, 0], cmap="gray", vmin=0, vmax=255, interpolation="antialiased")
            axes.set(xticks=[], yticks=[])
            axes.grid(False)
            axes.spines[:].set_visible(True)
            if pictures is train and label.startswith(SUPERSHAPES[0]):
                axes.set_title(name)
        axes_row[0].set_ylabel(label)
    return figures.save(figure, context.figure_path("sheet"), "What the network is given. Virtual and "
                        f"{kind} pictures are of different poses.")


EXPERIMENT = Experiment("image_preprocessing", "Preparation of photographs",
                        "figure 5: pictures binarised and inverted, shown without numbers", run, (20, 350), needs_backbone=True)
