"""Recognition by photographs: backbone, head, splits, and what a streaming learner reports of itself."""

import dataclasses
import pathlib
import subprocess
import types
from typing import Any

import cv2
import numpy as np
import pytest
import torch
from torch import nn

import touchstone
from touchstone.own_server import find_server
from touchstone.training import controls, features, image_head, onnx_file, picture_data, separation, streaming
from touchstone.training.backbone import CAFFE, TORCHVISION, Backbone, NoNetwork, prepare
from touchstone.training.context import Context
from touchstone.training.experiments import image_recognition
from touchstone.training.experiments.image_augmentation import COPIES, MeasuredFeatures
from touchstone.training.experiments.image_recognition import measured_split, sizes
from touchstone.training.picture_data import FeatureCache, Pictures
from touchstone.training.settings import Settings

_SQUEEZENET = pathlib.Path(__file__).resolve().parents[4] / "shared/data/backbone/squeezenet1.0.onnx"
needs_squeezenet = pytest.mark.skipif(not _SQUEEZENET.exists(), reason=f"there is no backbone file {_SQUEEZENET}")


class _Small(nn.Module):
    """(N, 3, 32, 32) -> (N, 7), with 4 maps of 7 x 7 before pooling and classification."""

    def __init__(self):
        super().__init__()
        self.convolution, self.last = nn.Conv2d(3, 4, 5, 4), nn.Linear(4, 7)

    def maps(self, picture):
        return torch.relu(self.convolution(picture))

    def forward(self, picture):
        return self.last(self.maps(picture).mean((2, 3)))


@pytest.fixture(scope="module")
def small(tmp_path_factory):
    """(network, its file)."""
    torch.manual_seed(1)
    network, path = _Small().eval(), tmp_path_factory.mktemp("onnx") / "small.onnx"
    torch.onnx.export(network, torch.zeros(1, 3, 32, 32), str(path))
    return network, path


def _noise(count, side=40, seed=0):
    return np.random.default_rng(seed).integers(0, 256, (count, side, side, 1), np.uint8)


def test_features_are_the_last_maps_flattened(small):
    network, path = small
    picture = _noise(1)[0]
    with torch.no_grad():
        wanted = network.maps(torch.from_numpy(prepare(picture, 32, TORCHVISION)))
    backbone = Backbone(path)
    assert (backbone.maps, backbone.features_count, backbone.side_px) == (4, 4 * 7 * 7, 32)
    np.testing.assert_allclose(backbone.features(picture[None])[0], wanted.numpy().ravel(), atol=1e-5)
    pictures = features.FeatureSets(backbone.features(picture[None]), np.zeros(1, int), np.zeros(1, int))
    np.testing.assert_allclose(image_recognition.pooled(pictures, 4).values[0], wanted.numpy().mean((0, 2, 3)), atol=1e-5)


def test_the_same_picture_has_the_same_features_in_any_order_with_any_workers(small):
    pictures = _noise(12)
    features = Backbone(small[1], workers=3).features(pictures)
    assert np.array_equal(Backbone(small[1], workers=1).features(pictures[::-1]), features[::-1])
    assert not np.array_equal(features[0], features[1])


def test_preparation_follows_the_conventions():
    red = np.zeros((8, 8, 3), np.uint8)
    red[:, :, 0] = 200
    assert prepare(red, 8, CAFFE)[0, :, 0, 0].tolist() == [-104, -117, 77]  # blue, green, red
    np.testing.assert_allclose(prepare(red, 8, TORCHVISION)[0, :, 0, 0], [76.325 / 58.395, -116.28 / 57.12, -103.53 / 57.375], rtol=1e-5)


def test_a_file_beside_the_network_says_how_to_prepare_pictures(small, tmp_path):
    path = tmp_path / "other.onnx"
    path.write_bytes(small[1].read_bytes())
    said = tmp_path / "other.onnx.json"
    said.write_text('{"mean": [0, 0, 0], "deviation": [255, 255, 255], "order": "rgb"}')
    assert Backbone(path).preparation.deviation == (255.0, 255.0, 255.0)
    said.write_text('{"mean": [0, 0, 0], "order": "rgb"}')
    with pytest.raises(NoNetwork, match="deviation"):
        Backbone(path)


@pytest.mark.parametrize("content", [b"", b"this is a text, and no network at all\n" * 20, bytes(range(256)) * 4])
def test_a_file_that_is_no_network_is_refused_in_words(tmp_path, content):
    path = tmp_path / "no.onnx"
    path.write_bytes(content)
    with pytest.raises(NoNetwork, match=r"no\.onnx: .*An image network is needed"):
        Backbone(path)


