"""Photographs of an emulated rig whose lens is hidden from the model: taken, kept, exported, compared and diagnosed, as
people do it. What the emulator sees measures nothing."""
import csv
import json

import pytest

from test_rig_commands import ROOT, SPEEDUP, emulated_rig, touchstone

# The emulated rig exists once.
pytestmark = pytest.mark.xdist_group("rig_photographs")
HIDDEN_K1 = -0.2
RIM = 0.3  # of the object in the pictures, over the focal length
SIZE = (160, 120)
MESH = f"lat20={ROOT / 'meshes/lat20.off'}"


@pytest.fixture(scope="module")
def rig(tmp_path_factory):
    hidden = (f"radial_distortion.k1={HIDDEN_K1}", "background_level.grey=0", "image_noise.sigma_grey=1")
    flags = [word for effect in hidden for word in ("--hide", effect)]
    with pytest.MonkeyPatch.context() as environment:
        # A proxy that is not there: neither clients nor the gateway, nor FFmpeg, which reads the camera's stream there, may
        # ask it.
        environment.setenv("http_proxy", "http://127.0.0.1:1")
        with emulated_rig(tmp_path_factory.mktemp("rig"), SPEEDUP, "--seed", "3", "--camera-width", str(SIZE[0]),
                          "--camera-height", str(SIZE[1]), "--jpeg-quality", "100", *flags) as address:
            yield address


@pytest.fixture(scope="module")
def photos(rig, tmp_path_factory):
    folder = tmp_path_factory.mktemp("photos") / "set"
    touchstone("rig", "photos", "lat20", "-o", folder, "--turns", "1", "--image", "x".join(map(str, SIZE)), server=rig)
    return folder


@pytest.fixture(scope="module")
def model(tmp_path_factory):
    path = tmp_path_factory.mktemp("model") / "nominal.yaml"
    touchstone("model", "new", "-o", path)
    return path


def report(command, folder, model, tmp_path):
    file = tmp_path / "report.json"
    touchstone(command, folder, "--model", model, "--mesh", MESH, "--json", file, "--force")
    return json.loads(file.read_text())


def test_rig_photos_can_be_compared_as_they_stand_and_say_that_they_are_emulated(photos, model, tmp_path):
    result = report("compare", photos, model, tmp_path)
    with open(photos / "images.csv", newline="") as file:
        rows = list(csv.DictReader(file))
    data, = result["data"]
    assert data["count"] == len(rows) >= 6 and data["emulated"]
    assert all(row["cov_emulated"] == "1" and row["round"] == "0" and row["measured_eye_x_mm"] for row in rows)
    assert 1 < data["initial"]["rmse"] < 100
    assert any("emulated" in warning for warning in result["warnings"])


def test_a_diagnosis_of_what_the_gateway_kept_names_the_hidden_lens(rig, photos, model, tmp_path):
    # Pictures name no session: the gateway keeps them in this one.
    touchstone("session", "export", "default", "-o", tmp_path / "kept", server=rig)
    result = report("diagnose", tmp_path / "kept", model, tmp_path)
    steps = {step["effect"]: step for step in result["steps"]}
    assert "radial_distortion" in steps, result["summary"]
    found = {each["name"]: each["value"] for each in steps["radial_distortion"]["parameters"]}
    # k1 and k2 stand in for each other on so small an object: what counts is the shift that they make at its rim.
    assert abs(found["k1"] + found["k2"] * RIM ** 2 - HIDDEN_K1) < 0.05
    data, = result["data"]
    assert data["final"]["rmse"] < 0.3 * data["initial"]["rmse"] and data["emulated"]
    # The same pictures at the same size are as wrong either way.
    straight, = report("compare", photos, model, tmp_path)["data"]
    assert abs(straight["initial"]["rmse"] - data["initial"]["rmse"]) < 0.05
    assert any("emulated" in warning for warning in result["warnings"])


def test_an_image_set_becomes_hdf5_and_a_folder_again_byte_for_byte(photos, model, tmp_path):
    touchstone("session", "export", photos, "-o", tmp_path / "set.h5")
    touchstone("session", "import", tmp_path / "set.h5", "-o", tmp_path / "again")
    names = sorted(path.name for path in photos.iterdir())
    assert names == sorted(path.name for path in (tmp_path / "again").iterdir())
    for name in names:
        assert (photos / name).read_bytes() == (tmp_path / "again" / name).read_bytes(), name
    assert report("compare", tmp_path / "set.h5", model, tmp_path)["data"][0]["initial"] == \
        report("compare", photos, model, tmp_path)["data"][0]["initial"]
