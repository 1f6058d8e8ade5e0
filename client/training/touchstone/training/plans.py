"""Which touches are made, chosen once for all experiments, and the models by which they are simulated."""

from __future__ import annotations

from typing import Any

import touchstone

from .settings import SUPERSHAPES, Settings

OBJECTS = SUPERSHAPES
# The seed's noise: a standard deviation of 0.04779 s of each finger's time.
SIGMA_US = 47790.0
IDEAL = "touchstone: model/1\nname: ideal\nend_effector: {fingers: 3, spacing_mm: 30}\neffects: []\n"
NOISY = ("touchstone: model/1\nname: noisy\nend_effector: {fingers: 3, spacing_mm: 30}\n"
         f"effects:\n  - gaussian_noise: {{sigma_us: {SIGMA_US:.0f}}}\n")
# The shipped shapes all lie within 75 mm of their origin.
BOX_MM = 75.0


def simulated(samples: int, objects: int = len(OBJECTS)) -> Any:
    """What is simulated: random approaches to the six faces alike, as a rig makes them, but never the same twice; so many of
    all objects together. A plan of faces goes face by face, so that its size is that of the samples."""
    return touchstone.faces(samples_per_face=-(-samples // (6 * objects)), rounds=1)


def blind(per_face: int, seed: int, **how: Any) -> touchstone.Touches:
    """Touches along the same lines whatever lies there: of a robot that knows where an object lies, and not which.
    `how`: of touchstone.box_touches()."""
    return touchstone.box_touches((-BOX_MM,) * 3, (BOX_MM,) * 3, per_face, seed=seed, **how)


# The emulated rig in the rig's place: the seed's noise, and physics that no simulation here is told of.
RIG = ("--sigma-us", f"{SIGMA_US:.0f}", "--hide", "tip_radius.radius_mm=2", "--hide", "object_push.shift_mm=0.4",
       "--camera-width", "224", "--camera-height", "224", "--hide", "radial_distortion.k1=-0.1", "--hide", "gamma.exponent=0.85",
       "--hide", "image_noise.sigma_grey=3")


def measured(settings: Settings) -> Any:
    """What the rig measures: the six faces of each object, 192 touches an object in a whole run. The seed measures in rounds;
    here each pose is touched once, so that as many poses as can be are trained on and tested."""
    return touchstone.faces(samples_per_face=settings.pick(8, 32), rounds=1)


def measured_in_rounds(settings: Settings) -> Any:
    """As many touches by the seed's protocol, rounds x samples a face x 6 faces: every pose in each round."""
    return touchstone.faces(samples_per_face=settings.pick(4, 8), rounds=settings.pick(2, 4))
