"""The benchmark in small: `touchstone diagnose` on six sets of the tuning seeds. The whole is run by hand (run)."""
import os
import pathlib

import pytest

cv2 = pytest.importorskip("cv2", reason="opencv-python-headless is not installed (deploy/python-packages.txt)")

import data_errors  # noqa: E402
import judge  # noqa: E402
import score  # noqa: E402
import sets  # noqa: E402
import strengths  # noqa: E402

PROGRAM = pathlib.Path(os.environ.get("TOUCHSTONE_SERVER_PROGRAM", sets.ROOT / "build/release/bin/touchstone-server")).parent / \
    "touchstone"
SEED = 1_900_000  # beyond those of the arms
PICTURES = 6  # of each object: a third of the time that a whole set takes

pytestmark = pytest.mark.skipif(not PROGRAM.exists(), reason=f"{PROGRAM} is not built")


def marked(folder, effects=None, data_error="", seed=SEED):
    """The report on a set and its mark."""
    scene = sets.make_scene(seed, pictures=PICTURES, repeats=1)
    effects = {name: strengths.realistic(name, scene) for name in effects or ()}
    truth = sets.Truth("test", seed, "realistic", effects)
    files = sets.make_files(scene, truth, lambda number: sets.make_physics(effects))
    if data_error:
        data_errors.make(data_error, files, sets.stream(seed, "blunder"))
    sets.write_set(files, folder / "set")
    sets.write_meshes(folder / "meshes")
    sets.write_model(folder / "nominal.yaml")
    report, seconds, _, said = score.diagnose(PROGRAM, folder / "set", folder / "nominal.yaml", folder / "meshes",
                                              folder / "report.json")
    assert report is not None, said
    return report, judge.judge(report, vars(files.truth), seconds), files.truth


def test_nothing_is_claimed_where_nothing_is_hidden(tmp_path):
    report, mark, _ = marked(tmp_path)
    assert not mark.false_claim, (mark.verdict, mark.claims)
    data = judge.of_photographs(report)
    assert data["final"]["rmse"] == pytest.approx(data["initial"]["rmse"], rel=0.01)


trial = pytest.mark.second_tier("statistical: trials of hidden effects in photographs")


@pytest.mark.parametrize("effect", [pytest.param("focal_error", marks=trial), pytest.param("exposure", marks=trial), "vignetting"])
def test_a_hidden_effect_is_named_first_and_its_error_falls_to_the_floor(effect, tmp_path):
    report, mark, _ = marked(tmp_path, [effect])
    assert mark.right_first and not mark.confidently_wrong, (mark.verdict, mark.claims)
    data = judge.of_photographs(report)
    assert mark.over_floor < judge.OVER_FLOOR < data["initial"]["rmse"] / data["noise_floor"]
    assert all(abs(error) < 4 for error in mark.errors) and mark.errors


@pytest.mark.parametrize("data_error", ["mirrored", pytest.param("focal_factor", marks=trial)])
def test_a_mistake_in_the_files_is_found_before_any_physics(data_error, tmp_path):
    report, mark, _ = marked(tmp_path, data_error=data_error)
    assert mark.right, (mark.verdict, report["data_problems"])
    assert not report["steps"]
