"""Models, effects and objects as a source describes them, and how a request names a model."""

from __future__ import annotations

import dataclasses
import os
import pathlib
import re
from typing import Union

from . import images, units
from .errors import InvalidRequest
from .sent_files import remember
from .v1 import models_pb2, source_pb2, types_pb2

_SOURCE_KINDS: dict[int, str] = {source_pb2.SOURCE_KIND_VIRTUAL: "virtual", source_pb2.SOURCE_KIND_PHYSICAL: "physical"}


def source_kind(kind: int) -> str:
    """ "virtual" or "physical"; "unknown" from a newer source."""
    return _SOURCE_KINDS.get(kind, "unknown")


@dataclasses.dataclass(frozen=True)
class Description:
    """What a source is and what it can do; limits are 0 where a method is not offered.

    Attributes:
      kind: "virtual" or "physical".
      version: of its program.
      plans: the plans that make sense here: "sphere", "faces", "list".
      default_model: name of the model of requests that name none; "" at a physical source.
      default_model_hash: its hash.
      renderer: "egl", "cpu" or "": no camera.
      renderer_description: the renderer in words.
      max_touches_per_request: limit of Client.touch().
      max_images_per_request: limit of Client.capture().
      max_image_side: largest width and height, pixels.
      max_batch_size: samples of a batch.
      max_fingers: of a model.
      lease_required: whether touches need a lease.
      touch_duration_s: what one touch takes, about; 0: as fast as it computes.
      clock_uncertainty_us: standard uncertainty of contact times; 0: exact.
      max_indices_per_request: samples of one request by index.
    """

    kind: str
    version: str
    plans: tuple[str, ...]
    default_model: str
    default_model_hash: str
    renderer: str
    renderer_description: str
    max_touches_per_request: int
    max_images_per_request: int
    max_image_side: int
    max_batch_size: int
    max_fingers: int
    lease_required: bool
    touch_duration_s: float
    clock_uncertainty_us: float
    max_indices_per_request: int

    @classmethod
    def from_proto(cls, m: source_pb2.DescribeResponse) -> Description:
        return cls(
            source_kind(m.kind), m.version, tuple(m.plans), m.default_model, m.default_model_hash,
            images.renderer_name(m.renderer), m.renderer_description, m.max_touches_per_request,
            m.max_images_per_request, m.max_image_side, m.max_batch_size, m.max_fingers, m.lease_required,
            m.touch_duration_s, units.lab_value("clock_uncertainty_s", m.clock_uncertainty_s),
            m.max_indices_per_request,
        )


@dataclasses.dataclass(frozen=True)
class ObjectInfo:
    """An object that can be touched.

    Attributes:
      name: as in Client.dataset().
      vertices: of its mesh.
      triangles: of its mesh.
      bounds_min_mm: lower corner of its box in the object frame.
      bounds_max_mm: upper corner.
      closed: no edge is open or shared by more than two triangles.
      mesh_hash: SHA-256 of the mesh.
      origin: "built-in supershape", or the file's name.
    """

    name: str
    vertices: int
    triangles: int
    bounds_min_mm: tuple[float, float, float]
    bounds_max_mm: tuple[float, float, float]
    closed: bool
    mesh_hash: str
    origin: str

    @classmethod
    def from_proto(cls, m: source_pb2.Object) -> ObjectInfo:
        return cls(m.name, m.vertices, m.triangles, _corner_mm(m.bounds_min_m), _corner_mm(m.bounds_max_m), m.closed,
                   m.mesh_hash, m.origin)


def _corner_mm(v: types_pb2.Vector3) -> tuple[float, float, float]:
    return units.lab_value("_m", v.x), units.lab_value("_m", v.y), units.lab_value("_m", v.z)


_ARITIES = {
    types_pb2.PARAMETER_ARITY_SCALAR: "scalar",
    types_pb2.PARAMETER_ARITY_VECTOR3: "vector3",
    types_pb2.PARAMETER_ARITY_VECTOR2: "vector2",
    types_pb2.PARAMETER_ARITY_PER_FINGER: "finger",
}
_STAGES = {
    types_pb2.EFFECT_STAGE_POSE: "pose",
    types_pb2.EFFECT_STAGE_CONTACT: "contact",
    types_pb2.EFFECT_STAGE_MOTION: "motion",
    types_pb2.EFFECT_STAGE_SENSOR: "sensor",
    types_pb2.EFFECT_STAGE_CAMERA_POSE: "camera pose",
    types_pb2.EFFECT_STAGE_PROJECTION: "projection",
    types_pb2.EFFECT_STAGE_SHADING: "shading",
    types_pb2.EFFECT_STAGE_IMAGE_SENSOR: "image sensor",
}


