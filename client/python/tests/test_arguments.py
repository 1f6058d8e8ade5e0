"""Mistakes that are found before anything is sent."""

import inspect
from typing import Any

import numpy as np
import pytest

import touchstone
from touchstone import InvalidRequest, arguments
from touchstone.connection import parse_targets
from touchstone.diagnosis import Diagnosis
from touchstone.models import model_ref
from touchstone.specification import specification

ONE = {"target_mm": (0, 0, 0), "approach": (0, 0, -1), "lateral": (1, 0, 0), "standoff_mm": 120}


@pytest.mark.parametrize("arguments, says", [
    (dict(objects=[]), "objects is"),
    (dict(objects=["a"], plan="sphere"), "plan is 'sphere'; give touchstone.sphere"),
    (dict(objects=["a"]), "samples is missing"),
    (dict(objects=["a"], samples=0), "samples is 0"),
    (dict(objects=["a"], samples=1, seed=-1), "seed is -1"),
    (dict(objects=["a"], samples=1, seed=1.5), "seed is 1.5, not a whole number"),
    (dict(objects=["a"], samples=1, speed_mm_s=0), "speed_mm_s is 0"),
    (dict(objects=["a"], samples=1, speed_mm_s=float("nan")), "speed_mm_s is nan"),
    (dict(objects=["a"], plan=touchstone.touches([ONE]), speed_mm_s=10), "carry their own"),
    (dict(objects=["a"], samples=1, columns=["descriptor"], image=touchstone.image()), 'add "image"'),
    (dict(objects=["a"], samples=1, model="no/such.yaml"), "no/such.yaml: No such file"),
])
def test_a_mistake_names_the_argument(arguments, says):
    with pytest.raises(InvalidRequest, match=says):
        specification(**arguments)


WRONGLY: Any = touchstone  # what no type checker would let through


@pytest.mark.parametrize("make, says", [
    (lambda: WRONGLY.sphere(step_angle_deg=0), "step_angle_deg is 0; it must be above 0"),
    (lambda: WRONGLY.sphere(step_angle_deg="5"), "step_angle_deg is '5'; a number was expected"),
    (lambda: WRONGLY.faces(max_incidence_deg=0), "max_incidence_deg is 0"),
    (lambda: WRONGLY.faces(samples_per_face=2.5), "samples_per_face is 2.5; a whole number was expected"),
    (lambda: WRONGLY.image(encoding="pgn"), 'Did you mean "png"'),
    (lambda: WRONGLY.image(format="bmp"), """image format is 'bmp'; it must be "grey" or "rgb\""""),
    (lambda: WRONGLY.image(width=0), "image width is 0"),
    (lambda: WRONGLY.Camera(eye_mm=None), "eye_mm is None; a list of numbers was expected"),
    (lambda: WRONGLY.touch_id("monday", None, 1), "object is None; text was expected"),
    (lambda: WRONGLY.read_plan(["a.csv"]), r"path is \['a.csv'\]; text or a path was expected"),
    (lambda: WRONGLY.connect("127.0.0.1:1", timeout_s=0), "timeout_s is 0; it must be above 0"),
    (lambda: WRONGLY.connect("127.0.0.1:1", retry_for_s=-1), "retry_for_s is -1; it must be 0 or more"),
    (lambda: WRONGLY.connect("127.0.0.1:1", token=5), "token is 5; text was expected"),
    (lambda: WRONGLY.connect("http://host:1"), 'Target "http://host:1" is not "host:port"; say for instance "host:1"'),
    (lambda: WRONGLY.connect("host:70000"), "the port from 1 to 65535"),
])
def test_a_mistake_is_found_where_it_is_made(make, says):
    with pytest.raises(InvalidRequest, match=says):
        make()


CLIENT: Any = touchstone.Client("127.0.0.1:1")  # where nothing answers: no call gets so far


