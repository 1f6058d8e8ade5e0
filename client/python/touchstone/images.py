"""How images are made, and camera poses."""

from __future__ import annotations

import dataclasses
import numbers
from collections.abc import Sequence
from typing import Any, Union

from . import arguments, checks, units
from .errors import InvalidRequest
from .plans import Touches
from .v1 import source_pb2, types_pb2

_FORMATS = {"grey": types_pb2.PIXEL_FORMAT_GREY, "rgb": types_pb2.PIXEL_FORMAT_RGB}
_ENCODINGS = {
    "raw": types_pb2.IMAGE_ENCODING_RAW,
    "png": types_pb2.IMAGE_ENCODING_PNG,
    "jpeg": types_pb2.IMAGE_ENCODING_JPEG,
}
_SHADING_STYLES = {
    "shaded": types_pb2.SHADING_STYLE_SHADED,
    "dark_on_white": types_pb2.SHADING_STYLE_DARK_ON_WHITE,
}
_RENDERERS = {
    "auto": types_pb2.RENDERER_KIND_UNSPECIFIED,
    "egl": types_pb2.RENDERER_KIND_EGL,
    "cpu": types_pb2.RENDERER_KIND_CPU,
}


def renderer_name(kind: int) -> str:
    """ "egl" or "cpu"; "" if there is none."""
    return next((name for name, value in _RENDERERS.items() if value == kind and name != "auto"), "")


@dataclasses.dataclass(frozen=True)
class ImageOptions:
    """What image() makes; its attributes are image()'s arguments."""

    width: int
    height: int
    format: str
    encoding: str
    depth: bool
    mask: bool
    shading_style: str
    renderer: str
    jpeg_quality: int
    vertical_fov_deg: float
    normalize: bool = False

    def __post_init__(self) -> None:
        self.to_proto()  # a mistake is found where it is made

    def to_proto(self) -> types_pb2.ImageSpec:
        return types_pb2.ImageSpec(
            width=checks.whole_number("image width", self.width, 1, 2**32 - 1),
            height=checks.whole_number("image height", self.height, 1, 2**32 - 1),
            format=checks.choice("image format", self.format, _FORMATS),
            encoding=checks.choice("image encoding", self.encoding, _ENCODINGS),
            jpeg_quality=checks.whole_number("jpeg_quality", self.jpeg_quality, 1, 100),
            shading_style=checks.choice("shading style", self.shading_style, _SHADING_STYLES),
            depth=bool(self.depth),
            mask=bool(self.mask),
            normalize=bool(self.normalize),
            renderer=checks.choice("image renderer", self.renderer, _RENDERERS),
            vertical_fov_rad=units.si_value(
                "vertical_fov_rad", checks.positive("vertical_fov_deg", self.vertical_fov_deg)
            ),
        )


@arguments.checked
def image(width: int = 224, height: int = 224, format: str = "grey", encoding: str = "raw", *, depth: bool = False,
          mask: bool = False, shading_style: str = "shaded", renderer: str = "auto", jpeg_quality: int = 90,
          vertical_fov_deg: float = 45.0, normalize: bool = False) -> ImageOptions:
    """How the column "image" is made.

    Args:
      width: pixels, 1 to 2048.
      height: the same.
      format: "grey" (1 channel) or "rgb" (3).
      encoding: "raw" gives arrays, "png" and "jpeg" give EncodedImages.
      depth: also "depth_mm", float32 (rows, height, width) along the viewing axis, 0 where no object is.
      mask: also "mask", uint8 (rows, height, width), 255 where the object is.
      shading_style: "shaded" (white lights, black background) or "dark_on_white".
      renderer: "egl", "cpu", or "auto": the source's choice. Two renderers may differ by 1/255.
      jpeg_quality: 1 to 100, of "jpeg".
      vertical_fov_deg: field of view, above 0, below 180.
      normalize: a dark object on white, without ground and shadows, whatever was photographed, in grey; "mask" is
        then the one that this found. A picture without ground around the object becomes white, and its mask empty.
    """
    return ImageOptions(
        width, height, format, encoding, depth, mask, shading_style, renderer, jpeg_quality, vertical_fov_deg, normalize
    )


ImageLike = Union[ImageOptions, "tuple[int, int]", int]


def to_image(options: ImageLike) -> ImageOptions:
    """image(...) as it is; (width, height), or one number for both, stand for image(width, height)."""
    if isinstance(options, ImageOptions):
        return options
    sides = (options, options) if isinstance(options, numbers.Integral) else options
    if isinstance(sides, (tuple, list)) and len(sides) == 2 and not isinstance(options, bool):
        return image(checks.whole_number("image width", sides[0], 1, 2048),
                     checks.whole_number("image height", sides[1], 1, 2048))
    raise InvalidRequest(
        f"image is {options!r}; give touchstone.image(width=64, height=64), or (64, 64) for width and height."
    )


@arguments.checked
@dataclasses.dataclass(frozen=True)
class Camera:
    """A camera pose in the object frame.

    Attributes:
      eye_mm: (3,) where it stands.
      at_mm: (3,) what it looks at.
      up: upwards in the image; need not be perpendicular to the viewing axis.
      near_mm: what is nearer along the viewing axis is not drawn; 0, as far_mm: both enclose the object.
      far_mm: what is farther is not drawn.
    """

    eye_mm: Sequence[float]
    at_mm: Sequence[float] = (0.0, 0.0, 0.0)
    up: Sequence[float] = (0.0, 0.0, 1.0)
    near_mm: float = 0.0
    far_mm: float = 0.0

    def to_view(self) -> source_pb2.View:
        """The camera as touchstone.v1.View, SI. InvalidRequest where a vector has not three numbers."""
        return source_pb2.View(
            camera=source_pb2.CameraPose(
                eye_m=_vector("eye_mm", self.eye_mm, 1e3),
                at_m=_vector("at_mm", self.at_mm, 1e3),
                up=_vector("up", self.up, 1.0),
                near_m=units.si_value("near_m", checks.number("near_mm", self.near_mm)),
                far_m=units.si_value("far_m", checks.number("far_mm", self.far_mm)),
            )
        )


Views = Union[Touches, Camera, Sequence[Camera]]


def to_views(views: Views) -> list[source_pb2.View]:
    """Messages for the cameras of touches, or for explicit cameras."""
    if isinstance(views, Touches):
        return [source_pb2.View(touch=message) for message in views.to_messages()]
    cameras = [views] if isinstance(views, Camera) else list(views)
    for camera in cameras:
        if not isinstance(camera, Camera):
            raise InvalidRequest(f"A view is {type(camera).__name__}; give touches or touchstone.Camera.")
    return [camera.to_view() for camera in cameras]


def _vector(name: str, values: Any, divisor: float) -> types_pb2.Vector3:
    values = [checks.number(name, value) / divisor for value in values]
    if len(values) != 3:
        raise InvalidRequest(f"{name} has {len(values)} numbers; it needs 3.")
    return types_pb2.Vector3(x=values[0], y=values[1], z=values[2])
