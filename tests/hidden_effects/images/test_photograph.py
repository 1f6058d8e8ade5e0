"""The second simulation of photographs against closed forms, OpenCV's camera model, brute force, and the product's renderer."""
import math
import os
import pathlib
import subprocess

import numpy as np
import pytest

cv2 = pytest.importorskip("cv2", reason="opencv-python-headless is not installed (deploy/python-packages.txt)")

import caster  # noqa: E402
import photograph  # noqa: E402
import sets  # noqa: E402
import solids  # noqa: E402

CAMERA = photograph.Camera()
BIN = pathlib.Path(os.environ.get("TOUCHSTONE_SERVER_PROGRAM", sets.ROOT / "build/release/bin/touchstone-server")).parent


def a_pose(number=0):
    random = np.random.default_rng(number)
    return sets.draw_pose(random)


def named(name):
    return next(s for s in sets.objects() if s.name == name)


@pytest.mark.parametrize("solid", sets.objects(), ids=lambda s: s.name)
def test_solids_are_closed_and_turned_outwards(solid):
    assert solids.volume(solid) > 0
    edges = np.concatenate([solid.triangles[:, [0, 1]], solid.triangles[:, [1, 2]], solid.triangles[:, [2, 0]]])
    points = np.unique(solid.vertices, axis=0, return_inverse=True)[1].reshape(-1)[edges]
    forward, count = np.unique(points, axis=0, return_counts=True)
    assert (count == 1).all()
    assert {tuple(e) for e in forward} == {(b, a) for a, b in forward}


def test_normals_keep_creases_and_smooth_the_rest():
    bracket = named("bracket")
    corners = bracket.vertices[bracket.triangles]
    face = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    face /= np.linalg.norm(face, axis=1, keepdims=True)
    assert np.allclose(bracket.normals, face[:, None], atol=1e-6)
    # Of a ball the normal is the way from its centre.
    ball = solids.make_solid("ball", *_ball(40, 24, 50.0))
    ways = ball.vertices[ball.triangles] / 50.0
    assert np.abs(np.einsum("ijk,ijk->ij", ways, ball.normals) - 1).max() < 2e-3


def _ball(rows, columns, radius):
    lon, lat = 2 * np.pi * np.arange(rows) / rows, np.pi * (np.arange(1, columns) / columns - 0.5)
    u, v = np.meshgrid(lon, lat, indexing="ij")
    points = np.stack([np.cos(u) * np.cos(v), np.sin(u) * np.cos(v), np.sin(v)], -1).reshape(-1, 3)
    points, count = np.vstack([points, [0, 0, -1], [0, 0, 1]]) * radius, columns - 1
    south, north, faces = rows * count, rows * count + 1, []
    for i in range(rows):
        a, b = i * count, (i + 1) % rows * count
        faces += [(south, b, a), (north, a + count - 1, b + count - 1)]
        for j in range(count - 1):
            faces += [(a + j, b + j, b + j + 1), (a + j, b + j + 1, a + j + 1)]
    return points, faces


@pytest.mark.parametrize("name", ["bracket", pytest.param("star", marks=pytest.mark.second_tier(
    "repeated: every triangle of another solid"))])
def test_the_grid_finds_what_trying_every_triangle_finds(name):
    solid, pose = named(name), a_pose(3)
    axes = caster.looking(pose.eye, pose.at, pose.up)
    random = np.random.default_rng(5)
    points = random.uniform(-0.3, 0.3, (300, 2))
    index, depth, _ = caster.Bundle(solid, pose.eye, axes).first(points)
    corners = (solid.vertices[solid.triangles] - pose.eye) @ axes.T
    hits = 0
    for k, (x, y) in enumerate(points):
        ray = np.array([x, y, 1.0])
        best = math.inf
        # Solve a + u e1 + v e2 = t ray for every triangle at once.
        system = np.stack([corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0],
                           np.broadcast_to(-ray, corners[:, 0].shape)], -1)
        good = np.abs(np.linalg.det(system)) > 1e-9
        u, v, t = np.linalg.solve(system[good], -corners[good, 0][..., None])[..., 0].T
        inside = (u >= 0) & (v >= 0) & (u + v <= 1) & (t > 0)
        if inside.any():
            best = t[inside].min()
        assert (index[k] == caster.NONE) == math.isinf(best)
        if index[k] != caster.NONE:
            hits += 1
            assert depth[k] == pytest.approx(best, rel=1e-9)
    assert hits > 30