@pytest.mark.parametrize("call, says", [
    (lambda: CLIENT.touch(["lat20"], touchstone.touches([ONE])), r"object is \['lat20'\]; text was expected"),
    (lambda: CLIENT.touch("lat20", touchstone.touches([ONE]), ids="a"), "ids is 'a'; a list of texts was expected"),
    (lambda: CLIENT.touch("lat20", [ONE]), "touches is .*; Touches were expected, as touches"),
    (lambda: CLIENT.dataset(None, samples=1), "objects is None; text or a list of texts was expected"),
    (lambda: CLIENT.dataset("a", samples=100, start=50, stop=20), "start is 50 and stop is 20"),
    (lambda: CLIENT.dataset("a", samples=1, uncertainty=5), "uncertainty is 5; a Report of client.diagnose"),
    (lambda: CLIENT.plan(WRONGLY.faces(2, 1), "a", count=100), "count is 100, and the plan has 12 touches"),
    (lambda: CLIENT.plan(WRONGLY.faces(2, 1), "a", start=12), "start is 12, and the plan ends with touch 11"),
    (lambda: CLIENT.capture("a", None), "views is None; Touches, a touchstone.Camera"),
    (lambda: CLIENT.diagnose(5), "measurements is 5; a measurement file"),
    (lambda: CLIENT.diagnose("a.csv", meshes={"a": 5}), "meshes is .*; a folder of mesh files"),
    (lambda: CLIENT.diagnose("a.csv", on_progress=5), "on_progress is 5; a function was expected"),
    (lambda: CLIENT.dataset("a", samples=1, uncertainty="nope.json"), "nope.json: No such file .*client.diagnose"),
    (lambda: CLIENT.describe(timeout_s=-1), "timeout_s is -1; it must be above 0"),
    (lambda: CLIENT.lease(take="yes"), "take is 'yes'; True or False was expected"),
    (lambda: CLIENT.rig.groups([1]), r"rows is \[1\]; a list of Row was expected"),
])
def test_an_argument_of_a_wrong_kind_is_named_before_anything_is_sent(call, says):
    with pytest.raises(InvalidRequest, match=says):
        call()


# Annotations that say more than a type: what has them is checked where it is used, as the tests above find.
CHECKED_WHERE_USED = {"Targets | None", "Targets", "PlanLike | None", "PlanLike", "ModelLike", "ImageLike | None", "Any", "type",
                      "Credentials | None", "Client"}


@pytest.mark.parametrize("of", [touchstone.connect, touchstone.sphere, touchstone.faces, touchstone.touches, touchstone.image,
                                touchstone.box_touches, touchstone.read_plan, touchstone.write_measurements, touchstone.touch_id,
                                touchstone.Client, Diagnosis, touchstone.Session, touchstone.Rig, touchstone.Camera,
                                touchstone.Mesh, touchstone.Permutation])
def test_every_argument_of_a_public_call_is_checked(of):
    members = [(of.__name__, of)] if inspect.isfunction(of) else [
        (name, member) for name, member in vars(of).items() if inspect.isfunction(member) and (name == "__init__" or name[0] != "_")]
    for name, member in members:
        if name == "to_view":
            continue
        assert hasattr(member, "__wrapped__"), f"{name} is not @arguments.checked"
        for argument in inspect.signature(member).parameters.values():
            if argument.name == "self" or argument.kind in (argument.VAR_KEYWORD, argument.VAR_POSITIONAL):
                continue
            known = argument.annotation in CHECKED_WHERE_USED
            assert known or arguments._check_of(argument.annotation, inspect.unwrap(member).__globals__), f"{name}({argument})"


def test_a_key_is_no_certificate(tmp_path):
    (tmp_path / "key.pem").write_text("-----BEGIN PRIVATE KEY-----\nMIIB\n-----END PRIVATE KEY-----\n")
    with pytest.raises(InvalidRequest, match=r"ca='.*key.pem': .* holds a private key; a PEM file that begins with -----BEGIN CERTIFICATE"):
        touchstone.connect("127.0.0.1:1", ca=tmp_path / "key.pem")


