"""How strong a hidden effect is.

Signal of one picture: sqrt(sum (with - without)^2) / sigma over its pixels; of effects that move something in the picture
only over those that are two pixels clear of every edge, with and without: of silhouettes, and of places where the nominal
picture jumps (one pixel that flips there is worth fifty standard errors, at a shift that nobody could see). Weak: 10 to 15 in the
root mean square over pictures, which a careful person who lays each picture beside its rendering would just notice.
Realistic: drawn from the ranges below, made stronger where that leaves less than 25.
"""
import cv2
import numpy as np

import sets

WEAK = (10.0, 15.0)
MIN_REALISTIC = 25.0
EDGE_GREY = 12.0  # a jump between neighbouring pixels that is an edge
SAMPLE = 15  # pictures that the signal is measured on, three of each object

EFFECTS = ("focal_error", "radial_distortion", "principal_point", "camera_translation", "camera_rotation", "exposure",
           "gamma", "vignetting", "defocus_blur", "motion_blur", "light_position", "ambient_light", "cast_shadow",
           "specular", "background_level")
# Of cameras that write something else than light. Their arms come last: seeds count arms.
RESPONSES = ("response", "black_level")

# Where nothing changes, for those that differ from zero, and the entries that a strength scales (others keep).
NEUTRAL = {"gamma": 1.0}
SCALED = {"specular": (True, False), "motion_blur": (True, False)}
# Greatest values that make sense.
BOUNDS = {"cast_shadow": 1.0, "vignetting": 0.9, "background_level": 200.0}


def either(random, low, high):
    return random.uniform(low, high) * random.choice([-1, 1])


def drawn(effect, random):
    """In the units of files."""
    r = random
    if effect == "focal_error":
        return either(r, 0.005, 0.03)
    if effect == "radial_distortion":
        k1 = either(r, 0.05, 0.25)
        return (k1, -k1 * r.uniform(0, 0.4))
    if effect == "principal_point":
        return (either(r, 0.7, 4), either(r, 0.7, 4))
    if effect == "camera_translation":
        return tuple(either(r, 0.5, 3) for _ in range(3))
    if effect == "camera_rotation":
        return tuple(either(r, 0.1, 0.6) for _ in range(3))
    if effect == "exposure":
        return either(r, 0.05, 0.3)
    if effect == "gamma":
        return r.choice([r.uniform(0.8, 0.95), r.uniform(1.06, 1.25)])
    if effect == "vignetting":
        return r.uniform(0.08, 0.35)
    if effect == "defocus_blur":
        return r.uniform(0.5, 1.5)
    if effect == "motion_blur":
        return (r.uniform(1.5, 5), r.uniform(-90, 90))
    if effect == "light_position":
        return tuple(either(r, 20, 100) for _ in range(3))
    if effect == "ambient_light":
        return r.uniform(0.02, 0.08)
    if effect == "cast_shadow":
        return r.uniform(0.3, 1)
    if effect == "specular":
        return (r.uniform(0.08, 0.4), r.uniform(8, 60))
    if effect == "background_level":
        return r.uniform(5, 30)
    if effect == "black_level":
        return r.uniform(4, 20)
    if effect == "response":
        return 1.0
    raise ValueError(effect)


def scaled(effect, value, factor):
    neutral = NEUTRAL.get(effect, 0.0)
    flags = SCALED.get(effect)
    if np.ndim(value) == 0:
        result = neutral + (value - neutral) * factor
        return float(min(result, BOUNDS.get(effect, np.inf)))
    return tuple(float(v * factor) if flags is None or flags[k] else float(v) for k, v in enumerate(value))


class Signal:
    """Of effects in one scene."""

    def __init__(self, scene):
        count = len(scene.shots)
        self.numbers = np.unique(np.linspace(0, count - 1, min(SAMPLE, count)).astype(int))
        self.photographer = sets.Photographer(scene)
        self.without = [self._picture(n, {}) for n in self.numbers]

    def _picture(self, number, effects, **others):
        return self.photographer.take(number, sets.make_physics(effects, **others))

    def object_pixels(self):
        """Mean number of pixels that see the object."""
        return float(np.mean([mask.sum() for _, mask in self.without]))

    def of(self, effects, physics_of=None):
        """Root mean square over pictures; by effects, or by physics_of(number). What moves nothing in the picture is
        measured on all pixels."""
        moves = any(name in sets.Photographer.GEOMETRY for name in effects)
        total = 0.0
        square = np.ones((5, 5), np.uint8)
        cross = cv2.getStructuringElement(cv2.MORPH_CROSS, (3, 3))
        for n, (grey, mask) in zip(self.numbers, self.without):
            if physics_of is None:
                other, other_mask = self._picture(n, effects)
            else:
                other, other_mask = self.photographer.take(n, physics_of(n))
            jumps = cv2.dilate(grey, cross) - cv2.erode(grey, cross) > EDGE_GREY
            near = cv2.dilate(jumps.astype(np.uint8), square) > 0
            for m in (mask, other_mask):
                m = m.astype(np.uint8)
                near |= cv2.dilate(m, square) != cv2.erode(m, square)
            near &= moves
            total += float((((other - grey) / sets.NOMINAL_NOISE[0])[~near] ** 2).sum())
        return float(np.sqrt(total / len(self.numbers)))


def realistic(effect, scene, signal=None):
    value = drawn(effect, sets.stream(scene.seed, "effect " + effect))
    signal = signal or Signal(scene)
    for _ in range(12):
        if signal.of({effect: value}) >= MIN_REALISTIC:
            break
        value = scaled(effect, value, 1.5)
    return value


def weak(effect, scene, signal=None):
    """The draw of `realistic`, scaled so that the signal is as drawn from WEAK."""
    random = sets.stream(scene.seed, "effect " + effect)
    value = drawn(effect, random)
    signal = signal or Signal(scene)
    wanted = random.uniform(*WEAK)
    low, high, factor = np.log(1e-4), np.log(30.0), 0.0
    # Regula falsi in logarithms: signals grow as a power of the strength.
    at, got = factor, None
    for _ in range(12):
        now = signal.of({effect: scaled(effect, value, np.exp(factor))})
        if abs(now / wanted - 1) < 0.03:
            break
        if now < wanted:
            low = factor
        else:
            high = factor
        slope = 1.0
        if got is not None and now > 0 and got > 0 and factor != at:
            slope = np.clip(np.log(now / got) / (factor - at), 0.3, 3)
        at, got = factor, now
        step = factor + np.log(wanted / max(now, 1e-9)) / slope
        factor = step if low < step < high else 0.5 * (low + high)
    return scaled(effect, value, float(np.exp(factor)))
