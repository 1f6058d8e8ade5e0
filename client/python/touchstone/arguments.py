"""What public functions are given, checked against their annotations: one place for every call of the package.

`@checked` on a function, or on a class for its public methods. What an annotation does not say, a range or a word out of few, is
checked where the argument is used (checks.py).
"""

from __future__ import annotations

import collections.abc
import functools
import inspect
import os
import reprlib
import typing
import warnings
from typing import Any, Callable, NamedTuple, TypeVar

from .errors import InvalidRequest

Decorated = TypeVar("Decorated", bound=Callable[..., Any])

_MAX_SHOWN = 60  # characters of a value in a message


class _Kind(NamedTuple):
    """What one part of an annotation allows."""

    fits: Callable[[Any], bool]
    words: str


def _is_scalar(value: Any) -> bool:
    """Whether it can stand for one number: no text, no bool, no array."""
    return not isinstance(value, (str, bytes, bytearray, bool)) and type(value).__name__ != "bool_" and getattr(value, "ndim", 0) == 0


def _is_number(value: Any) -> bool:
    return _is_scalar(value) and (hasattr(value, "__float__") or hasattr(value, "__index__"))


def _is_path(value: Any) -> bool:
    return isinstance(value, (str, os.PathLike))


def _is_list_of(fits: Callable[[Any], bool]) -> Callable[[Any], bool]:
    def check(value: Any) -> bool:
        if isinstance(value, (str, bytes, collections.abc.Mapping)) or not isinstance(value, collections.abc.Iterable):
            return False
        # What can be gone through only once is left as it is.
        return not hasattr(value, "__len__") or all(fits(one) for one in value)

    return check


def _are_meshes(value: Any) -> bool:
    return isinstance(value, collections.abc.Mapping) and all(
        isinstance(name, str) and (_is_path(mesh) or type(mesh).__name__ == "Mesh") for name, mesh in value.items())


_KINDS = {
    "None": _Kind(lambda value: value is None, ""),
    "str": _Kind(lambda value: isinstance(value, str), "text"),
    "bool": _Kind(lambda value: isinstance(value, bool) or type(value).__name__ == "bool_", "True or False"),
    "int": _Kind(lambda value: _is_scalar(value) and hasattr(value, "__index__"), "a whole number"),
    "float": _Kind(_is_number, "a number"),
    "np.integer[Any]": _Kind(lambda value: _is_scalar(value) and hasattr(value, "__index__"), "a whole number"),
    "NDArray[np.integer[Any]]": _Kind(lambda value: getattr(getattr(value, "dtype", None), "kind", "") in ("i", "u"), "an array of them"),
    "os.PathLike[str]": _Kind(_is_path, "a path"),
    "Sequence[str]": _Kind(_is_list_of(lambda value: isinstance(value, str)), "a list of texts"),
    "Sequence[float]": _Kind(_is_list_of(_is_number), "a list of numbers"),
    "Sequence[str | os.PathLike[str]]": _Kind(_is_list_of(_is_path), "a list of paths"),
    "Sequence[Mapping[str, Any]]": _Kind(_is_list_of(lambda value: isinstance(value, collections.abc.Mapping)), "a list of mappings"),
    "tuple[str, Touches]": _Kind(lambda value: isinstance(value, tuple) and [type(one).__name__ for one in value] == ["str", "Touches"],
                                 "(object, Touches)"),
    "MeasurementsLike": _Kind(lambda value: _is_path(value) or _is_list_of(_is_path)(value),
                              "a measurement file (.csv), a folder of photographs, a session's name, or a list of them"),
    "MeshesLike": _Kind(lambda value: value is None or _is_path(value) or _are_meshes(value), "a folder of mesh files, or {object: file},"),
    "PosteriorLike": _Kind(lambda value: value is None or _is_path(value) or type(value).__name__ == "Report",
                           "a Report of client.diagnose(), or the file that it was saved as,"),
    "Views": _Kind(lambda value: type(value).__name__ in ("Touches", "Camera") or _is_list_of(lambda one: type(one).__name__ == "Camera")(value),
                   "Touches, a touchstone.Camera or a list of them"),
}
# How the objects of this package are made.
_MADE_BY = {
    "Touches": "Touches were expected, as touches(), client.plan() or a Row's command give them",
    "Row": "a Row was expected, as touchstone.read_plan() gives them",
    "Camera": "touchstone.Camera(eye_mm=(x, y, z)) was expected",
    "Report": "a Report was expected, as client.diagnose() gives it",
}