def test_a_warning_is_shown_at_the_line_that_called():
    with pytest.warns(UserWarning, match="samples_per_face") as warned:
        CLIENT.dataset(["a", "b"], touchstone.faces(8, 1), samples=12)
    assert warned[0].filename == __file__


@pytest.mark.parametrize("image", [(64, 48), [64, 48], touchstone.image(64, 48)])
def test_an_image_may_be_given_by_its_size(image):
    spec = specification(["a"], samples=1, image=image)
    assert (spec.image.width, spec.image.height) == (64, 48)
    assert list(spec.columns) == ["descriptor", "object", "image"]


def test_one_number_is_a_square_image():
    spec = specification(["a"], samples=1, image=32)
    assert (spec.image.width, spec.image.height) == (32, 32)


@pytest.mark.parametrize("image", ["64x64", (64,), (64, 64, 3), True, 1.5])
def test_what_is_no_image_is_refused_with_what_would_be_right(image):
    with pytest.raises(InvalidRequest, match=r"image is .*; give touchstone.image\(width=64, height=64\), or \(64, 64\)"):
        specification(["a"], samples=1, image=image)


def test_columns_may_be_asked_for_by_the_names_that_come_back():
    spec = specification(["a"], samples=1, columns=["descriptor_us", "index", "contact_time_us", "target_mm", "approach",
                                                    "contact_point_mm", "normal", "depth_mm", "mask"])
    assert list(spec.columns) == ["descriptor", "index", "contact_time", "pose", "contact", "image"]
    assert spec.image.depth and spec.image.mask
    assert list(specification(["a"], samples=1, columns="descriptor_s").columns) == ["descriptor"]


def test_units_go_to_the_wire_as_si():
    spec = specification(["a"], touchstone.faces(2, 3, max_tilt_deg=45, standoff_mm=60), speed_mm_s=20)
    assert spec.plan.speed_m_s == 0.02 and spec.plan.faces.standoff_m == 0.06
    assert spec.plan.faces.max_tilt_rad == pytest.approx(np.pi / 4)
    assert spec.plan.faces.max_incidence_rad == pytest.approx(np.pi / 3)
    assert spec.plan.faces.stroke_beyond_target_m == 0.03
    assert spec.samples == 6 * 2 * 3


def test_touches_are_rows_or_columns():
    rows = touchstone.touches([ONE, {**ONE, "standoff_mm": 100}])
    columns = touchstone.touches(target_mm=np.zeros((2, 3)), approach=(0, 0, -1), lateral=(1, 0, 0),
                                 standoff_mm=[120, 100])
    assert rows.to_proto() == columns.to_proto()
    assert rows.to_messages()[1].standoff_m == 0.1 and rows.to_messages()[0].speed_m_s == 0.02
    assert len(rows[1]) == 1 and rows[1].standoff_mm[0] == 100 and len(rows[-1]) == 1
    assert touchstone.Touches.from_messages(rows.to_messages()).to_proto() == rows.to_proto()
    with_more = touchstone.touches([{**ONE, "stroke_mm": 50, "cov_humidity": 0.3}])
    assert with_more.to_messages()[0].covariates["cov_humidity"] == 0.3
    assert with_more.to_messages()[0].stroke_m == 0.05


@pytest.mark.parametrize("arguments, says", [
    (dict(rows=[]), "empty"),
    (dict(rows=[ONE, {"target_mm": (0, 0, 0)}]), "Touch 1"),
    (dict(target_mm=(0, 0, 0)), "needs approach"),
    (dict(**ONE, aproach=1), 'Did you mean "approach"'),
    (dict(**{**ONE, "approach": (0, 1)}), "approach has shape"),
    (dict(**{**ONE, "standoff_mm": [1, 2, 3], "target_mm": [[0, 0, 0]] * 2}), "has 2 rows"),
    (dict(**{**ONE, "standoff_mm": float("nan")}), "standoff_mm is not finite in row 0"),
])
def test_a_malformed_touch_is_named(arguments, says):
    with pytest.raises(InvalidRequest, match=says):
        touchstone.touches(**arguments)


