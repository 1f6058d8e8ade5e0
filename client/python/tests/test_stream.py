"""Datasets from a real server: contents, parts, errors."""

import dataclasses
import os
import signal
import subprocess
import sys
import textwrap

import numpy as np
import pytest

import touchstone

OBJECTS = ["lat00", "lat20"]
PLAN = touchstone.sphere(step_angle_deg=5)


def joined(dataset, name):
    return np.concatenate([batch[name] for batch in dataset])


def test_a_source_describes_itself(client):
    description = client.describe()
    assert description.kind == "virtual" and "sphere" in description.plans and description.version
    assert description.max_batch_size >= 4096


def test_objects_have_their_size_in_millimetres(client):
    objects = {o.name: o for o in client.objects()}
    assert set(objects) >= {"lat00", "lat05", "lat10", "lat15", "lat20"}
    low, high = objects["lat20"].bounds_min_mm, objects["lat20"].bounds_max_mm
    assert high[0] - low[0] == pytest.approx(150, abs=0.5)


def test_batches_have_the_promised_shapes_and_units(client):
    dataset = client.dataset(OBJECTS, PLAN, samples=1000, seed=3, batch_size=300,
                             columns=("index", "object", "descriptor", "contact_time"))
    batches = list(dataset)
    assert [b.rows for b in batches] == [300, 300, 300, 100] and len(dataset) == 4
    assert [b.start_index for b in batches] == [0, 300, 600, 900]
    first = batches[0]
    assert first["descriptor_us"].shape == (300, 3) and first["descriptor_us"].dtype == np.float32
    assert first["object"].dtype == np.int64 and first["index"].dtype == np.uint64
    np.testing.assert_array_equal(joined(dataset, "index"), np.arange(1000))
    np.testing.assert_array_equal(joined(dataset, "object"), np.arange(1000) % 2)
    # One finger came first; the others are the same differences as in the full times.
    descriptor, times = joined(dataset, "descriptor_us"), joined(dataset, "contact_time_us")
    assert (descriptor.min(axis=1) == 0).all() and descriptor.max() > 100
    np.testing.assert_allclose(descriptor, times - times.min(axis=1, keepdims=True), atol=1.0)
    # At 20 mm/s from a start outside the object: between a tenth of a second and half a minute.
    assert 1e5 < np.median(times) < 3e7


def test_the_header_tells_what_makes_the_dataset(client):
    dataset = client.dataset(OBJECTS, PLAN, samples=10, image=touchstone.image(32, 16))
    header = dataset.header
    assert header.samples == 10 and header.fingers == 3 and header.spacing_mm == pytest.approx(30)
    assert len(header.model_hash) == 64 and set(header.mesh_hashes) == set(OBJECTS)
    assert header.columns["descriptor_us"] == (3,) and header.columns["image"] == (16, 32, 1)
    assert next(iter(dataset)).model_hash == header.model_hash


def test_samples_do_not_depend_on_how_they_are_cut(client):
    options = dict(objects=OBJECTS, plan=PLAN, samples=5000, seed=9)
    whole = joined(client.dataset(**options, batch_size=5000), "descriptor_us")
    np.testing.assert_array_equal(whole, joined(client.dataset(**options, batch_size=77), "descriptor_us"))
    part = joined(client.dataset(**options, batch_size=77, start=1234, stop=4321), "descriptor_us")
    np.testing.assert_array_equal(whole[1234:4321], part)
    si = joined(client.dataset(**options, units="si"), "descriptor_s")
    np.testing.assert_array_equal(si * np.float32(1e6), whole)
    assert not np.array_equal(whole, joined(client.dataset(**{**options, "seed": 10}), "descriptor_us"))


def test_strides_share_a_dataset_out(client):
    options = dict(objects=OBJECTS, plan=PLAN, samples=1000, seed=1, batch_size=64, columns=["index"])
    parts = [client.dataset(**options, start=64 * w, stride=3) for w in range(3)]
    assert [len(part) for part in parts] == [6, 5, 5]
    batches = sorted((b for part in parts for b in part), key=lambda b: b.start_index)
    np.testing.assert_array_equal(np.concatenate([b["index"] for b in batches]), np.arange(1000))


def test_the_pose_says_where_and_the_contact_lies_on_the_object(client):
    batch = next(iter(client.dataset(["lat20"], PLAN, samples=200, columns=("pose", "contact"))))
    np.testing.assert_allclose(np.linalg.norm(batch["approach"], axis=1), 1, atol=1e-6)
    np.testing.assert_allclose(np.sum(batch["approach"] * batch["lateral"], axis=1), 0, atol=1e-6)
    np.testing.assert_allclose(batch["speed_mm_s"], 20, rtol=1e-6)
    assert batch["contact_point_mm"].shape == (200, 3, 3) and np.abs(batch["contact_point_mm"]).max() < 76


