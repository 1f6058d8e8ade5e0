"""A second simulation of photographs, written from the definitions of the effects (DESIGN, section 5) and of the nominal
shading (the words of server/image/scene/shading.h) alone. One ray per pixel centre; lens, blurs and turns by OpenCV.
"""
import dataclasses
from typing import Optional

import cv2
import numpy as np

import caster

AMBIENT = 0.07
# Right, up, towards the eye, in multiples of the radius of the bounding sphere, round its centre; strength.
KEY = (np.array([-3.5, 4.0, 4.0]), 0.88)
FILL = (np.array([4.0, -1.0, 2.5]), 0.26)


@dataclasses.dataclass
class Camera:
    """Nominal lens; pixel centres at half-integers."""

    width: int = 224
    height: int = 224
    fx: float = 224 / 2 / np.tan(np.radians(22.5))
    fy: float = 224 / 2 / np.tan(np.radians(22.5))
    cx: float = 112.0
    cy: float = 112.0


@dataclasses.dataclass
class Pose:
    """Commanded, object frame, mm."""

    eye: np.ndarray
    at: np.ndarray
    up: np.ndarray


@dataclasses.dataclass
class Physics:
    """What effects change, in the units of files; every field starts where it changes nothing."""

    camera_translation: tuple = (0, 0, 0)
    camera_rotation: tuple = (0, 0, 0)
    focal_error: float = 0
    principal_point: tuple = (0, 0)
    radial_distortion: tuple = (0, 0)
    light_position: tuple = (0, 0, 0)
    ambient_light: float = 0
    specular: tuple = (0, 20)
    cast_shadow: float = 0
    background_level: float = 0
    vignetting: float = 0
    defocus_blur: float = 0
    motion_blur: tuple = (0, 0)
    exposure: float = 0
    gamma: float = 1
    response: float = 0  # 1: the camera writes sRGB's curve
    black_level: float = 0  # pedestal, grey levels
    image_noise: tuple = (2, 0)  # sigma_grey, gain
    # Not in any catalogue.
    albedo: object = None  # points (n x 3, mm) -> factor of the surface's light
    dirt: Optional[np.ndarray] = None  # height x width, factor of the light that falls on the image sensor
    reflection: Optional[np.ndarray] = None  # height x width, light added on the image sensor
    shutter_px: tuple = (0, 0)  # how far the picture moves (right, down) while its rows are read from top to bottom
    flicker_stops: float = 0


def viewing_points(camera, physics):
    """Where the ray of each pixel centre passes the plane one step before the eye: n x 2, right and down."""
    fx, fy = camera.fx * (1 + physics.focal_error), camera.fy * (1 + physics.focal_error)
    cx, cy = camera.cx + physics.principal_point[0], camera.cy + physics.principal_point[1]
    column, row = np.meshgrid(np.arange(camera.width) + 0.5, np.arange(camera.height) + 0.5)
    # A picture that moves while it is read: its rows show places that lie against the motion.
    share = row / camera.height - 0.5
    column = column - physics.shutter_px[0] * share
    row = row - physics.shutter_px[1] * share
    pixels = np.stack([column.ravel(), row.ravel()], 1)
    lens = np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1.0]])
    k1, k2 = physics.radial_distortion
    if k1 == 0 and k2 == 0:
        return (pixels - [cx, cy]) / [fx, fy]
    # OpenCV solves for the undistorted point by iteration; the criterion goes far beyond its default.
    found = cv2.undistortPointsIter(pixels.reshape(-1, 1, 2), lens, np.array([k1, k2, 0, 0]), None, None,
                                    (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 200, 1e-13))
    return found.reshape(-1, 2)


@dataclasses.dataclass
class Seen:
    """What the pixels of one picture see; entries for the pixels that see the object."""

    pixel: np.ndarray
    point: np.ndarray  # mm
    normal: np.ndarray  # not unit: interpolated
    to_eye: np.ndarray  # unit
    depth: np.ndarray
    axes: np.ndarray  # of the commanded camera


def see(solid, pose, camera, physics):
    nominal = caster.looking(pose.eye, pose.at, pose.up)
    eye = pose.eye + np.asarray(physics.camera_translation, float) @ nominal
    turned, _ = cv2.Rodrigues(np.radians(np.asarray(physics.camera_rotation, float)))
    axes = turned.T @ nominal  # rows: the real camera's axes
    points = viewing_points(camera, physics)
    index, depth, weight = caster.Bundle(solid, eye, axes).first(points)
    pixel = np.flatnonzero(index != caster.NONE)
    index, depth, weight = index[pixel], depth[pixel], weight[pixel]
    ray = np.c_[points[pixel], np.ones(len(pixel))] @ axes
    normals = solid.normals[index]
    w = np.c_[1 - weight.sum(1), weight]
    normal = np.einsum("ij,ijk->ik", w, normals)
    return Seen(pixel, eye + ray * depth[:, None], normal, -ray / np.linalg.norm(ray, axis=1, keepdims=True), depth,
                nominal)


