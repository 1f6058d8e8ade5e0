"""Checks of arguments that protobuf would report badly or not at all."""

from __future__ import annotations

import difflib
import math
import operator
from collections.abc import Iterable, Mapping
from typing import Any

from .errors import InvalidRequest


def whole_number(name: str, value: Any, minimum: int, maximum: int) -> int:
    """The value as an int within bounds, or InvalidRequest naming both."""
    try:
        if isinstance(value, bool):  # True is no 1 of anybody
            raise TypeError
        number = operator.index(value)
    except TypeError:
        raise InvalidRequest(f"{name} is {value!r}, not a whole number.") from None
    if not minimum <= number <= maximum:
        raise InvalidRequest(f"{name} is {number}; it must lie between {minimum} and {maximum}.")
    return number


def uint64(name: str, value: Any) -> int:
    return whole_number(name, value, 0, 2**64 - 1)


def number(name: str, value: Any) -> float:
    """The value as a finite float. Physical bounds are the source's to check."""
    try:
        if isinstance(value, (str, bytes, bool)):  # "20" is text, and True is no 1 of anybody
            raise TypeError
        result = float(value)
    except (TypeError, ValueError):
        raise InvalidRequest(f"{name} is {value!r}, not a number.") from None
    if not math.isfinite(result):
        raise InvalidRequest(f"{name} is {result}; it must be finite.")
    return result


def positive(name: str, value: Any) -> float:
    """The value as a float above 0: on the wire 0 means the default, so a 0 of the user must not get there."""
    result = number(name, value)
    if result <= 0:
        raise InvalidRequest(f"{name} is {result:g}; it must be above 0.")
    return result


def not_negative(name: str, value: Any) -> float:
    """The value as a finite float, 0 or more."""
    result = number(name, value)
    if result < 0:
        raise InvalidRequest(f"{name} is {result:g}; it must be 0 or more.")
    return result


def part(start: Any, stop: Any, end: int) -> tuple[int, int]:
    """(start, stop) of a part of `end` samples; a stop of None is the end. InvalidRequest where start is behind stop."""
    last = end if stop is None else whole_number("stop", stop, 0, end)
    first = whole_number("start", start, 0, end)
    if first > last:
        raise InvalidRequest(f"start is {first} and stop is {last}; start must not be behind stop, the sample after the last one.")
    return first, last


def choice(name: str, value: str, choices: Mapping[str, Any]) -> Any:
    """The enum value of a word; InvalidRequest names the allowed words."""
    if isinstance(value, str) and value in choices:
        return choices[value]
    raise InvalidRequest(f'{name} is {value!r}; it must be {_either(choices)}.{_hint(value, choices)}')


def _either(words: Iterable[str]) -> str:
    quoted = [f'"{word}"' for word in words]
    return quoted[0] if len(quoted) == 1 else ", ".join(quoted[:-1]) + " or " + quoted[-1]


def _hint(value: Any, words: Iterable[str]) -> str:
    near = difflib.get_close_matches(str(value), list(words), n=1)
    return f' Did you mean "{near[0]}"?' if near else ""


def known_keys(what: str, keys: Iterable[str], known: Iterable[str]) -> None:
    """InvalidRequest if a key is not among the known ones."""
    known = list(known)
    for key in keys:
        if key not in known:
            raise InvalidRequest(f'{what} has no "{key}"; there are {", ".join(known)}.{_hint(key, known)}')


def is_sequence_of_text(values: Any) -> bool:
    return not isinstance(values, (str, bytes)) and all(isinstance(value, str) for value in values)
