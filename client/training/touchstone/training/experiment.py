"""The list of experiments."""

from __future__ import annotations

import dataclasses
import importlib
from typing import Callable

from .context import Context
from .result import Result

# In the order of the report. A module of experiments/ each, with EXPERIMENT in it.
_MODULES = ("curvature_histograms", "touches_per_set", "noise_in_training", "virtual_real_ratio", "everyday_models",
            "sensitivity", "image_recognition", "image_augmentation", "image_preprocessing", "fusion", "real_size",
            "better_model", "touches_to_be_sure", "calibrated_answers", "other_rigs")


@dataclasses.dataclass(frozen=True)
class Experiment:
    """Attributes:
      name: of its module, and on the command line.
      title: for people.
      seed_shows: what the seed did and found, with the number of its figure or table; "": it goes beyond the seed.
      run: does it; a Result whose name, title and seconds are filled in by whoever calls it.
      expected_s: how long (quick, whole) took on two cores, to tell the time left.
      needs_backbone: it is left out, and the report says so, without Settings.backbone.
    """

    name: str
    title: str
    seed_shows: str
    run: Callable[[Context], Result]
    expected_s: tuple[float, float]
    needs_backbone: bool = False


def experiments() -> list[Experiment]:
    """All of them."""
    return [importlib.import_module(f"{__package__}.experiments.{name}").EXPERIMENT for name in _MODULES]
