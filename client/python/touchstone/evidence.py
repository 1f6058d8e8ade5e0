"""The measurements, the model and the meshes of a comparison or a diagnosis, as files of this machine."""

from __future__ import annotations

import csv
import dataclasses
import io
import os
import pathlib
from collections.abc import Mapping, Sequence
from typing import Any, Union

from . import arguments, checks
from .errors import InvalidRequest
from .models import ModelLike, model_ref, read_model_file
from .v1 import diagnosis_pb2

_FORMATS = ("off", "obj", "stl", "ply")


@arguments.checked
@dataclasses.dataclass(frozen=True)
class Mesh:
    """A mesh file that is not in millimetres with +z up.

    Attributes:
      path: .off, .obj, .stl or .ply.
      unit: "mm", "cm", "m" or "inch".
      up: "x", "y" or "z".
      scale: applied after the unit; 1: as is.
    """

    path: str | os.PathLike[str]
    unit: str = "mm"
    up: str = "z"
    scale: float = 1.0


MeshLike = Union[Mesh, str, os.PathLike[str]]
MeshesLike = Union[Mapping[str, MeshLike], str, os.PathLike[str], None]


# One set, or several sessions of one rig in the order in which they were made.
MeasurementsLike = Union[str, "os.PathLike[str]", Sequence[Union[str, "os.PathLike[str]"]]]


def sessions(measurements: MeasurementsLike, model: ModelLike, meshes: MeshesLike, also: Sequence[str | os.PathLike[str]],
             seed: int) -> tuple[diagnosis_pb2.Evidence, list[diagnosis_pb2.Evidence]]:
    """The message of the first session, with the meshes of all, and those of the others."""
    if isinstance(measurements, (str, os.PathLike)):
        return evidence(measurements, model, meshes, also, seed), []
    if not measurements:
        raise InvalidRequest("measurements is an empty list; give a measurement file, or several sessions.")
    first, *others = (evidence(one, model, meshes, also, seed) for one in measurements)
    known = {mesh.name for mesh in first.meshes}
    for other in others:
        for mesh in other.meshes:
            if mesh.name not in known:
                first.meshes.add().CopyFrom(mesh)
                known.add(mesh.name)
        for field in ("model", "meshes", "also_yaml", "seed"):
            other.ClearField(field)
    return first, others


def evidence(measurements: str | os.PathLike[str], model: ModelLike, meshes: MeshesLike, also: Sequence[str | os.PathLike[str]],
             seed: int) -> diagnosis_pb2.Evidence:
    """The message; arguments as in Client.diagnose()."""
    message = diagnosis_pb2.Evidence(
        model=model_ref(model), seed=checks.uint64("seed", seed), also_yaml=[read_model_file(path) for path in also]
    )
    path = pathlib.Path(measurements)
    message.origin = os.fspath(measurements)
    objects: list[str] = []
    if path.is_dir():
        _add_images(path, message, objects)
        if (path / "touches.csv").exists():
            _add_touches(path / "touches.csv", message, objects)
    elif path.exists() or path.suffix == ".csv" or path.parent != pathlib.Path("."):
        _add_touches(path, message, objects)
    else:
        message.session = os.fspath(measurements)  # that the server keeps
    message.meshes.extend(_mesh(name, mesh) for name, mesh in _meshes_of(meshes, objects).items())
    return message


def _read(path: pathlib.Path) -> bytes:
    try:
        return path.read_bytes()
    except OSError as error:
        raise InvalidRequest(f"{path}: {error.strerror}.") from None


def _objects_in(table: bytes) -> list[str]:
    """What its column "object" names; the server reads the rest of it, and says what is wrong there."""
    rows = csv.DictReader(io.StringIO(table.decode("utf-8", "replace")))
    return list(dict.fromkeys(row["object"] for row in rows if row.get("object")))


def _add_touches(path: pathlib.Path, message: diagnosis_pb2.Evidence, objects: list[str]) -> None:
    message.csv = _read(path)
    objects += _objects_in(message.csv)


def _add_images(folder: pathlib.Path, message: diagnosis_pb2.Evidence, objects: list[str]) -> None:
    images = message.images
    images.origin = str(folder)
    images.images_csv = _read(folder / "images.csv")
    if (folder / "camera.yaml").exists():
        images.camera_yaml = _read(folder / "camera.yaml")
    rows = csv.DictReader(io.StringIO(images.images_csv.decode("utf-8", "replace")))
    for name in dict.fromkeys(row["file"] for row in rows if row.get("file")):
        images.files.add(name=name, png=_read(folder / name))
    objects += _objects_in(images.images_csv)


def _meshes_of(meshes: MeshesLike, objects: Sequence[str]) -> Mapping[str, MeshLike]:
    """By the names of objects; of a folder the files that bear one."""
    if meshes is None:
        return {}
    if isinstance(meshes, Mapping):
        return meshes
    folder = pathlib.Path(meshes)
    if not folder.is_dir():
        raise InvalidRequest(f"meshes is {os.fspath(meshes)!r}; give a folder of mesh files, or {{object: file}}.")
    # In the order of the formats, so that the first of several wins whatever the folder's order.
    files = {file.name: file for file in folder.iterdir()}
    return {
        name: next(files[f"{name}.{form}"] for form in _FORMATS if f"{name}.{form}" in files)
        for name in objects if any(f"{name}.{form}" in files for form in _FORMATS)
    }


def _mesh(name: str, given: MeshLike) -> diagnosis_pb2.MeshFile:
    mesh = given if isinstance(given, Mesh) else Mesh(given)
    path = pathlib.Path(mesh.path)
    form = path.suffix[1:].lower()
    if form not in _FORMATS:
        raise InvalidRequest(f"The mesh of {name!r} is {path}; its name must end in .{', .'.join(_FORMATS)}.")
    return diagnosis_pb2.MeshFile(
        name=name, format=_number("format", form, diagnosis_pb2.MeshFile.Format), data=_read(path),
        unit=_number("unit", mesh.unit, diagnosis_pb2.MeshFile.LengthUnit),
        up=_number("up", mesh.up, diagnosis_pb2.MeshFile.Axis), scale=checks.positive("scale", mesh.scale),
    )


def _number(what: str, name: str, enum: Any) -> Any:
    """The number of a name of the protocol's, which is written in capitals there."""
    names = [known for known, number in enum.items() if number != 0]
    if name.upper() not in names:
        raise InvalidRequest(f"{what} = {name!r}; one of {', '.join(known.lower() for known in names)} was expected.")
    return enum.Value(name.upper())
