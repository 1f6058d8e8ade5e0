#!/usr/bin/env python3
"""Trains three small networks to tell objects apart on touches and images streamed from a touchstone-server.

    train_small.py --server 127.0.0.1:50051 --extra-object spot --out build/demo

One example is a few random touches of one object, of which only the finger times are known, and the photograph
along the first of them. One network gets the touches, one the photograph, one both; each is trained several times, from
other first weights. Every training example is new; the test set is drawn from another seed. Writes samples.png and
training.png into the output folder.
"""

from __future__ import annotations

import argparse
import pathlib
import sys
import time

import torch
from torch import nn

import touchstone
from touchstone.torch import TouchstoneDataset

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))
import pictures

SUPERSHAPES = ["lat00", "lat05", "lat10", "lat15", "lat20"]
TOUCHES = 8  # an example
IMAGE_PX = 64
TRAINING_SEED, TEST_SEED = 1, 2
# From so far away that the camera sees the whole object; the hand is turned at random about the approach.
PLAN = touchstone.sphere(step_angle_deg=1, roll_step_deg=1, radius_ratio=2.4)


class TouchEncoder(nn.Module):
    """(N, touches, fingers) -> (N, 64), the same whatever the order of the touches."""

    def __init__(self, fingers):
        super().__init__()
        self.each = nn.Sequential(nn.Linear(fingers, 64), nn.ReLU(), nn.Linear(64, 128), nn.ReLU())
        self.all = nn.Sequential(nn.Linear(256, 64), nn.ReLU())

    def forward(self, touches):
        each = self.each(touches)
        return self.all(torch.cat([each.mean(1), each.amax(1)], 1))


