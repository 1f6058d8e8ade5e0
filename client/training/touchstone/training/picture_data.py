"""Photographs of objects from both sources, chosen once for all experiments of images; what is done to them; their features.

The camera sees the whole object, and stands where it stands whatever the object: how large an object looks tells how large it
is, and nothing else. Simulated pictures are taken from all directions, as the seed's were, `RADIUS_MM` from the middle; the rig's
along random approaches to the six faces of the box in which all objects lie, `DISTANCE_MM` from it. The arm may not stand farther
than `STANDOFF_MM` from a target, so the target lies in front of the object; nothing is touched.
"""

from __future__ import annotations

import dataclasses
import hashlib
import pathlib
import time
from collections.abc import Sequence

import cv2
import numpy as np

import touchstone
from touchstone.whole_file import whole_file

from . import plans
from .backbone import Backbone
from .context import Context
from .features import FeatureSets
from .separation import command_numbers, pose_seed
from .settings import SUPERSHAPES

STANDOFF_MM, DISTANCE_MM, RADIUS_MM = 150.0, 250.0, 310.0
SIDE_PX = 224
# The seed's steps of a degree would have a view come again now and then, in training and in a test.
VIRTUAL = touchstone.sphere(step_angle_deg=0.1, roll_step_deg=0.1, radius_ratio=2.4)


@dataclasses.dataclass
class Pictures:
    """Attributes:
      image: (N, height, width, 1) uint8.
      object: (N,) index into the objects.
      kind: where they are from, for made_on.
      poses: (N,) a number for the commanded pose of the camera; copies of a picture have its number.
    """

    image: np.ndarray
    object: np.ndarray
    kind: str
    poses: np.ndarray

    def __len__(self) -> int:
        return len(self.object)

    def __getitem__(self, rows) -> Pictures:
        return Pictures(self.image[rows], self.object[rows], self.kind, self.poses[rows])


def rig_poses(per_face: int, seed: int) -> touchstone.Touches:
    """Random approaches to the six faces in turn, none of them twice, from which the camera sees the whole object."""
    touches = plans.blind(per_face, seed, spread=0.1, standoff_mm=STANDOFF_MM)
    in_turn = touches[np.arange(6 * per_face).reshape(6, per_face).T.ravel()]
    return dataclasses.replace(in_turn, target_mm=in_turn.target_mm - (DISTANCE_MM - STANDOFF_MM) * in_turn.approach)


def virtual_poses(client: touchstone.Client, name: str, count: int, seed: int) -> touchstone.Touches:
    """Random directions towards the middle of the object, all from RADIUS_MM."""
    found = client.plan(VIRTUAL, name, count, seed=seed)
    return dataclasses.replace(found, standoff_mm=np.full(count, RADIUS_MM))


def _pose_numbers(name: str, views: touchstone.Touches) -> np.ndarray:
    return command_numbers((name,), np.zeros(len(views), int), views.target_mm, views.approach, views.lateral)


def photographed(client: touchstone.Client, objects: Sequence[str], per_object: int, seed: int, *, model: str = plans.IDEAL,
                 normalize: bool = True) -> Pictures:
    """By a simulator, of all objects, from random directions; `seed`: of separation.pose_seed()."""
    image = touchstone.image(SIDE_PX, SIDE_PX, normalize=normalize)
    views = {name: virtual_poses(client, name, per_object, seed) for name in objects}
    found = [client.capture(name, each, image=image, model=model)["image"] for name, each in views.items()]
    return Pictures(np.concatenate(found), np.repeat(np.arange(len(objects)), per_object), "virtual",
                    np.concatenate([_pose_numbers(*each) for each in views.items()]))


def virtual(context: Context, per_object: int, seed: int, *, use: str = "training", normalize: bool = True) -> Pictures:
    """Simulated ones of the supershapes without noise; other poses for every seed and use. `normalize`: dark objects on white,
    as the seed prepared its pictures."""
    return photographed(context.simulator, SUPERSHAPES, per_object, pose_seed(use, "pictures", seed), normalize=normalize)


def measured(context: Context, per_object: int, normalize: bool = True) -> Pictures:
    """By the rig's camera. Kept in the folder of the run: an arm takes its time."""
    found = context.kept([per_object, normalize, list(plans.RIG), "pictures", DISTANCE_MM, SIDE_PX],
                         lambda: _photograph(context, per_object, normalize))
    return Pictures(found["image"], np.repeat(np.arange(len(SUPERSHAPES)), per_object), context.settings.measured_kind, found["poses"])


