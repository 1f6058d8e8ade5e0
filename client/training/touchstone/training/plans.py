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
# What is simulated: random approaches to the six faces, as a rig makes them, but never the same twice.
SIMULATED = touchstone.faces(samples_per_face=1_000_000, rounds=1)


# The emulated rig in the rig's place: the seed's noise, and physics that no simulation here is told of.
RIG = ("--sigma-us", f"{SIGMA_US:.0f}", "--hide", "tip_radius.radius_mm=2", "--hide", "object_push.shift_mm=0.4",
       "--camera-width", "224", "--camera-height", "224", "--hide", "radial_distortion.k1=-0.1", "--hide", "gamma.exponent=0.85",
       "--hide", "image_noise.sigma_grey=3")


def measured(settings: Settings) -> Any:
    """The seed's protocol on the rig: rounds x samples a face x 6 faces; 192 touches an object in a whole run."""
    return touchstone.faces(samples_per_face=settings.pick(4, 8), rounds=settings.pick(2, 4))
