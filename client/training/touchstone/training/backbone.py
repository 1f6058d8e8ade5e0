"""A frozen image network from an ONNX file, run by OpenCV: pictures in, features out.

What is taken as features: the last maps of the network, flattened, as the seed does: the activations before pooling and
classification (ResNet-50: 2048 maps of 7 x 7, 100,352 numbers). Maps of more pixels are reduced to 7 x 7 by averaging
(SqueezeNet 1.0: 512 maps of 13 x 13, so 25,088 numbers). Where the classifier is a convolution before the last pooling, as
SqueezeNet's, its scores are no maps of features: the maps are those that go into it. A network without maps gives its output.

How pictures are prepared. The size is the file's own input size, 224 where that is open. An ONNX file does not say how
its pixels are to be scaled. FILE.onnx.json beside it may: {"mean": [r, g, b], "deviation": [r, g, b], "order": "rgb"},
mean and deviation in grey levels 0 to 255 in that order. Without one, 227 pixels mean Caffe's convention (blue first,
less a mean, not scaled), everything else torchvision's (red first, less a mean, over a standard deviation).
"""

from __future__ import annotations

import concurrent.futures
import dataclasses
import hashlib
import json
import os
import pathlib
import queue

import cv2
import numpy as np
import torch
from torch import nn

from . import onnx_file

MAP_SIDE = 7  # of ResNet-50's last maps, pixels


class NoNetwork(ValueError):
    """The file cannot serve as a backbone; its text says which file, why, and what would serve."""


@dataclasses.dataclass(frozen=True)
class Preparation:
    """(pixel - mean) / deviation for each channel in `order`, "rgb" or "bgr"; pixels 0 to 255."""

    mean: tuple[float, ...]
    deviation: tuple[float, ...]
    order: str


CAFFE = Preparation((104.0, 117.0, 123.0), (1.0, 1.0, 1.0), "bgr")
TORCHVISION = Preparation((123.675, 116.28, 103.53), (58.395, 57.12, 57.375), "rgb")