def _photograph(context, per_object, normalize):
    """The first `per_object` poses of each object that the arm reaches, one at a time."""
    client, images, poses = context.rig(*plans.RIG), [], []
    total = per_object * len(SUPERSHAPES)
    image = touchstone.image(SIDE_PX, SIDE_PX, normalize=normalize)
    for name in SUPERSHAPES:
        views, taken = rig_poses(per_object // 3 + 2, pose_seed("rig", "pictures", name)), 0
        numbers = _pose_numbers(name, views)
        for view in range(len(views)):
            if taken == per_object:
                break
            if len(images) % 25 == 0:
                context.progress(0, f"photographed {len(images)} of {total} times with the rig")
            try:
                images.append(client.capture(name, views[view], image=image)["image"])
                poses.append(numbers[view])
                taken += 1
            except touchstone.InvalidRequest:
                continue  # out of reach; the next pose is another one
        if taken < per_object:
            raise touchstone.SourceFailed(f"the arm reaches {taken} of {len(views)} poses of {name}; {per_object} are needed")
    context.stop_rigs()
    return {"image": np.concatenate(images), "poses": np.array(poses)}


def split(pictures: Pictures, test: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Rows for training and `test` rows for testing, of every object as many; no row is in both."""
    rng, classes = np.random.default_rng([seed, 75]), len(SUPERSHAPES)
    chosen = [rng.permutation(np.flatnonzero(pictures.object == k))[: test // classes + (k < test % classes)]
              for k in range(classes)]
    testing = np.sort(np.concatenate(chosen))
    return np.setdiff1d(np.arange(len(pictures)), testing), testing


def scaled(pictures: Pictures, copies: int, rng: np.random.Generator, reach: tuple[float, float] = (0.75, 1.3)) -> Pictures:
    """`copies` of every picture, each larger or smaller about its centre by a random factor; what comes in at the edge
    is like the edge."""
    found = []
    for picture in pictures.image:
        height, width = picture.shape[:2]
        low, high = np.log(reach)
        for factor in np.exp(rng.uniform(low, high, copies)):
            matrix = cv2.getRotationMatrix2D((width / 2 - 0.5, height / 2 - 0.5), 0, factor)
            found.append(cv2.warpAffine(picture, matrix, (width, height), flags=cv2.INTER_LINEAR,
                                        borderMode=cv2.BORDER_REPLICATE)[:, :, None])
    return Pictures(np.array(found), np.repeat(pictures.object, copies), pictures.kind, np.repeat(pictures.poses, copies))


def binarised(pictures: Pictures) -> Pictures:
    """White where a picture is brighter than its own threshold (Otsu's), black elsewhere."""
    image = [cv2.threshold(p, 0, 255, cv2.THRESH_BINARY | cv2.THRESH_OTSU)[1] for p in pictures.image]
    return dataclasses.replace(pictures, image=np.array(image).reshape(pictures.image.shape))


def inverted(pictures: Pictures) -> Pictures:
    return dataclasses.replace(pictures, image=255 - pictures.image)


class FeatureCache:
    """Features of pictures, each set computed once and kept in the folder of the run, named by what it was computed from.

    Attributes:
      pictures, seconds: what was computed, and how long it took; 0 if all was there.
    """

    def __init__(self, context: Context):
        if context.settings.backbone is None:
            raise ValueError("an experiment on pictures needs Settings.backbone")
        self.backbone = Backbone(context.settings.backbone)
        self._folder: pathlib.Path = context.settings.out / "features"
        self.pictures, self.seconds = 0, 0.0

    def __call__(self, pictures: Pictures) -> FeatureSets:
        """Their features, objects and poses."""
        return FeatureSets(self._features(pictures), pictures.object, pictures.poses)

    def _features(self, pictures: Pictures) -> np.ndarray:
        """(N, F) float32."""
        image = np.ascontiguousarray(pictures.image)
        name = hashlib.sha256(self.backbone.digest.encode() + repr(image.shape).encode() + image.tobytes()).hexdigest()[:24]
        path = self._folder / f"{name}.npy"
        if not path.exists():
            begin = time.monotonic()
            found = self.backbone.features(image)
            self.pictures, self.seconds = self.pictures + len(image), self.seconds + time.monotonic() - begin
            self._folder.mkdir(parents=True, exist_ok=True)
            with whole_file(path, "wb") as file:
                np.save(file, found)
        return np.load(path)

    def rate(self) -> str:
        """How fast, in words."""
        if not self.pictures:
            return "Features were there from an earlier run."
        return f"Features of {self.pictures:,} pictures took {self.seconds:.0f} s, {self.pictures / self.seconds:.1f} pictures a second."