def test_a_network_of_something_else_is_refused_with_its_input(tmp_path):
    path = tmp_path / "vectors.onnx"
    torch.onnx.export(nn.Linear(5, 2).eval(), torch.zeros(1, 5), str(path))
    with pytest.raises(NoNetwork, match="1 x 5, not 1 x 3 x side x side"):
        Backbone(path)
    cut = tmp_path / "cut.onnx"
    cut.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    with pytest.raises(NoNetwork, match=r"cut\.onnx"):
        Backbone(cut)


@needs_squeezenet
def test_squeezenet_gives_the_maps_before_its_classifier_and_knows_a_picture_again():
    backbone = Backbone(_SQUEEZENET)
    assert onnx_file.input_shape(_SQUEEZENET) == (1, 3, 227, 227)
    assert (backbone.maps, backbone.features_count, backbone.preparation) == (512, 512 * 7 * 7, CAFFE)
    picture = cv2.GaussianBlur(_noise(1, 227)[0], (0, 0), 5)[None, :, :, None]
    assert np.array_equal(backbone.features(picture), backbone.features(picture))


def test_features_are_computed_once(small, tmp_path, monkeypatch):
    context: Any = types.SimpleNamespace(settings=Settings(tmp_path, backbone=small[1]))
    cache = FeatureCache(context)
    pictures = Pictures(_noise(5), np.zeros(5, int), "noise", np.arange(5))
    first = cache(pictures)
    monkeypatch.setattr(cache.backbone, "features", lambda _: pytest.fail("computed again"))
    assert np.array_equal(cache(pictures).values, first.values) and cache.pictures == 5


def _clusters(seed, count=60, classes=5, apart=3.0):
    rng = np.random.default_rng(seed)
    objects = np.arange(count * classes) % classes
    centres = np.random.default_rng(99).normal(size=(classes, 20)) * apart
    return features.FeatureSets(centres[objects] + rng.normal(size=(len(objects), 20)), objects, 1000 * seed + np.arange(len(objects)))


def _shuffled(pictures, seed):
    return dataclasses.replace(pictures, objects=np.random.default_rng(seed).permutation(pictures.objects))


def test_the_head_learns_what_can_be_learned_and_nothing_from_shuffled_labels():
    train, test = _clusters(1), _clusters(2)
    assert image_head.train(train, 5, 1, epochs=10).accuracy(test) > 0.95
    found = controls.control([[image_head.train(_shuffled(train, seed), 5, seed).accuracy(test) for seed in range(20)]], 0.2)
    assert found.is_chance, found.words()


def test_the_head_is_the_same_for_the_same_seed():
    train, test = _clusters(1), _clusters(2)
    one, same, other = (image_head.train(train, 5, seed).probabilities(test) for seed in (1, 1, 2))
    assert np.array_equal(one, same) and not np.array_equal(one, other)
    np.testing.assert_allclose(one.sum(1), 1, rtol=1e-6)


def test_validation_is_a_fifth_of_every_object_and_keeps_copies_together():
    train = _clusters(1)
    assert np.bincount(train.objects[image_head.train(train, 5, 1, epochs=0).validation]).tolist() == [12] * 5
    poses = np.arange(300) // 10 * 5 + train.objects  # pairs of rows, 150 poses
    held = image_head.train(dataclasses.replace(train, poses=poses), 5, 1, epochs=0).validation
    assert not set(poses[held]) & set(np.delete(poses, held))


def test_a_head_refuses_a_test_on_a_picture_that_it_was_trained_on():
    train = _clusters(1)
    head = image_head.train(train, 5, 1, epochs=0)
    head.probabilities(train[head.validation])
    with pytest.raises(separation.Leak, match=r"240 of 300 poses that are tested are trained on"):
        head.accuracy(train)


