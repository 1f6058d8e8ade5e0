"""Touches and photographs of one session: the folder of an image set with a touches.csv beside, the same thing hidden in
both, or in one. Contact of a point finger by brute force over triangles; shares no code with the product.
"""
import copy
import dataclasses
from typing import Optional

import cv2
import numpy as np

import photograph
import sets
import solids

SPACING_MM, STANDOFF_MM, SPEED_MM_S = 30.0, 60.0, 20.0
SIGMA_US = 3000.0


class Rotated(solids.Solid):
    """The solid as it lies; light is placed round where the model has it."""

    nominal: Optional[solids.Solid] = None

    @property
    def centre(self):
        return self.nominal.centre

    @property
    def radius(self):
        return self.nominal.radius


def moved(solid, translation_mm=(0, 0, 0), rotation_deg=(0, 0, 0)):
    """Turned about the mesh's origin, then moved (DESIGN, section 5: object_pose)."""
    turn, _ = cv2.Rodrigues(np.radians(np.asarray(rotation_deg, float)))
    rotated = Rotated(**{field.name: copy.copy(getattr(solid, field.name)) for field in dataclasses.fields(solid)})
    rotated.vertices = solid.vertices @ turn.T + np.asarray(translation_mm, float)
    rotated.normals = solid.normals @ turn.T
    rotated.nominal = solid
    return rotated


def distances(solid, starts, direction):
    """Along `direction` from each start to the first triangle that faces it; nan: none."""
    a, b, c = (solid.vertices[solid.triangles[:, corner]] for corner in range(3))
    one, two = b - a, c - a
    h = np.cross(direction, two)
    det = (one * h).sum(1)
    facing = np.flatnonzero(det > 1e-9)
    a, one, two, h, det = a[facing], one[facing], two[facing], h[facing], det[facing]
    found = []
    for start in starts:
        s = start - a
        u = (s * h).sum(1) / det
        q = np.cross(s, one)
        v = (q @ direction) / det
        t = (two * q).sum(1) / det
        hit = (u >= 0) & (v >= 0) & (u + v <= 1) & (t > 0)
        found.append(t[hit].min() if hit.any() else np.nan)
    return np.array(found)


def draw_touch(solid, random):
    """A touch along an axis of the object whose three fingers meet it, of its nominal place."""
    low, high = solid.vertices.min(0), solid.vertices.max(0)
    while True:
        axis, sign = random.integers(3), random.choice([-1.0, 1.0])
        approach = np.zeros(3)
        approach[axis] = -sign
        angle = random.uniform(0, 2 * np.pi)
        others = [k for k in range(3) if k != axis]
        lateral = np.zeros(3)
        lateral[others] = np.cos(angle), np.sin(angle)
        lateral = np.round(lateral, 6)
        target = np.round(random.uniform(low, high), 3)
        target[axis] = (high if sign > 0 else low)[axis]
        if np.isfinite(travels(solid, target, approach, lateral)).all():
            return target, approach, lateral


def travels(solid, target, approach, lateral, yaw_deg=0.0, length_mm=(0, 0, 0)):
    """Of the fingers l, m, r. tool_yaw: the lateral vector turned about the approach; finger_length: added."""
    if yaw_deg:
        turn, _ = cv2.Rodrigues(np.radians(yaw_deg) * approach)
        lateral = turn @ lateral
    starts = [target - STANDOFF_MM * approach + x * SPACING_MM * lateral for x in (-1, 0, 1)]
    return distances(solid, starts, approach) + np.asarray(length_mm, float)


HEADER = ("touch,object,speed_mm_s,standoff_mm,target_x_mm,target_y_mm,target_z_mm,approach_x,approach_y,approach_z,"
          "lateral_x,lateral_y,lateral_z,t_l_us,t_m_us,t_r_us,session_time_s,round")


def write_touches(path, seed, pose=None, yaw_deg=0.0, length_mm=(0, 0, 0), poses=16, rounds=3, objects=None):
    """`pose`: of the objects, as keyword arguments of moved(). `objects`: numbers of sets.objects(); all by default."""
    random, noise = sets.stream(seed, "touches"), sets.stream(seed, "noise of touches")
    lines, number = [HEADER], 0
    for solid in [sets.objects()[k] for k in objects or range(len(sets.objects()))]:
        real = moved(solid, **(pose or {}))
        commands = [draw_touch(solid, random) for _ in range(poses)]
        for round_ in range(rounds):
            for target, approach, lateral in commands:
                times = travels(real, target, approach, lateral, yaw_deg, length_mm) / SPEED_MM_S * 1e6
                times += SIGMA_US * noise.standard_normal(3)
                times -= np.nanmin(times)
                cells = ["" if np.isnan(t) else f"{t:.1f}" for t in times]
                vectors = [f"{x:.9g}" for vector in (target, approach, lateral) for x in vector]
                lines.append(",".join([str(number), solid.name, f"{SPEED_MM_S:g}", f"{STANDOFF_MM:g}", *vectors, *cells,
                                       "%g" % (9 * number), str(round_)]))
                number += 1
    path.write_text("\n".join(lines) + "\n")


def write_photographs(folder, seed, pose=None, pictures=6, repeats=1, objects=None, camera=None):
    """The folder of an image set of the same objects, lying like this."""
    scene = sets.make_scene(seed, pictures=pictures, repeats=repeats)
    scene.camera = camera or scene.camera
    scene.shots = [shot for shot in scene.shots if objects is None or shot.object in objects]
    nominal = sets.objects()
    physics = sets.make_physics({})
    random = sets.stream(seed, "noise")
    lying = [moved(solid, **(pose or {})) for solid in nominal]
    rows, taken = [], []
    for number, shot in enumerate(scene.shots):
        grey = photograph.expected(lying[shot.object], shot.pose, scene.camera, physics)
        grey = grey[0] if isinstance(grey, tuple) else grey
        taken.append(photograph.with_noise(grey, physics, random))
        rows.append({"image": number, "file": f"{number:04d}.png", "object": nominal[shot.object].name,
                     "eye": shot.pose.eye, "at": shot.pose.at, "up": shot.pose.up,
                     "session_time_s": shot.session_time_s, "round": shot.round})
    sets.write_set(sets.Files(rows, taken, scene.camera, sets.Truth("joint", seed)), folder)


def write_model(path):
    path.write_text("touchstone: model/1\nname: nominal\nend_effector: {fingers: 3, spacing_mm: 30}\neffects:\n"
                    f"  - gaussian_noise: {{sigma_us: {SIGMA_US:g}}}\n"
                    f"  - image_noise: {{sigma_grey: {sets.NOMINAL_NOISE[0]:g}, gain: 0}}\n")