def test_a_plan_is_the_datasets_touches(client):
    touches = client.plan(PLAN, "lat10", 50, seed=4)
    batch = next(iter(client.dataset("lat10", PLAN, samples=50, seed=4, columns=["pose"])))
    # Only touches that hit enter a dataset: others were drawn again.
    same = np.isclose(touches.target_mm, batch["target_mm"], atol=1e-3).all(axis=1)
    same &= np.isclose(touches.approach, batch["approach"], atol=1e-6).all(axis=1)
    assert same.mean() > 0.5


def test_touches_give_a_result_a_finger(client):
    touches = touchstone.touches(target_mm=(0, 0, 0), approach=(0, 0, -1), lateral=(1, 0, 0), standoff_mm=[200, 210])
    noiseless = "touchstone: model/1\nname: ideal\nend_effector: {fingers: 3, spacing_mm: 30}\neffects: []\n"
    result = client.touch("lat20", touches, model=noiseless)
    assert result.rows == 2 and result["complete"].all() and len(result.model_hash) == 64
    assert result["descriptor_us"].shape == (2, 3) and result["contact_point_mm"].shape == (2, 3, 3)
    # 10 mm farther at 20 mm/s: half a second later.
    later = result["contact_time_us"][1] - result["contact_time_us"][0]
    np.testing.assert_allclose(later, 5e5, rtol=1e-6)
    np.testing.assert_allclose(result["travel_mm"] / 20 * 1e6, result["contact_time_us"], rtol=1e-6)
    # A touch beside the object reports nothing, as NaN.
    beside = touchstone.touches(target_mm=(500, 0, 0), approach=(0, 0, -1), lateral=(1, 0, 0), standoff_mm=200)
    missed = client.touch("lat20", beside, model=noiseless)
    assert not missed["complete"][0] and np.isnan(missed["contact_time_us"]).all()


def test_a_list_of_touches_is_a_dataset(client):
    touches = client.plan(touchstone.faces(samples_per_face=2, rounds=1), "lat20", 12)
    dataset = client.dataset(["lat20"], touches, columns=["index", "pose"])
    batch = next(iter(dataset))
    assert dataset.stop == 12 and batch.rows == 12
    np.testing.assert_allclose(batch["target_mm"], touches.target_mm, atol=1e-4)


def test_a_plan_meets_the_object_with_the_fingers_of_a_model(client):
    wide = "touchstone: model/1\nname: wide\nend_effector: {fingers: 3, spacing_mm: 50}\n"
    plan = touchstone.faces(samples_per_face=4, rounds=1, max_incidence_deg=40)
    touches = client.plan(plan, "lat20", 24, model=wide)
    assert touches.draws > 24  # some were rejected: 100 mm are nearly as wide as the object
    result = client.touch("lat20", touches, model=wide)
    assert result["complete"].all()
    cosine = -np.einsum("tfk,tk->tf", result["normal"], touches.approach)
    assert cosine.min() >= np.cos(np.radians(40)) - 1e-9
    np.testing.assert_allclose(result["travel_mm"][:, 1], 60, atol=1e-6)  # targets are on the surface
    with pytest.raises(touchstone.TouchstoneError, match="in 20 draws no touch met it"):
        client.plan(touchstone.faces(max_incidence_deg=0.1), "lat20", 4, max_draws=20)


def test_a_start_inside_of_the_object_is_warned_of(client):
    inside = touchstone.touches(target_mm=(0, 0, 0), approach=(0, 0, -1), lateral=(1, 0, 0), standoff_mm=20)
    with pytest.warns(UserWarning, match="starts inside of 'lat20': a standoff of 20 mm"):
        client.touch("lat20", inside)


def test_touches_in_two_calls_are_those_of_one(client):
    """What a touch leaves in the fingers, and the pause since, do not end with a call."""
    remembers = ("touchstone: model/1\nname: remembers\neffects:\n  - return_hysteresis: {fraction: 0.02}\n"
                 "  - formula: {name: rest, adds: travel_mm, expression: \"0.01 * finger * pause_s\"}\n")
    touches = dataclasses.replace(client.plan(touchstone.faces(samples_per_face=2, rounds=1), "lat20", count=12),
                                  session_time_s=np.cumsum(np.arange(6.0, 18.0)))
    whole = client.touch("lat20", touches, model=remembers)["contact_time_us"]
    later = client.touch("lat20", touches[5:], model=remembers, start=5, previous=("lat20", touches[:5]))["contact_time_us"]
    np.testing.assert_array_equal(whole[5:], later)
    alone = client.touch("lat20", touches[5:], model=remembers, start=5)["contact_time_us"]
    assert (alone[:2] != later[:2]).any(axis=1).all() and (alone[2:] == later[2:]).all()
    with pytest.raises(touchstone.TouchstoneError, match=r"previous\.object.*lat99"):
        client.touch("lat20", touches, previous=("lat99", touches[:1]))


