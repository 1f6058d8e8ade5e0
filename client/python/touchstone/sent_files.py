"""The files whose texts were sent: a server names what it was sent by its field, a user knows the file."""

from __future__ import annotations

import collections
import hashlib
import re
from typing import Any

_KEPT = 256  # texts; those that were read long ago go first

_paths: collections.OrderedDict[str, str] = collections.OrderedDict()

# As a server begins what it says of a model file, "model.yaml:3:9: ...", "other_model: model.yaml:3:9: ..." or, of one that it is
# to keep, "yaml:3:9: ...", and of effects of the user's own.
_NAMES = re.compile(r"^(?:(other_model): )?(?:model\.)?yaml(?=:)|^also_yaml\[(\d+)\](?=:)")


def _key(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()


def remember(text: str, path: str) -> None:
    """Of a text that is about to be sent: the file that it was read from."""
    key = _key(text)
    _paths[key] = path
    _paths.move_to_end(key)
    while len(_paths) > _KEPT:
        _paths.popitem(last=False)


def _field(message: Any, name: str) -> Any:
    """Of a request, or of the part of it that names a model."""
    for part in (message, getattr(message, "evidence", None), getattr(message, "spec", None)):
        if part is not None and name in part.DESCRIPTOR.fields_by_name:
            return getattr(part, name)
    return None


def name_files(details: str, request: Any) -> str:
    """What a server says of a request, with the path in the place of the field where that was read from a file."""
    found = _NAMES.match(details)
    if found is None or request is None:
        return details
    if found.group(2) is not None:
        texts, place = _field(request, "also_yaml") or (), int(found.group(2))
        text = texts[place] if place < len(texts) else None
    else:
        model = _field(request, found.group(1) or "model")
        text = model.yaml if model is not None else _field(request, "yaml")
    path = _paths.get(_key(text)) if text else None
    return details if path is None else path + details[found.end():]