def shown(value: Any) -> str:
    """A value in a message: itself where it is short and plain, else what it is."""
    if isinstance(value, (str, bytes, bool, int, float, type(None), list, tuple, dict)):
        short = reprlib.Repr()
        short.maxstring = short.maxother = _MAX_SHOWN
        return short.repr(value)
    return type(value).__name__


def warn(text: str, category: type[Warning] = UserWarning) -> None:
    """A warning at the line outside of this package that called it."""
    level, frame = 1, inspect.currentframe()
    while frame is not None and frame.f_globals.get("__name__", "").partition(".")[0] == "touchstone":
        level, frame = level + 1, frame.f_back
    warnings.warn(text, category, stacklevel=level)


def instance(name: str, value: Any, kind: type) -> Any:
    """The value, which must be of a class of this package; InvalidRequest says what makes one."""
    if isinstance(value, kind):
        return value
    raise InvalidRequest(f"{name} is {shown(value)}; {_MADE_BY.get(kind.__name__, kind.__name__ + ' was expected')}.")


def _parts(annotation: str) -> list[str]:
    """Of "str | Sequence[str | None]" the outer ones."""
    parts, depth = [""], 0
    for character in annotation:
        depth += (character == "[") - (character == "]")
        if character == "|" and depth == 0:
            parts.append("")
        else:
            parts[-1] += character
    return [part.strip() for part in parts]


def _kind_of(part: str, names: dict[str, Any]) -> _Kind | None:
    """None: an annotation of which nothing is known here."""
    if part in _KINDS:
        return _KINDS[part]
    found = names.get(part)
    if part.startswith("Callable") or typing.get_origin(found) is collections.abc.Callable:
        return _Kind(callable, "a function")
    listed = part[len("Sequence["):-1] if part.startswith("Sequence[") else ""
    if isinstance(names.get(listed), type):
        of = names[listed]
        return _Kind(_is_list_of(lambda value: isinstance(value, of)), f"a list of {listed}")
    if isinstance(found, type) and found is not Any:
        return _Kind(lambda value: isinstance(value, found), part)
    return None


def _check_of(annotation: Any, names: dict[str, Any]) -> Callable[[str, Any], None] | None:
    """Raises InvalidRequest for a value that the annotation does not allow; None: it cannot be told."""
    if not isinstance(annotation, str):
        return None
    parts = _parts(annotation)
    kinds = [_kind_of(part, names) for part in parts]
    if not all(kinds):
        return None
    known = [kind for kind in kinds if kind is not None]
    words = " or ".join(dict.fromkeys(kind.words for kind in known if kind.words))
    made_by = next((_MADE_BY[part] for part in parts if part in _MADE_BY), f"{words} was expected")

    def check(name: str, value: Any) -> None:
        if not any(kind.fits(value) for kind in known):
            raise InvalidRequest(f"{name} is {shown(value)}; {made_by}.")

    return check


def _checked_function(function: Any) -> Any:
    @functools.cache
    def checks() -> tuple[tuple[str, ...], dict[str, Callable[[str, Any], None]], dict[str, Any]]:
        # Only now: names of the module that come later than the function are known.
        parameters = inspect.signature(function).parameters
        found = {name: _check_of(parameter.annotation, function.__globals__) for name, parameter in parameters.items()
                 if parameter.kind not in (parameter.VAR_POSITIONAL, parameter.VAR_KEYWORD)}
        positional = tuple(name for name, parameter in parameters.items() if parameter.kind == parameter.POSITIONAL_OR_KEYWORD)
        return positional, {name: check for name, check in found.items() if check is not None}, {
            name: parameter.default for name, parameter in parameters.items()}

    @functools.wraps(function)
    def call(*values: Any, **named: Any) -> Any:
        positional, known, defaults = checks()
        for name, value in (*zip(positional, values), *named.items()):
            if name in known and value is not defaults[name]:
                known[name](name, value)
        return function(*values, **named)

    return call


def checked(what: Decorated) -> Decorated:
    """A function, or a class with its constructor and public methods, that refuses arguments of a wrong type: InvalidRequest names
    the argument, the value and what would be right."""
    if not inspect.isclass(what):
        return typing.cast(Decorated, _checked_function(what))
    for name, member in list(vars(what).items()):
        if inspect.isfunction(member) and (not name.startswith("_") or name == "__init__"):
            setattr(what, name, _checked_function(member))
    return what
