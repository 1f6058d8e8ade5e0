"""Image sets: who is photographed from where, with which physics; written as the folder that a lab would have, and the
truth beside it, where the diagnosis does not look.
"""
import dataclasses
import functools
import json
import pathlib
import zlib

import cv2
import numpy as np

import photograph
import solids

ROOT = pathlib.Path(__file__).resolve().parents[3]
NOMINAL_NOISE = (2.0, 0.0)


def stream(seed, purpose):
    """Random numbers of their own for each purpose: what is hidden changes neither poses nor noise."""
    return np.random.Generator(np.random.PCG64([seed, zlib.crc32(purpose.encode())]))


@functools.cache
def objects():
    """Five solids: two of the repository's, three that are hollow, sharp, or shade themselves."""
    return [solids.read_off(ROOT / "meshes/lat10.off"), solids.read_off(ROOT / "meshes/lat20.off"),
            solids.torus(), solids.bracket(), solids.star()]


@dataclasses.dataclass
class Shot:
    object: int
    pose: photograph.Pose
    session_time_s: float
    round: int


@dataclasses.dataclass
class Scene:
    """What is photographed, before anything is hidden."""

    seed: int
    camera: photograph.Camera
    shots: list


def draw_pose(random):
    """Directions all over the sphere, 300 to 520 mm away, the object off the picture's middle, the camera turned."""
    eye = random.standard_normal(3)
    eye *= random.uniform(300, 520) / np.linalg.norm(eye)
    at = random.uniform(-18, 18, 3)
    while True:
        up = random.standard_normal(3)
        up /= np.linalg.norm(up)
        if abs(up @ eye) < 0.9 * np.linalg.norm(eye):
            return photograph.Pose(np.round(eye, 3), np.round(at, 3), np.round(up, 5))


def make_scene(seed, pictures=20, repeats=None):
    """Objects x `pictures`; of them `repeats` are second pictures from the pose of an earlier one. By default every other
    seed has five, the others none."""
    if repeats is None:
        repeats = 5 if seed % 2 == 0 else 0
    random = stream(seed, "poses")
    shots: list[Shot] = []
    for number in range(len(objects())):
        poses = [draw_pose(random) for _ in range(pictures - repeats)]
        again = random.choice(len(poses), repeats, replace=False)
        rows = [(p, 0) for p in poses] + [(poses[k], 1) for k in again]
        for pose, round_ in rows:
            shots.append(Shot(number, pose, 6.0 * len(shots), round_))
    return Scene(seed, photograph.Camera(), shots)


@dataclasses.dataclass
class Truth:
    """What is hidden: `effects` by name with their values in the units of files; `unlisted` and `data_error` by name."""

    arm: str
    seed: int
    strength: str = ""
    effects: dict = dataclasses.field(default_factory=dict)
    unlisted: str = ""
    data_error: str = ""
    noise: tuple = NOMINAL_NOISE
    floor_grey: float = 0
    notes: dict = dataclasses.field(default_factory=dict)


def make_physics(effects, noise=NOMINAL_NOISE, **others):
    return photograph.Physics(**effects, image_noise=noise, **others)


class Photographer:
    """Takes the pictures of a scene; keeps what the pixels see where the camera is the same."""

    GEOMETRY = ("camera_translation", "camera_rotation", "focal_error", "principal_point", "radial_distortion",
                "shutter_px")

    def __init__(self, scene):
        self.scene = scene
        self._seen = {}

    def take(self, number, physics):
        """Grey levels without noise, and the mask."""
        shot = self.scene.shots[number]
        solid, camera = objects()[shot.object], self.scene.camera
        key = (number, *(tuple(np.ravel(getattr(physics, name))) for name in self.GEOMETRY))
        plain = not any(np.any(np.asarray(getattr(physics, name)) != 0) for name in self.GEOMETRY)
        seen = self._seen.get(key)
        if seen is None:
            seen = photograph.see(solid, shot.pose, camera, physics)
            if plain:  # the others are looked at once
                self._seen[key] = seen
        mask = np.zeros(camera.width * camera.height, bool)
        mask[seen.pixel] = True
        light = photograph.lit(solid, seen, camera, physics)
        return photograph.record(light, camera, physics), mask.reshape(camera.height, camera.width)


HEADER = ("image,file,object,eye_x_mm,eye_y_mm,eye_z_mm,at_x_mm,at_y_mm,at_z_mm,up_x,up_y,up_z,session_time_s,round")


@dataclasses.dataclass
class Files:
    """A set before it is written, for mistakes to be made in."""

    rows: list  # of dicts by column of HEADER
    pictures: list  # height x width, or x 3 in the order red, green, blue
    camera: photograph.Camera
    truth: Truth


def make_files(scene, truth, physics_of):
    """physics_of(number): what acts on that picture."""
    photographer = Photographer(scene)
    random = stream(scene.seed, "noise")
    rows, pictures, variance, count = [], [], 0.0, 0
    for number, shot in enumerate(scene.shots):
        physics = physics_of(number)
        grey, _ = photographer.take(number, physics)
        pictures.append(photograph.with_noise(grey, physics, random))
        # What noise and rounding leave of a picture that is known exactly; black and white clip it.
        variance += float(((pictures[-1] - grey) ** 2).sum())
        count += grey.size
        rows.append({"image": number, "file": f"{number:04d}.png", "object": objects()[shot.object].name,
                     "eye": shot.pose.eye, "at": shot.pose.at, "up": shot.pose.up,
                     "session_time_s": shot.session_time_s, "round": shot.round})
    truth.floor_grey = float(np.sqrt(variance / count))
    return Files(rows, pictures, scene.camera, truth)


def write_set(files, folder):
    """images.csv, camera.yaml and the pictures in `folder`; meshes, the nominal model and the truth beside it."""
    folder = pathlib.Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    lines = [HEADER]
    for row in files.rows:
        numbers = [f"{x:.6g}" for part in ("eye", "at", "up") for x in row[part]]
        lines.append(",".join([str(row["image"]), row["file"], row["object"], *numbers,
                               "{:g}".format(row["session_time_s"]), str(row["round"])]))
    (folder / "images.csv").write_text("\n".join(lines) + "\n")
    c = files.camera
    (folder / "camera.yaml").write_text(
        f"{{width_px: {c.width}, height_px: {c.height}, fx_px: {c.fx:.9g}, fy_px: {c.fy:.9g}, "
        f"cx_px: {c.cx:.9g}, cy_px: {c.cy:.9g}}}\n")
    for row, picture in zip(files.rows, files.pictures):
        cv2.imwrite(str(folder / row["file"]), picture[:, :, ::-1] if picture.ndim == 3 else picture)
    truth = dataclasses.asdict(files.truth)
    folder.with_suffix(".truth.json").write_text(json.dumps(truth, indent=1, default=_plain))


def _plain(value):
    return value.tolist() if hasattr(value, "tolist") else str(value)


def write_meshes(folder):
    folder = pathlib.Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    for solid in objects():
        solids.write_off(solid, folder / f"{solid.name}.off")


def write_model(path, noise=NOMINAL_NOISE):
    effects = f"\n  - image_noise: {{sigma_grey: {noise[0]:g}, gain: {noise[1]:g}}}" if noise else " []"
    pathlib.Path(path).write_text(f"touchstone: model/1\nname: nominal\neffects:{effects}\n")