class ImageEncoder(nn.Module):
    """(N, 1, 64, 64) -> (N, 64)."""

    def __init__(self):
        super().__init__()

        def layer(before, after, size, stride):
            return [nn.Conv2d(before, after, size, stride, size // 2, bias=False), nn.BatchNorm2d(after), nn.ReLU()]

        self.layers = nn.Sequential(
            *layer(1, 16, 5, 2), *layer(16, 32, 3, 2), *layer(32, 64, 3, 2), nn.AvgPool2d(2), nn.Flatten(),
            nn.Linear(64 * 16, 64), nn.ReLU(),
        )

    def forward(self, image):
        return self.layers(image)


class Classifier(nn.Module):
    """Recognises an object from the senses that it is given; what several senses say is added up."""

    def __init__(self, classes, fingers, touch, image):
        super().__init__()
        self.touch = nn.Sequential(TouchEncoder(fingers), nn.Linear(64, classes)) if touch else None
        self.image = nn.Sequential(ImageEncoder(), nn.Linear(64, classes)) if image else None

    def each(self, touches, image):
        """Logits (N, classes) of each sense."""
        senses = [(self.touch, touches), (self.image, image)]
        return [network(values) for network, values in senses if network is not None]

    def forward(self, touches, image):
        return sum(self.each(touches, image))

    def loss(self, touches, image, objects):
        """Cross entropy; each sense also learns on its own, or the quicker one would keep the other from learning."""
        each = self.each(touches, image)
        judged = [sum(each), *each] if len(each) > 1 else each
        return sum(nn.functional.cross_entropy(logits, objects) for logits in judged)


class Examples:
    """Batches of (touches, image, object) for one seed.

    Of `TOUCHES` successive batches of samples, each shows the same objects in the same order: sample b of each
    belongs to example b. The camera is needed along the first of them only, so the image stream takes one batch
    of every `TOUCHES`, like one rank of as many; a sample's image and touch share their pose by their index.
    """

    def __init__(self, server, objects, seed, examples, batch, workers):
        samples = examples * TOUCHES
        common = dict(target=server, objects=objects, plan=PLAN, samples=samples, seed=seed,
                      new_samples_each_epoch=True)
        touches = TouchstoneDataset(**common, batch_size=batch * TOUCHES, rank=0, ranks=1)
        images = TouchstoneDataset(**common, batch_size=batch, rank=0, ranks=TOUCHES, columns=["image"],
                                   image=touchstone.image(IMAGE_PX, IMAGE_PX))
        options = dict(num_workers=workers, persistent_workers=True) if workers else {}
        self._touches, self._images = touches.loader(**options), images.loader(**options)
        self.examples, self.batch = examples, batch

    def __iter__(self):
        for touched, seen in zip(self._touches, self._images):
            descriptors = touched["descriptor_us"].reshape(TOUCHES, -1, touched["descriptor_us"].shape[1])
            # Milliseconds, a tenth of a second as the unit: most differences between fingers are of that size.
            touches = torch.nan_to_num(descriptors.permute(1, 0, 2) / 1e5)
            image = seen["image"].to(torch.float32, memory_format=torch.contiguous_format) / 255 - 0.3
            yield touches, image, touched["object"][: self.batch].long()


def evaluate(networks, batches, classes):
    """For each kind of network the confusion matrix (true object, recognised object) of each of its trainings."""
    def confusion(network):
        network.eval()
        counts = torch.zeros(classes, classes, dtype=torch.int64)
        for touches, image, objects in batches:
            found = network(touches, image).argmax(1)
            counts += torch.bincount(objects * classes + found, minlength=classes**2).view(classes, classes)
        network.train()
        return counts

    with torch.no_grad():
        return {name: [confusion(network) for network in trainings] for name, trainings in networks.items()}


def accuracy(confusion):
    return float(confusion.diagonal().sum() / confusion.sum())


def train(networks, examples, test, epochs, classes):
    """Returns ([(examples seen, {network: [accuracy of each training]})], last confusion matrices, all trainings together)."""
    every = [network for trainings in networks.values() for network in trainings]
    optimizers = [torch.optim.Adam(network.parameters(), 2e-3) for network in every]
    steps = epochs * (examples.examples // examples.batch)
    schedules = [torch.optim.lr_scheduler.CosineAnnealingLR(o, steps) for o in optimizers]
    history, seen = [(0, {name: [1 / classes] * len(trainings) for name, trainings in networks.items()})], 0
    print(f"  {'examples':>8} {'touches':>9} {'images':>7}   " + "   ".join(f"{name:>22}" for name in networks))
    for _ in range(epochs):
        for touches, image, objects in examples:
            for network, optimizer in zip(every, optimizers):
                optimizer.zero_grad(set_to_none=True)
                network.loss(touches, image, objects).backward()
                optimizer.step()
            for schedule in schedules:
                schedule.step()
            seen += len(objects)
        confusion = evaluate(networks, test, classes)
        history.append((seen, {name: [accuracy(matrix) for matrix in each] for name, each in confusion.items()}))
        print(f"  {seen:8,} {seen * TOUCHES:9,} {seen:7,}   "
              + "   ".join(f"{pictures.mean_and_range(each):>22}" for each in history[-1][1].values()), flush=True)
    return history, {name: sum(each) for name, each in confusion.items()}


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--server", default="127.0.0.1:50051", help="HOST:PORT of a touchstone-server")
    parser.add_argument("--extra-object", help="one more object of that server, besides the five supershapes")
    parser.add_argument("--out", type=pathlib.Path, default=pathlib.Path("."), help="folder for the pictures")
    parser.add_argument("--trainings", type=int, default=3, help="of each network, from other first weights (3)")
    parser.add_argument("--quick", action="store_true", help="a quarter of the training")
    arguments = parser.parse_args()

    begin = time.monotonic()
    client = touchstone.connect(arguments.server)
    source, known = client.describe(), {o.name for o in client.objects()}
    objects = SUPERSHAPES + ([arguments.extra_object] if arguments.extra_object else [])
    missing = [name for name in objects if name not in known]
    if missing:
        sys.exit(f"train_small: {arguments.server} has no object {missing[0]}; it has {', '.join(sorted(known))}.")
    fingers = client.dataset(objects, PLAN, samples=1).header.fingers
    print(f"{arguments.server}: touchstone {source.version}, model {source.default_model} "
          f"({source.default_model_hash[:8]}), {fingers} fingers, images by {source.renderer}.")

    # What the networks get to see, first for people.
    arguments.out.mkdir(parents=True, exist_ok=True)
    sheet = pictures.contact_sheet(client, objects, PLAN, TRAINING_SEED, arguments.out / "samples.png")

    # An example has an object; a batch has as many of each.
    classes, epochs = len(objects), 3 if arguments.quick else 12
    batch = 16 * classes
    training = Examples(arguments.server, objects, TRAINING_SEED, 16 * batch, batch, workers=1)
    test = list(Examples(arguments.server, objects, TEST_SEED, 16 * batch, batch, workers=0))
    senses = {"touch only": (True, False), "image only": (False, True), "both": (True, True)}
    networks = {name: [] for name in senses}
    for first_weights in range(arguments.trainings):
        torch.manual_seed(first_weights)
        for name, (touch, image) in senses.items():
            networks[name].append(Classifier(classes, fingers, touch, image))
    print(f"Which of {classes} objects is it? {TOUCHES} touches each, a {IMAGE_PX} x {IMAGE_PX} grey photograph, or "
          f"both. Chance: {1 / classes:.1%}.\nAccuracy on {16 * batch:,} held-out examples (seed {TEST_SEED}), after "
          f"training on new ones (seed {TRAINING_SEED}); mean and range of {arguments.trainings} trainings each:")
    training_begin = time.monotonic()
    history, confusion = train(networks, training, test, epochs, classes)
    training_s = time.monotonic() - training_begin

    curves = pictures.training_picture(history, confusion, objects, arguments.out / "training.png")
    seen = history[-1][0]
    print(f"{seen * TOUCHES:,} touches and {seen:,} images streamed and learned from in {training_s:.1f} s: "
          f"{seen * TOUCHES / training_s:,.0f} touches/s and {seen / training_s:,.0f} images/s into {3 * arguments.trainings} networks "
          f"at once; {time.monotonic() - begin:.1f} s in all.")
    print(f"Pictures: {sheet}\n          {curves}")


if __name__ == "__main__":
    try:
        main()
    except touchstone.TouchstoneError as error:
        sys.exit(f"train_small: {error}")
