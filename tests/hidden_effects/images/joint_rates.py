#!/usr/bin/env python3
"""Objects put down rotated, touched and photographed, over seeds: does a joint diagnosis name it, is it tighter than either
part, do its intervals cover the truth, and is what only touches show (a turned tool) told as shown by touches alone?

    build/venv/bin/python tests/hidden_effects/images/joint_rates.py --seeds 12 --minutes 5

Each set is that of test_joint.py: two objects, 7 pictures of 112 x 112 and 48 touches of each, the same noise. Seeds are
its own; nothing was tuned on them.
"""
import argparse
import json
import pathlib
import subprocess
import tempfile
import time

import numpy as np

import joint
import photograph
import sets

FIRST_SEED = 1_960_000
OBJECTS = (0, 3)
CAMERA = photograph.Camera(112, 112, *2 * (56 / np.tan(np.radians(22.5)),), 56.0, 56.0)
Z = 1.959964  # of a 95 % interval


def diagnosed(program, seed, pose=None, yaw_deg=0.0):
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        joint.write_photographs(folder / "set", seed, pose, pictures=7, objects=OBJECTS, camera=CAMERA)
        joint.write_touches(folder / "set/touches.csv", seed, pose, yaw_deg, objects=OBJECTS)
        joint.write_model(folder / "nominal.yaml")
        sets.write_meshes(folder / "meshes")
        subprocess.run([program, "diagnose", folder / "set", "--model", folder / "nominal.yaml", "--mesh-dir",
                        folder / "meshes", "--json", folder / "report.json"], check=True, capture_output=True,
                       timeout=300)
        return json.loads((folder / "report.json").read_text())


def draw_pose(seed):
    """A tenth of a millimetre to one, a twentieth of a degree to one, per axis, of either sign."""
    random = sets.stream(seed, "askew")
    sign = random.choice([-1.0, 1.0], 6)
    translation = sign[:3] * np.exp(random.uniform(np.log(0.1), np.log(1.0), 3))
    rotation = sign[3:] * np.exp(random.uniform(np.log(0.05), np.log(1.0), 3))
    return {"translation_mm": tuple(translation), "rotation_deg": tuple(rotation)}


def steps(report):
    return [(step["effect"], step["shown_by"]) for step in report["steps"]]


def marks(program, seed):
    pose = draw_pose(seed)
    rotated = diagnosed(program, seed, pose)
    turned = diagnosed(program, seed, yaw_deg=1.0)
    row = {"seed": seed, "rotated": steps(rotated), "turned": steps(turned), "values": []}
    if row["rotated"] == [("object_pose", ["TOUCHES", "PHOTOGRAPHS"])]:
        truth = [*pose["translation_mm"], *pose["rotation_deg"]]
        row["values"] = [{"off": v["value"] - true, "std_error": v["std_error"],
                          "alone": [each["std_error"] for each in v["alone"]]}
            for v, true in zip(rotated["steps"][0]["parameters"], truth)]
    return row


def main():
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--program", default=sets.ROOT / "build/release/bin/touchstone")
    options.add_argument("--seeds", type=int, default=12)
    options.add_argument("--minutes", type=float, default=60, help="begin no further seed after this")
    given = options.parse_args()
    began, rows = time.monotonic(), []
    for seed in range(FIRST_SEED, FIRST_SEED + given.seeds):
        if time.monotonic() - began > 60 * given.minutes:
            break
        rows.append(marks(given.program, seed))
        print(json.dumps(rows[-1]), flush=True)
    values = [v for row in rows for v in row["values"]]
    either = [min(v["alone"]) / v["std_error"] for v in values]
    print(f"{len(rows)} seeds of {given.seeds}")
    print("rotated named object_pose alone, shown by both:", sum(bool(row["values"]) for row in rows))
    print("turned tool named tool_yaw alone, shown by touches:",
          sum(row["turned"] == [("tool_yaw", ["TOUCHES"])] for row in rows))
    if values:
        print(f"values {len(values)}; tighter than the better of either: {sum(x > 1 for x in either)}; "
              f"better / joint standard error: least {min(either):.3f}, median {np.median(either):.3f}, "
              f"most {max(either):.3f}")
        print("95 % intervals that cover:", sum(abs(v["off"]) <= Z * v["std_error"] for v in values), "of", len(values))


if __name__ == "__main__":
    main()