def test_the_catalogue_and_the_store_are_readable(client, tmp_path):
    effects = {e.name: e for e in client.effects()}
    assert effects["tip_radius"].parameters[0].unit == "mm" and effects["tip_radius"].stage == "contact"
    assert {e.stage for e in effects.values()} == {
        "pose", "contact", "motion", "sensor", "camera pose", "projection", "shading", "image sensor"}
    assert [effects[name].parameters[0].arity for name in (
        "tip_radius", "object_pose", "finger_length", "principal_point")] == ["scalar", "vector3", "finger", "vector2"]
    nominal = client.model()
    assert nominal.fingers == 3 and nominal.name in {m.name for m in client.models()}
    path = tmp_path / "round.yaml"
    path.write_text("touchstone: model/1\nname: python_round\nend_effector: {fingers: 3, spacing_mm: 30}\n"
                    "effects:\n  - tip_radius: {radius_mm: 3}\n")
    added = client.add_model(path)
    assert client.model("python_round").hash == added.hash == client.model(added.hash[:12]).hash
    one = joined(client.dataset(["lat20"], PLAN, samples=100, model=path), "descriptor_us")
    two = joined(client.dataset(["lat20"], PLAN, samples=100, model=added), "descriptor_us")
    np.testing.assert_array_equal(one, two)


@pytest.mark.parametrize("kind, change, says", [
    (touchstone.NotFound, dict(objects=["lat21"]), "lat21"),
    (touchstone.NotFound, dict(model="no_such_model"), "no_such_model"),
    (touchstone.InvalidRequest, dict(model="touchstone: model/1\nname: a\neffects:\n  - tip_raduis: {}\n"), "tip_raduis"),
    (touchstone.InvalidRequest, dict(columns=["descriptors"]), "descriptors"),
    (touchstone.InvalidRequest, dict(image=touchstone.image(20000, 20000)), "20000"),
    (touchstone.InvalidRequest, dict(plan=touchstone.sphere(step_angle_deg=120)), "step_angle"),
])
def test_the_sources_own_words_reach_the_caller(client, kind, change, says):
    options = {**dict(objects=["lat20"], plan=PLAN, samples=10), **change}
    with pytest.raises(kind, match=says) as caught:
        list(client.dataset(**options))
    # No gRPC exception behind it.
    assert caught.value.__cause__ is None and caught.value.__suppress_context__


def test_nobody_listening_is_said_when_the_time_is_over(nobody, retry_clock):
    with pytest.raises(touchstone.SourceUnreachable, match=f"{nobody}: no source answers.*Start touchstone-server"):
        touchstone.connect(nobody, timeout_s=60)
    assert retry_clock.now_s == pytest.approx(60)


def test_an_interrupt_ends_a_stream_at_once(server):
    # A shell starts programs in the background with interrupts ignored, and they pass that on: tests that run there too.
    script = textwrap.dedent(f"""
        import signal
        import touchstone
        signal.signal(signal.SIGINT, signal.default_int_handler)
        dataset = touchstone.connect("{server.target}").dataset(["lat20"], samples=10**12)
        try:
            for number, batch in enumerate(dataset):
                if number == 0:
                    print("streaming", flush=True)
        except KeyboardInterrupt:
            print("interrupted", flush=True)
    """)
    process = subprocess.Popen([sys.executable, "-c", script], stdout=subprocess.PIPE, stderr=subprocess.PIPE,
                               text=True, env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)})
    assert process.stdout.readline().strip() == "streaming"
    process.send_signal(signal.SIGINT)
    out, err = process.communicate(timeout=60)
    assert "interrupted" in out and "Traceback" not in err and process.returncode == 0


def test_a_capture_shows_the_models_effects_of_photographs(client):
    camera = touchstone.Camera(eye_mm=(300, 0, 80))
    picture = touchstone.image(48, 32, shading_style="shaded")
    nominal = client.capture("lat20", [camera], image=picture)["image"]
    ground = nominal == 0
    assert ground.sum() > 100
    text = ("touchstone: model/1\nname: seen\nend_effector: {fingers: 3, spacing_mm: 30}\neffects:\n"
            "  - background_level: {grey: 50}\n  - image_noise: {sigma_grey: 2}\n")
    first = client.capture("lat20", [camera, camera], image=picture, model=text, seed=5)["image"]
    again = client.capture("lat20", [camera], image=picture, model=text, seed=5, start=1)["image"]
    assert abs(first[0][ground[0]].mean() - 50) < 0.5
    assert (again[0] == first[1]).all() and (first[0] != first[1]).any()
