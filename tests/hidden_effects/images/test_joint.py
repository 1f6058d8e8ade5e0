"""Touches and photographs of one session, by generators that share no code with the product, in one diagnosis."""
import json
import os
import pathlib
import subprocess

import numpy as np
import pytest

pytest.importorskip("cv2", reason="opencv-python-headless is not installed (deploy/python-packages.txt)")

import joint
import photograph
import sets

PROGRAM = pathlib.Path(os.environ.get("TOUCHSTONE_SERVER_PROGRAM", sets.ROOT / "build/release/bin/touchstone-server")).parent / \
    "touchstone"
SEED = 1_950_000
POSE = {"translation_mm": (0.5, -0.3, 0.2), "rotation_deg": (0.2, -0.3, 0.4)}

pytestmark = pytest.mark.skipif(not PROGRAM.exists(), reason=f"{PROGRAM} is not built")


trial = pytest.mark.second_tier("statistical: trials of hidden effects in touches and photographs")


def run(folder, command, model, out):
    subprocess.run([PROGRAM, command, folder / "set", "--model", folder / model, "--mesh-dir", folder / "meshes", "--json",
                    folder / out, *(["--save-model", folder / "better.yaml"] if command == "diagnose" else [])],
                   check=True, capture_output=True, timeout=300)
    return json.loads((folder / out).read_text())


# Two objects and small pictures: seconds.
OBJECTS = (0, 3)
CAMERA = photograph.Camera(112, 112, *2 * (56 / np.tan(np.radians(22.5)),), 56.0, 56.0)


def diagnosed(folder, pose_of_touches=None, pose_of_photographs=None, yaw_deg=0.0):
    joint.write_photographs(folder / "set", SEED, pose_of_photographs, pictures=7, objects=OBJECTS, camera=CAMERA)
    joint.write_touches(folder / "set/touches.csv", SEED, pose_of_touches, yaw_deg, objects=OBJECTS)
    joint.write_model(folder / "nominal.yaml")
    sets.write_meshes(folder / "meshes")
    return run(folder, "diagnose", "nominal.yaml", "report.json")


def effects(report):
    return [(step["effect"], step["shown_by"]) for step in report["steps"]]


@trial
def test_objects_that_lie_rotated_are_found_by_both_and_tighter_than_by_either(tmp_path):
    report = diagnosed(tmp_path, POSE, POSE)
    assert effects(report) == [("object_pose", ["TOUCHES", "PHOTOGRAPHS"])], report["summary"]
    truth = [*POSE["translation_mm"], *POSE["rotation_deg"]]
    for value, true in zip(report["steps"][0]["parameters"], truth):
        assert abs(value["value"] - true) < 4 * value["std_error"], value
        assert len(value["alone"]) == 2 and value["std_error"] < min(each["std_error"] for each in value["alone"]), value
    found = run(tmp_path, "compare", "better.yaml", "compared.json")
    assert [(data["kind"], data["unit"]) for data in report["data"]] == [("TOUCHES", "us"), ("PHOTOGRAPHS", "grey")]
    for promised, compared in zip(report["data"], found["data"]):
        assert promised["final"]["rmse"] == pytest.approx(compared["initial"]["rmse"], rel=1e-3)
    assert report["data"][0]["final"]["rmse"] < 1.1 * joint.SIGMA_US


def test_a_tool_is_not_told_as_the_pose_of_objects(tmp_path):
    report = diagnosed(tmp_path, yaw_deg=1.0)
    assert effects(report) == [("tool_yaw", ["TOUCHES"])], report["summary"]


@trial
def test_objects_moved_between_touching_and_photographing_are_a_contradiction(tmp_path):
    report = diagnosed(tmp_path, {"translation_mm": (0.5, 0, 0)}, {"translation_mm": (0, 0.5, 0)})
    assert report["verdict"] == "UNEXPLAINED" and not report["steps"], report["summary"]
    for data in report["data"]:
        assert "contradict" in data["unexplained"]["words"]
