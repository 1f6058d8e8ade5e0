"""The one place of this package that converts units.

On the wire everything is SI with the unit at the end of the name (``descriptor_s``, ``target_m``). Here names
and values are what labs write: mm, us, deg, mm/s, again with the unit in every name (``descriptor_us``,
``target_mm``). Times on a human scale (a session's clock, the interval between touches) stay seconds.
"""

from __future__ import annotations

import math
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

_Number = TypeVar("_Number", float, NDArray[Any])

# End of the SI name, end of the lab name, factor. The first match counts, so "_m_s" comes before "_s".
_RULES = (
    ("_m_s", "_mm_s", 1e3),
    ("_rad", "_deg", 180 / math.pi),
    ("_m", "_mm", 1e3),
    ("_s", "_us", 1e6),
)

# Seconds in both worlds.
_SECONDS = frozenset({"session_time_s", "touch_interval_s", "touch_duration_s", "uptime_s", "window_s"})


def _rule(si_name: str) -> tuple[str, float]:
    if si_name not in _SECONDS:
        for si_end, lab_end, factor in _RULES:
            if si_name.endswith(si_end):
                return si_name[: -len(si_end)] + lab_end, factor
    return si_name, 1.0


def lab_name(si_name: str) -> str:
    """The name with the lab's unit: ``descriptor_s`` -> ``descriptor_us``; names without a unit stay."""
    return _rule(si_name)[0]


def lab_value(si_name: str, value: float) -> float:
    """A number that is called `si_name` on the wire, in the lab's unit."""
    return value * _rule(si_name)[1]


def si_value(si_name: str, value: _Number) -> _Number:
    """A number in the lab's unit, as the wire's `si_name` wants it."""
    # Dividing by an exact power of ten rounds once: 20 mm/s becomes the double nearest to 0.02 m/s.
    return value / _rule(si_name)[1]


def lab_array(si_name: str, values: NDArray[Any]) -> NDArray[Any]:
    """The array in the lab's unit and in the same dtype; one pass, or none if there is nothing to convert."""
    factor = _rule(si_name)[1]
    return values if factor == 1.0 else np.multiply(values, values.dtype.type(factor))
