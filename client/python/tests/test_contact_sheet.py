"""The demo's sheet of touches: contacts lie in the photographs where the surface is, and no bar is cut off unmarked."""

import pathlib
import sys

import numpy as np
import pytest

import touchstone

pytest.importorskip("PIL", reason="Pillow is not installed; the demo draws with it.")
sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "training"))

import pictures

PLAN = touchstone.sphere(step_angle_deg=1, roll_step_deg=1, radius_ratio=2.4)


def test_contacts_lie_where_the_camera_sees_the_surface(client):
    size = 400
    image = touchstone.image(size, size, depth=True)
    batch = client.samples(["lat00", "lat20"], PLAN, samples=60, seed=3, image=image,
                           columns=("pose", "contact", "image"))[:]
    places = pictures._seen_by_the_camera(batch, image.vertical_fov_deg)
    ways = batch["contact_point_mm"] - (batch["target_mm"] - batch["standoff_mm"].reshape(-1, 1) * batch["approach"])[:, None]
    depth_mm = (ways * batch["approach"][:, None]).sum(-1)
    seen, hidden = 0, 0
    for sample in range(60):
        for finger in range(3):
            column, row = (places[sample, finger] * size).astype(int)
            before = batch["depth_mm"][sample, row, column]
            # A finger's own way is not the camera's: something may stand before its contact, nothing is behind it.
            assert before < depth_mm[sample, finger] + 2
            seen += abs(before - depth_mm[sample, finger]) < 2
            hidden += before <= depth_mm[sample, finger] - 2
    assert seen > 160 and hidden < 20


def test_the_sheet_is_drawn(client, tmp_path):
    path = pictures.contact_sheet(client, ["lat00", "lat20"], PLAN, 1, tmp_path / "samples.png", columns=3)
    from PIL import Image

    drawn = np.asarray(Image.open(path).convert("RGB")).reshape(-1, 3).astype(int)
    for colour in pictures._FINGERS:
        wanted = [int(colour[k:k + 2], 16) for k in (1, 3, 5)]
        assert (np.abs(drawn - wanted).max(1) < 12).sum() > 100, colour
