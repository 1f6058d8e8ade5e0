"""The shape of an ONNX file's input, which OpenCV does not tell.

An ONNX file is a protobuf message; these fields are read without its schema, which no package here carries.
"""

from __future__ import annotations

import pathlib
from collections.abc import Iterator
from typing import Any

# Field numbers of onnx.proto: ModelProto, GraphProto, TensorProto; ValueInfoProto down to a dimension's value.
_GRAPH, _INITIALIZER, _INPUT, _TENSOR_NAME = 7, 5, 11, 8
_VALUE_NAME, _VALUE_TYPE, _TENSOR_TYPE, _SHAPE, _DIMENSION, _DIMENSION_VALUE = 1, 2, 1, 2, 1, 1


def input_shape(path: pathlib.Path) -> tuple[int, ...]:
    """Of the only input that is no weight; 0 for a side that the file leaves open.

    ValueError, saying what it lacks, for a file that is no network with one input; OSError if it cannot be read.
    """
    try:
        graph = list(_fields(_last(path.read_bytes(), _GRAPH)))
        weights = {_last(each, _TENSOR_NAME) for number, each in graph if number == _INITIALIZER}
        inputs = [each for number, each in graph if number == _INPUT and _last(each, _VALUE_NAME) not in weights]
        if len(inputs) != 1:
            raise ValueError(f"its graph has {len(inputs)} inputs besides its weights, not one")
        shape = _last(_last(_last(inputs[0], _VALUE_TYPE), _TENSOR_TYPE), _SHAPE)
        sides = [dict(_fields(each)).get(_DIMENSION_VALUE, 0) for number, each in _fields(shape) if number == _DIMENSION]
        return tuple(side if 0 < side < 2**31 else 0 for side in sides)  # negative: open
    except (IndexError, KeyError, TypeError) as error:
        raise ValueError("it is no ONNX file") from error


def _last(message: bytes, wanted: int) -> bytes:
    """The field's last value, which counts; KeyError if there is none."""
    return dict(_fields(message))[wanted]


def _fields(message: bytes) -> Iterator[tuple[int, Any]]:
    """(number, value): int, or bytes for whatever has a length. KeyError for what is no protobuf message."""
    view, place = memoryview(message), 0
    value: int | bytes | None
    while place < len(view):
        key, place = _varint(view, place)
        kind = key & 7
        if kind == 0:
            value, place = _varint(view, place)
        elif kind == 2:
            length, place = _varint(view, place)
            value, place = view[place:place + length].tobytes(), place + length
        elif kind in (1, 5):
            value, place = None, place + (8 if kind == 1 else 4)
        else:
            raise KeyError(kind)
        if place > len(view) or key >> 3 == 0:
            raise KeyError("beyond the end")
        yield key >> 3, value


def _varint(view: memoryview, place: int) -> tuple[int, int]:
    value = shift = 0
    while True:
        byte = view[place]
        value |= (byte & 127) << shift
        place, shift = place + 1, shift + 7
        if byte < 128:
            return value, place
        if shift > 63:
            raise KeyError("no number")