def _unit(vectors):
    return vectors / np.maximum(np.linalg.norm(vectors, axis=1, keepdims=True), 1e-300)


def lamp(solid, axes, place, offset=(0, 0, 0)):
    """Where a light stands, mm: with the commanded camera's axes, round the object's centre."""
    right, up, towards_eye = axes[0], -axes[1], -axes[2]
    along = solid.radius * place + np.asarray(offset, float)
    return solid.centre + along[0] * right + along[1] * up + along[2] * towards_eye


def in_shadow(solid, seen, light):
    """Whether the way from each point to the light meets the solid."""
    axes = caster.looking(light, solid.centre, np.array([0.3, 0.5, 0.9]))
    local = (seen.point - light) @ axes.T
    bundle = caster.Bundle(solid, light, axes)
    # The first face towards the light along the way; the point's own is the last one before it, but for rounding.
    _, first, _ = bundle.first(local[:, :2] / local[:, 2:])
    return (first > 0) & (first < local[:, 2] - 1e-4 * solid.radius)


def shade(solid, seen, physics):
    """Linear light of the points seen."""
    n = _unit(seen.normal)
    key_at = lamp(solid, seen.axes, KEY[0], physics.light_position)
    to_key, to_fill = _unit(key_at - seen.point), _unit(lamp(solid, seen.axes, FILL[0]) - seen.point)
    cosine = np.einsum("ij,ij->i", n, to_key)
    key = KEY[1] * np.maximum(0, cosine)
    strength, exponent = physics.specular
    if strength:
        half = np.maximum(0, np.einsum("ij,ij->i", n, _unit(to_key + seen.to_eye)))
        key = key + np.where(cosine > 0, strength * half ** exponent, 0)
    if physics.cast_shadow:
        key = key * np.where(in_shadow(solid, seen, key_at), 1 - physics.cast_shadow, 1)
    fill = FILL[1] * np.maximum(0, np.einsum("ij,ij->i", n, to_fill))
    light = AMBIENT + physics.ambient_light + key + fill
    return light * physics.albedo(seen.point) if physics.albedo is not None else light


def motion_kernel(length, angle_deg):
    """A box along a line, laid over pixels by linear interpolation."""
    steps = max(64, int(64 * length))
    at = ((np.arange(steps) + 0.5) / steps - 0.5) * length
    right, down = at * np.cos(np.radians(angle_deg)), -at * np.sin(np.radians(angle_deg))
    reach = int(np.ceil(length / 2)) + 1
    grid = np.arange(-reach, reach + 1)
    across = np.maximum(0, 1 - np.abs(grid[:, None] - right))
    along = np.maximum(0, 1 - np.abs(grid[:, None] - down))
    return along @ across.T / steps


def record(light, camera, physics):
    """Grey levels, 0 to 255, without noise, of linear light (height x width)."""
    if physics.vignetting:
        cx, cy = camera.cx + physics.principal_point[0], camera.cy + physics.principal_point[1]
        column, row = np.meshgrid(np.arange(camera.width) + 0.5 - cx, np.arange(camera.height) + 0.5 - cy)
        square = (column ** 2 + row ** 2) / (0.25 * (camera.width ** 2 + camera.height ** 2))
        light = light * (1 - physics.vignetting * square)
    if physics.defocus_blur:
        side = 2 * int(np.ceil(6 * physics.defocus_blur)) + 1
        light = cv2.GaussianBlur(light, (side, side), physics.defocus_blur, borderType=cv2.BORDER_REPLICATE)
    if physics.motion_blur[0]:
        light = cv2.filter2D(light, cv2.CV_64F, motion_kernel(*physics.motion_blur), borderType=cv2.BORDER_REPLICATE)
    if physics.dirt is not None:
        light = light * physics.dirt
    if physics.reflection is not None:
        light = light + physics.reflection
    light = np.clip(light * 2.0 ** (physics.exposure + physics.flicker_stops), 0, 1)
    recorded = light ** physics.gamma
    if physics.response:
        recorded = np.where(recorded <= 0.0031308, 12.92 * recorded, 1.055 * recorded ** (1 / 2.4) - 0.055)
    return np.minimum(255 * recorded + physics.black_level, 255)


def lit(solid, seen, camera, physics):
    light = np.full(camera.height * camera.width, physics.background_level / 255.0)
    light[seen.pixel] = shade(solid, seen, physics)
    return light.reshape(camera.height, camera.width)


def expected(solid, pose, camera, physics):
    """Grey levels before noise and rounding, and the mask of the object."""
    seen = see(solid, pose, camera, physics)
    mask = np.zeros(camera.height * camera.width, bool)
    mask[seen.pixel] = True
    return record(lit(solid, seen, camera, physics), camera, physics), mask.reshape(camera.height, camera.width)


def with_noise(grey, physics, random):
    sigma, gain = physics.image_noise
    noisy = grey + np.sqrt(sigma ** 2 + gain * grey) * random.standard_normal(grey.shape)
    return np.clip(np.floor(noisy + 0.5), 0, 255).astype(np.uint8)
