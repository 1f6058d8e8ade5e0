"""What is exported, whatever it was read from: columns with type, shape and unit, and batches of rows."""

from __future__ import annotations

import dataclasses
import hashlib
import importlib
import io
import pathlib
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import Refused

# An array of as many rows, or a list of files (bytes) or texts.
Values = Any
ROWS_OF_A_BATCH = 256

# What the columns of datasets and sessions mean; a card says it.
_MEANINGS = {
    "index": "number of the sample in the dataset",
    "object": "number of the object among those of the dataset",
    "object_name": "name of the object",
    "descriptor_us": "contact times relative to the first finger's, one per finger; NaN: reported nothing",
    "contact_time_us": "contact times since the approach began, one per finger; NaN: reported nothing",
    "target_mm": "point that the middle finger aims at, object frame",
    "approach": "unit vector of the motion, object frame",
    "lateral": "unit vector from the first finger towards the last, object frame",
    "standoff_mm": "distance of the middle finger's start from the target",
    "speed_mm_s": "commanded speed",
    "contact_point_mm": "where each finger met the object, object frame",
    "normal": "outward surface normal at each contact, object frame",
    "image": "picture from the middle finger's start",
    "depth_mm": "depth along the viewing axis, 0 where no object is",
    "mask": "255 on the object, 0 beside it",
    "touch": "number of the touch in the file",
    "session_time_s": "when the approach began since the session did",
    "eye_mm": "where the camera stands, object frame",
    "at_mm": "point that the camera's axis goes through, object frame",
    "up": "vector towards the picture's upper edge, object frame",
}


@dataclasses.dataclass(frozen=True)
class Column:
    """One value per row.

    Attributes:
      name: ends in the unit, as everywhere.
      dtype: of NumPy, or "text".
      shape: of one row's value; of a picture height, width, channels.
      unit: "mm", "" where there is none.
      encoding: "png" or "jpeg" where a row's value is a file as bytes, else "".
    """

    name: str
    dtype: str
    shape: tuple[int, ...] = ()
    unit: str = ""
    encoding: str = ""

    @property
    def is_image(self) -> bool:
        return bool(self.encoding) or (self.name == "image" and self.dtype == "uint8")

    @property
    def meaning(self) -> str:
        return _MEANINGS.get(self.name, "")


@dataclasses.dataclass(frozen=True)
class Table:
    """Rows to export.

    Attributes:
      name: of the dataset or session.
      rows: how many there are.
      objects: their names; of datasets the column `object` counts in them.
      provenance: what a card and the formats' own metadata say of the origin, as JSON takes it.
      manifest: the text of dataset.json, "" where there is none.
    """

    name: str
    rows: int
    columns: tuple[Column, ...]
    objects: tuple[str, ...]
    provenance: dict[str, Any]
    manifest: str = ""

    def batches(self) -> Iterator[dict[str, Values]]:
        """All rows in their order, at most ROWS_OF_A_BATCH at once."""
        raise NotImplementedError

    def column(self, name: str) -> Column | None:
        return next((column for column in self.columns if column.name == name), None)


def need(module: str, what: str, package: str = "") -> Any:
    """The module of an optional package. Refused, with the command that installs it, where it is not there."""
    try:
        return importlib.import_module(module)
    except ModuleNotFoundError as error:
        lacks = package or (error.name or module).partition(".")[0]
        raise Refused(f"{what} needs the Python package {lacks}. Install it with: pip install {lacks}; or everything that exports "
                      "and imports need: pip install 'touchstone-sim[formats]'") from None
    except ImportError as error:
        raise Refused(f"{what} needs {module}, which cannot be imported here: {error}") from None


def file_of(picture: NDArray[Any] | bytes) -> bytes:
    """A picture as a file: as it is, or a PNG of the array (height, width, channels)."""
    if isinstance(picture, bytes):
        return picture
    image = need("PIL.Image", "writing pictures", "pillow")
    buffer = io.BytesIO()
    image.fromarray(picture[..., 0] if picture.ndim == 3 and picture.shape[-1] == 1 else picture).save(buffer, "PNG")
    return buffer.getvalue()


def pixels_of(file: bytes, shape: Sequence[int]) -> NDArray[Any]:
    """The array (height, width, channels) of a PNG or JPEG file."""
    image = need("PIL.Image", "reading pictures", "pillow")
    with image.open(io.BytesIO(file)) as opened:
        return np.asarray(opened, np.uint8).reshape(tuple(shape))


def sha256_of(path: pathlib.Path) -> str:
    digest = hashlib.sha256()
    with open(path, "rb") as file:
        while piece := file.read(1 << 20):
            digest.update(piece)
    return digest.hexdigest()