@dataclasses.dataclass(frozen=True)
class Parameter:
    """A parameter of an effect, in the unit of model files.

    Attributes:
      name: ends in the unit, "radius_mm".
      unit: "mm"; "" of a share or a count.
      arity: "scalar", "vector3" (object frame unless said), "vector2" (image) or "finger" (one value per finger).
      min: smallest value that a model may have.
      max: largest.
      default: the value that changes nothing.
      typical: what rigs usually show.
      sum_zero: the fingers' values have the sum 0.
      meaning: in words.
    """

    name: str
    unit: str
    arity: str
    min: float
    max: float
    default: float
    typical: float
    sum_zero: bool
    meaning: str


@dataclasses.dataclass(frozen=True)
class Effect:
    """An effect of the catalogue.

    Attributes:
      name: as in a model file, "tip_radius".
      stage: "pose", "contact", "motion" or "sensor" of a touch; "camera pose", "projection", "shading" or "image sensor" of a photograph.
      meaning: what it is.
      signature: how it shows in measurements.
      check_on_rig: how to find out at the rig.
      remedy: what to do about it.
      parameters: what it takes.
    """

    name: str
    stage: str
    meaning: str
    signature: str
    check_on_rig: str
    remedy: str
    parameters: tuple[Parameter, ...]

    @classmethod
    def from_proto(cls, m: types_pb2.Effect) -> Effect:
        parameters = tuple(
            Parameter(
                p.name, p.unit, _ARITIES.get(p.arity, "unknown"), p.min, p.max, p.default_value, p.typical, p.sum_zero,
                p.meaning,
            )
            for p in m.parameters
        )
        stage = _STAGES.get(m.stage, "unknown")
        return cls(m.name, stage, m.meaning, m.signature, m.check_on_rig, m.remedy, parameters)


@dataclasses.dataclass(frozen=True)
class Model:
    """A model in the source's store.

    Attributes:
      name: in the store.
      hash: SHA-256 of its content, 64 hexadecimal digits.
      yaml: the whole model file.
      fingers: of the end effector.
      spacing_mm: between neighbouring fingers.
    """

    name: str
    hash: str
    yaml: str
    fingers: int
    spacing_mm: float

    @classmethod
    def from_proto(cls, m: models_pb2.Model) -> Model:
        return cls(m.name, m.hash, m.yaml, m.fingers, units.lab_value("spacing_m", m.spacing_m))


ModelLike = Union[None, str, os.PathLike[str], Model]


def model_ref(model: ModelLike) -> types_pb2.ModelRef:
    """What a request says for a model.

    None: the source's default. A Model: its hash. A path, or a text that ends in .yaml or .yml or has a /: the contents
    of that file are sent. A text with more than one line: a whole model file. 8 to 64 hexadecimal digits: a hash.
    Any other text: a name in the source's store.
    """
    if model is None:
        return types_pb2.ModelRef()
    if isinstance(model, Model):
        return types_pb2.ModelRef(hash=model.hash)
    if isinstance(model, str):
        if "\n" in model:
            return types_pb2.ModelRef(yaml=model)
        if not model.endswith((".yaml", ".yml")) and "/" not in model:
            if pathlib.PurePath(model).suffix and pathlib.Path(model).is_file():
                raise InvalidRequest(f"model: '{model}' is a file, but no model file: the name of one ends in .yaml.")
            is_hash = re.fullmatch("[0-9a-f]{8,64}", model)
            return types_pb2.ModelRef(hash=model) if is_hash else types_pb2.ModelRef(name=model)
    elif not isinstance(model, os.PathLike):
        raise InvalidRequest(f"model is {type(model).__name__}; give a name, a hash, a path or a Model.")
    return types_pb2.ModelRef(yaml=read_model_file(model))


# "- surface_map: {file: better.surface.csv}", as the command line writes it.
_SURFACE_MAP = re.compile(
    r"^([ \t]*)- surface_map:[ \t]*\{[ \t]*file:[ \t]*(\"[^\"]*\"|[^,}\"]+?)[ \t]*\}[ \t]*$", re.MULTILINE)


def _with_content(found: re.Match[str], folder: pathlib.Path) -> str:
    """The same effect with the text of the map in it: a server cannot read the files that a model names."""
    indent, name = found.groups()
    path = folder / name.strip('"')
    try:
        lines = path.read_text(encoding="utf-8").splitlines()
    except OSError as error:
        raise InvalidRequest(f"surface_map {path}: {error.strerror}.") from None
    body = "".join(f"{indent}        {line}\n" for line in lines if line.strip())
    return f"{indent}- surface_map:\n{indent}    file: {name}\n{indent}    csv: |\n{body}".rstrip("\n")


def read_model_file(path: str | os.PathLike[str]) -> str:
    """The text of a model file, with the surface map in it that it names. InvalidRequest where it cannot be read."""
    try:
        text = pathlib.Path(path).read_text(encoding="utf-8")
        text = re.sub(_SURFACE_MAP, lambda found: _with_content(found, pathlib.Path(path).parent), text)
    except OSError as error:
        raise InvalidRequest(f"Model file {os.fspath(path)}: {error.strerror}.") from None
    except UnicodeDecodeError:
        raise InvalidRequest(f"Model file {os.fspath(path)} is not UTF-8 text.") from None
    remember(text, os.fspath(path))
    return text