class Backbone:
    """Attributes:
      side_px: of the square pictures that the network is given.
      preparation: how pixels are scaled.
      layer: whose maps the features are; "": the network's own output.
      maps: how many of them; 0: it has none.
      digest: of the file and of the preparation.
    """

    def __init__(self, path: pathlib.Path, workers: int = 0):
        """`workers`: pictures at a time; 0: one a core, 4 at most. NoNetwork if the file is no image network."""
        self.path = path
        try:
            shape = onnx_file.input_shape(path)
        except (OSError, ValueError) as error:
            raise NoNetwork(_refusal(path, str(error))) from error
        if len(shape) != 4 or shape[1] not in (0, 3) or shape[2] != shape[3]:
            raise NoNetwork(_refusal(path, f"its input is {_shape(shape)}, not 1 x 3 x side x side"))
        self.side_px = shape[2] or 224
        self.preparation = _preparation(path, self.side_px)
        self._nets: queue.Queue[cv2.dnn.Net] = queue.Queue()
        self._workers = workers or min(4, os.cpu_count() or 1)
        try:
            for _ in range(self._workers):
                self._nets.put(cv2.dnn.readNetFromONNX(str(path)))
            self.layer, self.maps = self._find_maps()
            self.features_count = self._one(np.zeros((8, 8, 1), np.uint8)).size
        except cv2.error as error:
            raise NoNetwork(_refusal(path, f"OpenCV {cv2.__version__} cannot run it: {error.err}")) from error
        self.digest = hashlib.sha256(path.read_bytes() + repr((self.preparation, self.layer, MAP_SIDE)).encode()).hexdigest()

    def __str__(self) -> str:
        what = f"{self.maps} maps, flattened" if self.layer else "raw output"
        convention = {CAFFE: "Caffe's", TORCHVISION: "torchvision's"}.get(self.preparation, "its own")
        return f"{self.path.name} ({what}, {self.features_count:,} numbers; {self.side_px} x {self.side_px} pixels, {convention} scaling)"

    def _find_maps(self) -> tuple[str, int]:
        """The layer with the last maps of features, and how many; "" and 0 where there are none."""
        net = self._nets.queue[0]
        net.setInput(prepare(np.zeros((8, 8, 1), np.uint8), self.side_px, self.preparation))
        names = list(net.getLayerNames())
        kinds = [net.getLayer(net.getLayerId(name)).type for name in names]
        output = net.forward().size
        classifies = not {"InnerProduct", "MatMul", "Gemm"} & set(kinds)  # perhaps by a convolution
        skip = False
        for place in reversed(range(len(names))):
            shape = net.forward(names[place]).shape
            if len(shape) != 4 or max(shape[2:]) == 1:
                continue
            # The scores of a classifier: a convolution, or what is made of its output number by number.
            skip = classifies and shape[1] == output and kinds[place] in ("Convolution", "ReLU", "ReLU6", "Dropout", "Identity")
            classifies = classifies and skip and kinds[place] != "Convolution"
            if not skip:
                return names[place], shape[1]
        return "", 0

    def features(self, pictures: np.ndarray) -> np.ndarray:
        """(N, features_count) float32 of (N, height, width, 1 or 3) uint8, grey or red first; the same for the same picture."""
        cv2.setNumThreads(1)  # the cores work on different pictures
        with concurrent.futures.ThreadPoolExecutor(self._workers) as pool:
            found = list(pool.map(self._one, pictures))
        return np.array(found, np.float32).reshape(len(pictures), self.features_count)

    def _one(self, picture: np.ndarray) -> np.ndarray:
        net = self._nets.get()
        try:
            net.setInput(prepare(picture, self.side_px, self.preparation))
            found = net.forward(self.layer) if self.layer else net.forward()
            if found.ndim == 4 and max(found.shape[2:]) > MAP_SIDE:
                found = nn.functional.adaptive_avg_pool2d(torch.from_numpy(found), MAP_SIDE).numpy()
            return found.ravel().copy()
        finally:
            self._nets.put(net)


def prepare(picture: np.ndarray, side_px: int, preparation: Preparation) -> np.ndarray:
    """(1, 3, side_px, side_px) float32 of (height, width, 1 or 3) uint8, grey or red first."""
    resized = cv2.resize(np.broadcast_to(picture, (*picture.shape[:2], 3)).astype(np.float32), (side_px, side_px),
                         interpolation=cv2.INTER_AREA if picture.shape[0] > side_px else cv2.INTER_LINEAR)
    ordered = resized if preparation.order == "rgb" else resized[:, :, ::-1]
    scaled = (ordered - np.array(preparation.mean, np.float32)) / np.array(preparation.deviation, np.float32)
    return np.ascontiguousarray(scaled.transpose(2, 0, 1)[None], np.float32)


def _preparation(path: pathlib.Path, side_px: int) -> Preparation:
    said = path.with_name(path.name + ".json")
    if not said.exists():
        return CAFFE if side_px == 227 else TORCHVISION
    try:
        found = json.loads(said.read_text())
        result = Preparation(tuple(map(float, found["mean"])), tuple(map(float, found["deviation"])), found["order"])
        if len(result.mean) != 3 or len(result.deviation) != 3 or result.order not in ("rgb", "bgr") or 0 in result.deviation:
            raise ValueError("three means, three deviations other than 0, and rgb or bgr are needed")
        return result
    except (ValueError, KeyError, TypeError) as error:
        raise NoNetwork(f'{said}: {error}; wanted: {{"mean": [r, g, b], "deviation": [r, g, b], "order": "rgb"}}') from error


def _refusal(path: pathlib.Path, why: str) -> str:
    return f"--backbone {path}: {why}. An image network is needed, for instance ResNet-50 as ONNX (1 x 3 x 224 x 224 in)."


def _shape(shape) -> str:
    return " x ".join(str(side or "?") for side in shape) or "without a shape"
