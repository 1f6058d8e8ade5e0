"""Causes that no catalogue lists. Each is given with the size that changes the pictures by `rms_sigmas` noise sigmas, in
the root mean square over the pixels of the object."""
import numpy as np

import sets

NAMES = ("dirt", "rolling_shutter", "flicker", "reflection")


def blots(camera, random):
    """Out-of-focus specks on the lens: the share of light that they take, 0 to 1, fixed in the picture."""
    column, row = np.meshgrid(np.arange(camera.width) + 0.5, np.arange(camera.height) + 0.5)
    share = np.zeros((camera.height, camera.width))
    for _ in range(random.integers(2, 6)):
        x, y = random.uniform(0.25, 0.75, 2) * [camera.width, camera.height]
        radius = random.uniform(8, 25)
        inside = np.hypot(column - x, row - y)
        share = np.maximum(share, random.uniform(0.5, 1) / (1 + np.exp((inside - radius) / 2.0)))
    return share


def mirror_image(camera, random):
    """A lamp or a window that the lens or a pane reflects: a bright patch fixed in the picture."""
    column, row = np.meshgrid(np.arange(camera.width) + 0.5, np.arange(camera.height) + 0.5)
    x, y = random.uniform(0.3, 0.7, 2) * [camera.width, camera.height]
    angle = random.uniform(0, np.pi)
    u = (column - x) * np.cos(angle) + (row - y) * np.sin(angle)
    v = -(column - x) * np.sin(angle) + (row - y) * np.cos(angle)
    size = random.uniform(12, 35, 2)
    patch = 1 / (1 + np.exp((np.abs(u) - size[0]) / 2.5)) / (1 + np.exp((np.abs(v) - size[1]) / 2.5))
    return patch / patch.max()


def physics_of(name, size, scene):
    """What acts on picture `number`, for a size of this cause."""
    random = sets.stream(scene.seed, "unlisted " + name)
    if name == "dirt":
        factor = 1 - size * blots(scene.camera, random)
        return lambda number: sets.make_physics({}, dirt=np.maximum(0, factor))
    if name == "reflection":
        light = size * mirror_image(scene.camera, random)
        return lambda number: sets.make_physics({}, reflection=light)
    if name == "flicker":
        stops = random.standard_normal(len(scene.shots))
        return lambda number: sets.make_physics({}, flicker_stops=size * stops[number])
    if name == "rolling_shutter":
        # The arm moves on while the rows are read: another way for each picture.
        ways = random.uniform(0, 2 * np.pi, len(scene.shots))
        speeds = random.uniform(0.5, 1.5, len(scene.shots))
        return lambda number: sets.make_physics(
            {}, shutter_px=(size * speeds[number] * np.cos(ways[number]), size * speeds[number] * np.sin(ways[number])))
    raise ValueError(name)


def smooth_albedo(scene, rms, length_mm):
    """Per object, a smooth random field over space: the share by which its surface is brighter; mean 0 over it."""
    fields = []
    for number, solid in enumerate(sets.objects()):
        random = sets.stream(scene.seed, f"albedo {number}")
        waves = random.standard_normal((64, 3)) / length_mm
        phases = random.uniform(0, 2 * np.pi, 64)
        weights = random.standard_normal(64)
        value = lambda p, w=waves, f=phases, a=weights: np.cos(p @ w.T + f) @ a
        sample = value(solid.vertices)
        mean, std = sample.mean(), sample.std()
        fields.append(lambda p, value=value, mean=mean, std=std: 1 + rms * (value(p) - mean) / std)
    return lambda number: sets.make_physics({}, albedo=fields[scene.shots[number].object])
