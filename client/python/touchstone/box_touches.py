"""Touches that are drawn without looking at any object."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from . import arguments, checks
from .errors import InvalidRequest
from .plans import Touches, touches


@arguments.checked
def box_touches(min_mm: Sequence[float], max_mm: Sequence[float], samples_per_face: int = 8, *, seed: int = 0,
                max_tilt_deg: float = 20.0, spread: float = 0.6, standoff_mm: float = 60.0, stroke_mm: float | None = None,
                speed_mm_s: float = 20.0) -> Touches:
    """Random lines to the six faces of a box: the same touches whatever lies in it.

    A plan of faces() puts its targets on the object's surface, so that the travel of the middle finger says nothing of the
    object. These touches are for what must not know it, as an agent that is to find out which object it is: how far each
    finger goes behind the box's face tells, and so does a finger that meets nothing.

    Args:
      min_mm: (3,) lower corner of the box in the object frame, mm; the box should hold every object that may lie there.
      max_mm: (3,) its upper corner, mm.
      samples_per_face: touches of each face, in the order +x, -x, +y, -y, +z, -z.
      seed: of the lines; nothing else decides them.
      max_tilt_deg: largest angle between the approach and the inward face normal, 0 to 60.
      spread: targets lie within this share of a face's half width and height, 0 to 1.
      standoff_mm: distance of the start from the target, which is on the face.
      stroke_mm: longest travel; needed where a finger may meet nothing, at a rig above all. None: no limit.
      speed_mm_s: commanded speed.
    """
    low, high = (_corner(name, values) for name, values in (("min_mm", min_mm), ("max_mm", max_mm)))
    if not (low < high).all():
        raise InvalidRequest(f"min_mm is {low.tolist()}, max_mm {high.tolist()}: every number of the former must be the smaller one.")
    count = checks.whole_number("samples_per_face", samples_per_face, 1, 1_000_000)
    tilt = checks.number("max_tilt_deg", max_tilt_deg)
    share = checks.number("spread", spread)
    if not 0 <= tilt <= 60:
        raise InvalidRequest(f"max_tilt_deg is {tilt:g}; it must lie between 0 and 60.")
    if not 0 <= share <= 1:
        raise InvalidRequest(f"spread is {share:g}; it must lie between 0 and 1.")
    rng = np.random.default_rng(checks.uint64("seed", seed))
    parts = [_of_face(rng, face, count, (low + high) / 2, (high - low) / 2, np.radians(tilt), share) for face in range(6)]
    target, approach, lateral = (np.concatenate(columns) for columns in zip(*parts))
    limit: dict[str, Any] = {} if stroke_mm is None else {"stroke_mm": checks.positive("stroke_mm", stroke_mm)}
    return touches(target_mm=target, approach=approach, lateral=lateral, standoff_mm=checks.positive("standoff_mm", standoff_mm),
                   speed_mm_s=checks.positive("speed_mm_s", speed_mm_s), **limit)


def _of_face(rng: np.random.Generator, face: int, count: int, centre: NDArray[np.float64], half: NDArray[np.float64], tilt: float,
             spread: float) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """(count, 3) targets, approaches and laterals: directions uniform over a cone about the inward normal, any roll."""
    axis, side = face // 2, 1 if face % 2 == 0 else -1
    u, v = (axis + 1) % 3, (axis + 2) % 3
    target = np.tile(centre, (count, 1))
    target[:, axis] += side * half[axis]
    target[:, [u, v]] += spread * half[[u, v]] * rng.uniform(-1, 1, (count, 2))
    inward, across = np.zeros(3), np.zeros(3)
    inward[axis], across[u] = -side, 1
    up = np.cross(inward, across)
    cosine = rng.uniform(np.cos(tilt), 1, (count, 1))
    sine = np.sqrt(1 - cosine**2)
    around, roll = rng.uniform(0, 2 * np.pi, (2, count, 1))
    approach = cosine * inward + sine * (np.cos(around) * across + np.sin(around) * up)
    approach /= np.linalg.norm(approach, axis=1, keepdims=True)
    right = across - (approach @ across)[:, None] * approach
    right /= np.linalg.norm(right, axis=1, keepdims=True)
    return target, approach, np.cos(roll) * right + np.sin(roll) * np.cross(approach, right)


def _corner(name: str, values: Sequence[float]) -> NDArray[np.float64]:
    try:
        corner = np.asarray(values, float)
    except (TypeError, ValueError):
        raise InvalidRequest(f"{name} is {values!r}, not three numbers.") from None
    if corner.shape != (3,) or not np.isfinite(corner).all():
        raise InvalidRequest(f"{name} is {values!r}; it must be three finite numbers.")
    return corner