def test_a_model_is_a_name_a_hash_a_file_or_its_text(tmp_path):
    path = tmp_path / "m.yaml"
    path.write_text("touchstone: model/1\n")
    assert model_ref(None).WhichOneof("ref") is None
    assert model_ref("nominal").name == "nominal"
    assert model_ref("deadbeef00").hash == "deadbeef00"
    assert model_ref(path).yaml == model_ref(str(path)).yaml == "touchstone: model/1\n"
    assert model_ref("touchstone: model/1\nname: a\n").yaml.startswith("touchstone")


def test_a_port_alone_is_no_target():
    with pytest.raises(InvalidRequest, match=r'targets is 50051; "host:port" was expected, for instance "127.0.0.1:50051"'):
        touchstone.connect(50051)  # type: ignore[arg-type]
    with pytest.raises(InvalidRequest, match=r'targets is 1.5; .*"127.0.0.1:50051"'):
        touchstone.Client(1.5)  # type: ignore[arg-type]


def test_a_number_is_no_plan():
    with pytest.raises(InvalidRequest, match=r"plan is 20001; give touchstone.sphere\(...\), faces\(...\) or touches"):
        touchstone.Client("127.0.0.1:1").plan(20001)  # type: ignore[arg-type]


def test_clients_and_datasets_say_what_they_are():
    client = touchstone.Client("127.0.0.1:1,127.0.0.1:2")
    assert repr(client) == "Client(127.0.0.1:1, 127.0.0.1:2)"
    dataset = client.dataset(["lat20", "cup"], samples=10_000, columns=["descriptor", "object"], batch_size=4096)
    assert repr(dataset) == "Dataset(10000 samples of lat20, cup; descriptor, object; 3 batches of 4096)"
    part = client.dataset("lat20", samples=10_000, start=100, stop=200, batch_size=50, columns="descriptor")
    assert repr(part) == "Dataset(10000 samples of lat20, 100 to 200; descriptor; 2 batches of 50)"


def test_pictures_of_a_dataset_are_taken_from_where_the_object_shows():
    def ratio(**arguments):
        return specification(["a"], samples=1, **arguments).plan.sphere.radius_ratio

    assert ratio() == 1.05
    assert ratio(image=(64, 64)) == ratio(columns="image") == 2.4
    assert ratio(image=(64, 64), plan=touchstone.sphere(step_angle_deg=5)) == 2.4
    assert ratio(image=(64, 64), plan=touchstone.sphere(radius_ratio=1.05)) == 1.05


def test_targets_are_checked():
    assert parse_targets("a:1, b:2") == ("a:1", "b:2") == parse_targets(["a:1", "b:2"])
    for bad in ("localhost", "host:", ":1", "host:0", "host:99999", ""):
        with pytest.raises(InvalidRequest, match="host:port"):
            parse_targets(bad)


def test_a_model_takes_its_surface_map_along(tmp_path):
    (tmp_path / "map.csv").write_text("object,x_mm\nlat00,1\n")
    path = tmp_path / "model.yaml"
    path.write_text("effects:\n  - surface_map: {file: map.csv}\n  - tip_radius: {radius_mm: 1}\n")
    assert model_ref(path).yaml == (
        "effects:\n  - surface_map:\n      file: map.csv\n      csv: |\n          object,x_mm\n          lat00,1\n"
        "  - tip_radius: {radius_mm: 1}\n")
    (tmp_path / "map.csv").unlink()
    with pytest.raises(InvalidRequest, match=r"map\.csv"):
        model_ref(path)
