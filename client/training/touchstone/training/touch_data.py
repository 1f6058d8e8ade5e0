"""Touches of several objects as arrays, from whichever source: the simulator and the rig are asked in the same words."""

from __future__ import annotations

import dataclasses
import functools
import pathlib
from collections.abc import Sequence
from typing import Any

import numpy as np

import touchstone
from touchstone.whole_file import whole_file

from .separation import command_numbers


def curvature_per_m(times_us: np.ndarray, speed_mm_s: float, spacing_mm: float) -> np.ndarray:
    """(N,) local curvature in 1/m of (N, 3) contact times, positive where the surface is convex:
    speed (t_l - 2 t_m + t_r) / spacing^2."""
    left, middle, right = times_us.T / 1e6
    return speed_mm_s * (left - 2 * middle + right) / spacing_mm**2 * 1e3


@dataclasses.dataclass
class TouchData:
    """Attributes:
      objects: names.
      object: (N,) index into them.
      times_us: (N, fingers) contact times less the first finger's, microseconds; the seed's array.
      target_mm, approach, lateral: (N, 3) of the commanded touch, object frame.
      image: (N, height, width, channels) uint8, or None.
      speed_mm_s, spacing_mm: of the hand.
    """

    objects: tuple[str, ...]
    object: np.ndarray
    times_us: np.ndarray
    target_mm: np.ndarray
    approach: np.ndarray
    lateral: np.ndarray
    image: np.ndarray | None
    speed_mm_s: float
    spacing_mm: float

    def __len__(self) -> int:
        return len(self.object)

    def __getitem__(self, rows: Any) -> TouchData:
        """Those rows: a slice, a mask or an array of indices."""
        picked = {name: getattr(self, name)[rows] for name in _ARRAYS}
        return dataclasses.replace(self, image=None if self.image is None else self.image[rows], **picked)

    def curvature(self) -> np.ndarray:
        """Local curvature in 1/m of each touch."""
        return curvature_per_m(self.times_us, self.speed_mm_s, self.spacing_mm)

    def poses(self) -> np.ndarray:
        """(N,) a number for each commanded pose of each object; rounds of one pose have the same, from every source."""
        return self._poses

    @functools.cached_property
    def _poses(self) -> np.ndarray:
        return command_numbers(self.objects, self.object, self.target_mm, self.approach, self.lateral)

    def save(self, path: pathlib.Path) -> None:
        """Whole or not at all."""
        image = {} if self.image is None else {"image": self.image}
        with whole_file(path, "wb") as file:
            np.savez_compressed(file, objects=np.array(self.objects), hand=[self.speed_mm_s, self.spacing_mm], **image,
                                **{name: getattr(self, name) for name in _ARRAYS})

    @classmethod
    def load(cls, path: pathlib.Path) -> TouchData:
        with np.load(path) as found:
            speed, spacing = map(float, found["hand"])
            return cls(objects=tuple(map(str, found["objects"])), image=found.get("image"), speed_mm_s=speed, spacing_mm=spacing,
                       **{name: found[name] for name in _ARRAYS})


_ARRAYS = ("object", "times_us", "target_mm", "approach", "lateral")


def collect(client: touchstone.Client, objects: Sequence[str], plan: Any, samples: int, *, model: str | None = None,
            seed: int = 1, image: Any = None, spacing_mm: float = 30.0, speed_mm_s: float | None = None) -> TouchData:
    """`samples` samples of a dataset over `objects`, which take turns. Touches of which a finger's time is missing (a rig
    cannot draw again) are left out."""
    columns = ["object", "descriptor_us", "target_mm", "approach", "lateral", "speed_mm_s"]
    dataset = client.dataset(objects, plan, samples=samples, seed=seed, model=model, image=image, speed_mm_s=speed_mm_s,
                             columns=columns + (["image"] if image is not None else []))
    batches = list(dataset)
    joined = {name: np.concatenate([batch[name] for batch in batches]) for name in columns}
    whole = np.isfinite(joined["descriptor_us"]).all(1)
    pixels = np.concatenate([batch["image"] for batch in batches])[whole] if image is not None else None
    target_mm, approach, lateral = (joined[name][whole].astype(float) for name in ("target_mm", "approach", "lateral"))
    return TouchData(tuple(objects), joined["object"][whole].astype(int), joined["descriptor_us"][whole].astype(float),
                     target_mm, approach, lateral, pixels, float(joined["speed_mm_s"][0]), spacing_mm)