def test_no_measured_picture_is_in_training_and_testing(tmp_path, monkeypatch):
    context = Context(Settings(tmp_path, quick=True))
    count = 5 * sizes(context).measured_per_object
    pool = Pictures(_noise(count, 16), np.repeat(np.arange(5), count // 5), "emulated", np.arange(count))
    monkeypatch.setattr("touchstone.training.experiments.image_augmentation.measured", lambda *_: pool)
    # The mean of a picture stands for its features: copies are told by their row, whose number is the picture's first pixel.
    pool.image[:, :] = np.arange(count)[:, None, None, None]
    cache: Any = lambda pictures: features.FeatureSets(pictures.image.reshape(len(pictures), -1).mean(1, keepdims=True), pictures.object,
                                                          pictures.poses)
    real = MeasuredFeatures(context, cache)
    for seed in range(20):
        training, testing = measured_split(context, pool, seed)
        assert len(testing) == sizes(context).measured_test and len(training) == sizes(context).measured_train
        seen = real.training(training, COPIES)
        assert len(seen) == (COPIES + 1) * len(training)
        assert not set(seen.values[:, 0].round()) & set(testing) and not set(seen.poses) & set(testing)
        assert np.array_equal(seen.values[:, 0].round(), seen.poses) and np.array_equal(seen.objects, pool.object[seen.poses])
        assert np.bincount(pool.object[testing]).tolist() == [5] * 5
    assert not np.array_equal(measured_split(context, pool, 1)[1], measured_split(context, pool, 2)[1])


def test_a_whole_run_has_the_seeds_74_pictures_and_222_copies(tmp_path):
    size = sizes(Context(Settings(tmp_path)))
    assert (size.measured_train, COPIES * size.measured_train, size.measured_test) == (74, 222, 75)
    assert size.measured_train + size.measured_test <= 5 * size.measured_per_object


def test_preparations_of_pictures():
    pictures = Pictures(cv2.GaussianBlur(_noise(1)[0], (0, 0), 3)[None, :, :, None], np.array([3]), "virtual", np.array([1]))
    assert np.array_equal(picture_data.inverted(picture_data.inverted(pictures)).image, pictures.image)
    binarised = picture_data.binarised(pictures).image
    assert set(np.unique(binarised)) == {0, 255} and binarised.shape == pictures.image.shape
    assert pictures.image[binarised == 255].min() > pictures.image[binarised == 0].max()


def test_scaled_copies_are_larger_or_smaller():
    image = np.zeros((1, 101, 101, 1), np.uint8)
    image[0, 40:61, 40:61] = 255
    copies = picture_data.scaled(Pictures(image, np.array([2]), "virtual", np.array([7])), 50, np.random.default_rng(1))
    ratio = np.sqrt((copies.image > 127).reshape(50, -1).sum(1)) / 21
    assert copies.object.tolist() == [2] * 50 and copies.poses.tolist() == [7] * 50 and 0.7 < ratio.min() < 0.85 < 1.15 < ratio.max() < 1.4


@needs_squeezenet
def test_shuffled_labels_of_pictures_give_chance(tmp_path):
    with Context(Settings(tmp_path, quick=True, backbone=_SQUEEZENET)) as context:
        cache = FeatureCache(context)
        train, test = (cache(picture_data.virtual(context, count, 1, use=use)) for count, use in ((10, "training"), (6, "testing")))
    pooled = [image_recognition.pooled(pictures, cache.backbone.maps) for pictures in (train, test)]
    learned = image_head.train(train, 5, 1).accuracy(test)
    found = controls.control([[image_head.train(_shuffled(pooled[0], seed), 5, seed).accuracy(pooled[1]) for seed in range(20)]], 0.2)
    assert learned > found.found.value + 0.2
    assert found.is_chance, found.words()


def test_the_learner_tells_how_long_it_waited(monkeypatch):
    now_s, step = 0.0, streaming._step

    def spend(seconds):
        nonlocal now_s
        now_s += seconds

    def batches(count, pause_s):
        for k in range(count):
            spend(pause_s)
            yield {"image": torch.from_numpy(_noise(50, 64, k).transpose(0, 3, 1, 2)), "object": torch.arange(50) % 5}

    def step_of_100_ms(*arguments):
        spend(0.1)
        return step(*arguments)

    # A clock of its own: on a busy machine a step takes as long as a pause.
    monkeypatch.setattr(streaming, "time", types.SimpleNamespace(monotonic=lambda: now_s))
    monkeypatch.setattr(streaming, "_step", step_of_100_ms)
    slow, fast = (streaming.feed(batches(20, pause_s), 1000, 64, 5, 1) for pause_s in (0.2, 0.0))
    assert slow.samples == fast.samples == 1000
    # The first batch is there before the clock starts.
    assert slow.start_s == pytest.approx(0.2) and slow.seconds == pytest.approx(20 * 0.1 + 19 * 0.2)
    assert slow.wait_share * slow.seconds == pytest.approx(19 * 0.2)
    assert fast.wait_share == 0 and fast.seconds == pytest.approx(20 * 0.1)
    assert len(slow.parts) == len(slow.memory_mb) == streaming.PARTS and min(slow.memory_mb) > 10


def test_shards_hold_what_the_stream_gives(tmp_path):
    program = pathlib.Path(find_server()).parent / "touchstone"
    objects = ["lat00", "lat20"]
    subprocess.run([str(program), "stream", "--objects", ",".join(objects), "--samples", "20", "--seed", "5", "--plan", "sphere",
                    "--image", "64x64", "--encoding", "raw", "--columns", "object,descriptor,image", "--shard-size", "10",
                    "--out", str(tmp_path), "--quiet"], check=True)
    found = list(streaming.Shards(sorted(tmp_path.glob("*.tar")), objects, 10))
    with touchstone.connect() as client:
        wanted = client.samples(objects, touchstone.sphere(step_angle_deg=1), samples=20, seed=5, image=(64, 64),
                                columns=["object", "image"])[:]
    assert np.array_equal(torch.cat([batch["object"] for batch in found]).numpy(), wanted["object"])
    assert np.array_equal(torch.cat([batch["image"] for batch in found]).numpy()[:, 0], wanted["image"][:, :, :, 0])