def test_every_point_seen_is_projected_back_onto_its_pixel_by_opencv():
    physics = photograph.Physics(camera_translation=(3, -2, 5), camera_rotation=(0.4, -0.3, 0.8), focal_error=0.02,
                                 principal_point=(2, -3), radial_distortion=(0.2, -0.1))
    pose, solid = a_pose(1), named("lat20")
    seen = photograph.see(solid, pose, CAMERA, physics)
    # World to camera, by matrices written here: the commanded camera, moved in its own frame, then turned.
    forward = (pose.at - pose.eye) / np.linalg.norm(pose.at - pose.eye)
    right = np.cross(forward, pose.up) / np.linalg.norm(np.cross(forward, pose.up))
    commanded = np.stack([right, np.cross(forward, right), forward])
    eye = pose.eye + commanded.T @ [3, -2, 5]
    turned = cv2.Rodrigues(np.radians([0.4, -0.3, 0.8]))[0]
    to_camera = turned.T @ commanded
    lens = np.array([[CAMERA.fx * 1.02, 0, 114], [0, CAMERA.fy * 1.02, 109], [0, 0, 1.0]])
    pixels, _ = cv2.projectPoints(seen.point, cv2.Rodrigues(to_camera)[0], -to_camera @ eye, lens,
                                  np.array([0.2, -0.1, 0, 0]))
    wanted = np.stack([seen.pixel % CAMERA.width + 0.5, seen.pixel // CAMERA.width + 0.5], 1)
    assert len(wanted) > 5000
    assert np.abs(pixels.reshape(-1, 2) - wanted).max() < 1e-5


def test_signs_of_the_camera_effects():
    pose, solid = photograph.Pose(np.array([0, -400.0, 0]), np.zeros(3), np.array([0, 0, 1.0])), named("lat10")

    def middle(**effects):
        _, mask = photograph.expected(solid, pose, CAMERA, photograph.Physics(**effects))
        rows, columns = np.nonzero(mask)
        return np.array([columns.mean(), rows.mean(), mask.sum()])

    nominal = middle()
    assert (middle(principal_point=(4, 0)) - nominal)[:2] == pytest.approx([4, 0], abs=0.3)
    assert (middle(camera_translation=(10, 0, 0)) - nominal)[0] < -4  # the camera goes right, the object left
    assert (middle(camera_translation=(0, 10, 0)) - nominal)[1] < -4
    assert middle(camera_translation=(0, 0, 20))[2] > nominal[2]  # nearer
    assert (middle(camera_rotation=(0, 2, 0)) - nominal)[0] < -4  # about down: the view turns right
    assert (middle(camera_rotation=(2, 0, 0)) - nominal)[1] > 4  # about right: the view turns up
    assert middle(focal_error=0.05)[2] > nominal[2]
    assert middle(radial_distortion=(0.5, 0))[2] > nominal[2]


def flat_face():
    """The bracket's flat top, seen from above."""
    pose = photograph.Pose(np.array([10.0, 15, 400]), np.array([10.0, 15, 0]), np.array([0, 1.0, 0]))
    return named("bracket"), pose


def test_shade_of_a_flat_face_by_hand():
    solid, pose = flat_face()
    seen = photograph.see(solid, pose, CAMERA, photograph.Physics())
    top = np.flatnonzero(np.abs(seen.point[:, 2] - 40) < 1e-6)
    point = seen.point[top[0]]
    box = 0.5 * (solid.vertices.max(0) + solid.vertices.min(0))
    radius = 0.5 * np.linalg.norm(solid.vertices.max(0) - solid.vertices.min(0))
    offset = np.array([30.0, -20, 50])
    # Looking down with y up in the picture: right is +x, up +y, towards the eye +z.
    key = box + radius * np.array([-3.5, 4, 4]) + offset
    fill = box + radius * np.array([4, -1, 2.5])
    cosine = lambda light: (light - point)[2] / np.linalg.norm(light - point)
    towards = lambda other: (other - point) / np.linalg.norm(other - point)
    half = towards(key) + towards(pose.eye)
    wanted = 0.07 + 0.03 + 0.88 * cosine(key) + 0.2 * (half[2] / np.linalg.norm(half)) ** 30 + 0.26 * cosine(fill)
    physics = photograph.Physics(light_position=tuple(offset), ambient_light=0.03, specular=(0.2, 30))
    assert photograph.shade(solid, seen, physics)[top[0]] == pytest.approx(wanted, rel=1e-6)


SHADY = photograph.Pose(np.array([330.0, 180, 150]), np.zeros(3), np.array([0, 0, 1.0]))


def test_shadows_are_those_of_trying_every_triangle():
    solid, pose = named("bracket"), SHADY
    seen = photograph.see(solid, pose, CAMERA, photograph.Physics())
    key = photograph.lamp(solid, seen.axes, photograph.KEY[0])
    shadow = photograph.in_shadow(solid, seen, key)
    cosine = np.einsum("ij,ij->i", seen.normal, key - seen.point)
    lit = np.flatnonzero(cosine > 0)
    corners = solid.vertices[solid.triangles]
    meets = []
    for k in lit:
        way = key - seen.point[k]
        system = np.stack([corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0],
                           np.broadcast_to(-way, corners[:, 0].shape)], -1)
        u, v, t = np.linalg.solve(system, (seen.point[k] - corners[:, 0])[..., None])[..., 0].T
        meets.append(bool(((u >= 0) & (v >= 0) & (u + v <= 1) & (t > 1e-4) & (t < 1)).any()))
    wanted = np.array(meets)
    assert 50 < wanted.sum() < len(lit)
    assert (wanted != shadow[lit]).mean() < 0.005


def test_sensor_by_closed_forms():
    camera = photograph.Camera()
    flat = np.full((224, 224), 0.4)
    grey = lambda light, **e: photograph.record(light, camera, photograph.Physics(**e))
    assert grey(flat) == pytest.approx(102)
    assert grey(flat, exposure=1)[0, 0] == pytest.approx(204)
    assert grey(flat, exposure=2)[0, 0] == 255
    assert grey(flat, gamma=0.5)[5, 5] == pytest.approx(255 * math.sqrt(0.4))
    # Half a diagonal from the middle lies the corner; its pixel's centre is 111.5 both ways.
    corner = 1 - 0.3 * (2 * 111.5 ** 2) / (2 * 112 ** 2)
    assert grey(flat, vignetting=0.3)[0, 223] == pytest.approx(102 * corner)
    # After vignetting, before gamma.
    assert grey(flat, vignetting=0.3, gamma=2)[0, 0] == pytest.approx(255 * (0.4 * corner) ** 2)


def test_blurs_of_an_edge_by_closed_forms():
    camera = photograph.Camera()
    edge = np.zeros((224, 224))
    edge[:, 112:] = 0.5
    x = np.arange(224) - 112 + 0.5  # of pixel centres from the edge
    blurred = photograph.record(edge, camera, photograph.Physics(defocus_blur=2.0))[100]
    # The Gaussian is sampled at pixels: a pixel sums the weights of those that the edge leaves bright.
    weights = np.exp(-np.arange(-300, 301) ** 2 / 8.0) / np.exp(-np.arange(-300, 301) ** 2 / 8.0).sum()
    assert blurred == pytest.approx([127.5 * weights[:301 + int(v - 0.5)].sum() for v in x], abs=1e-3)
    moved = photograph.record(edge, camera, photograph.Physics(motion_blur=(8, 0)))[100]
    assert moved == pytest.approx(127.5 * np.clip(0.5 + x / 8, 0, 1), abs=1.1)
    along = photograph.record(edge, camera, photograph.Physics(motion_blur=(8, 90)))[100]
    assert along == pytest.approx(255 * edge[100], abs=1e-6)
    # 45 deg: up and right. A point becomes a line that rises to the right.
    point = np.zeros((224, 224))
    point[112, 112] = 1
    line = photograph.record(point, camera, photograph.Physics(motion_blur=(10, 45)))
    assert line.sum() == pytest.approx(255)
    assert line[110, 114] > 5 and line[114, 110] > 5 and line[114, 114] < 1


def test_noise_is_of_the_variance_that_is_asked():
    physics = photograph.Physics(image_noise=(3, 0.1))
    noisy = photograph.with_noise(np.full((400, 400), 100.3), physics, np.random.default_rng(1)).astype(float)
    assert noisy.mean() == pytest.approx(100.3, abs=0.05)
    assert noisy.var() == pytest.approx(9 + 10.03 + 1 / 12, rel=0.02)


@pytest.mark.parametrize("solid", sets.objects(), ids=lambda s: s.name)
def test_nominal_pictures_are_those_of_the_product(solid, tmp_path):
    """The only test that has both at hand: `touchstone capture` and this simulation, pose by pose."""
    if not (BIN / "touchstone").exists():
        pytest.skip(f"{BIN}/touchstone is not built")
    solids.write_off(solid, tmp_path / "mesh.off")
    vector = lambda v: ",".join(f"{x:.9g}" for x in v)
    for number in range(2):
        pose = a_pose(40 + number)
        out = tmp_path / f"{number}.png"
        subprocess.run([BIN / "touchstone", "capture", "thing", "--mesh", f"thing={tmp_path / 'mesh.off'}",
                        "--eye-mm=" + vector(pose.eye), "--at-mm=" + vector(pose.at), "--up=" + vector(pose.up), "--mask",
                        "--image", "224x224", "-o", out], check=True, capture_output=True)
        theirs, their_mask = cv2.imread(str(out), 0), cv2.imread(str(out.with_suffix(".mask.png")), 0) > 0
        grey, mask = photograph.expected(solid, pose, CAMERA, photograph.Physics())
        assert mask.sum() > 1000
        assert (mask != their_mask).sum() <= 4
        both = mask & their_mask
        assert np.abs(np.floor(grey + 0.5) - theirs)[both].max() <= 1
