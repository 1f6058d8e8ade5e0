"""Samples by index: the bytes of the stream, in any order, from any thread or process, through losses of the server."""

import concurrent.futures
import multiprocessing
import pickle
from typing import Any

import numpy as np
import pytest

import touchstone

OPTIONS: dict[str, Any] = dict(objects=["lat00", "lat20"], plan=touchstone.sphere(step_angle_deg=5), samples=1000, seed=5,
               columns=("index", "object", "descriptor"))


@pytest.fixture(scope="module")
def whole(server):
    """All samples, as the stream gives them."""
    batches = list(touchstone.connect(server.target).dataset(**OPTIONS, batch_size=300))
    return {name: np.concatenate([batch[name] for batch in batches]) for name in batches[0]}


@pytest.fixture
def samples(server):
    return touchstone.connect(server.target).samples(**OPTIONS)


def expect_these(batch, whole, indices):
    assert batch.rows == len(indices)
    for name, values in whole.items():
        assert np.array_equal(batch[name], values[indices]), name


def test_one_sample_is_that_of_the_stream(samples, whole):
    for i in (0, 999, 123, -1, np.int64(7)):
        sample = samples[i]
        assert set(sample) == {"index", "object", "descriptor_us"}
        for name in sample:
            assert np.array_equal(sample[name], whole[name][i])
    assert samples[5]["descriptor_us"].shape == (3,)


@pytest.mark.parametrize("indices", [[3, 1, 7], [999, 0, 3, 3, 3], np.array([5, -5]), list(range(1000))[::-1]])
def test_a_list_comes_in_its_order(samples, whole, indices):
    batch = samples[indices]
    expect_these(batch, whole, indices)
    assert np.array_equal(batch.indices, np.array(indices) % 1000)


def test_a_slice_is_a_list(samples, whole):
    expect_these(samples[10:20], whole, list(range(10, 20)))
    expect_these(samples[::-300], whole, [999, 699, 399, 99])


def test_a_mask_selects_as_in_numpy(samples, whole):
    wanted = whole["object"] == 1
    for mask in (wanted, wanted.tolist()):
        expect_these(samples[mask], whole, np.flatnonzero(wanted))


@pytest.mark.parametrize("index, words", [(np.ones(999, bool), "mask of 999 entries for 1000 samples"), ([True, 3], "mask of 2 entries"),
                                          (True, "no whole number"), (np.True_, "no whole number")])
def test_a_mask_of_another_length_and_a_single_bool_are_refused(samples, index, words):
    with pytest.raises(touchstone.InvalidRequest, match=words):
        samples[index]


def test_true_is_no_number_of_samples(server):
    with pytest.raises(touchstone.InvalidRequest, match="samples is True; a whole number was expected"):
        touchstone.connect(server.target).samples(**{**OPTIONS, "samples": True})


def test_the_length_is_the_number_of_samples(samples):
    assert len(samples) == 1000
    assert sum(1 for _ in samples) == 1000


def test_images_come_by_index(server):
    options = dict(OPTIONS, samples=50, columns=("index", "image"))
    client = touchstone.connect(server.target)
    for encoding in ("raw", "png"):
        image = touchstone.image(16, 12, encoding=encoding)
        [stream] = client.dataset(**options, image=image, batch_size=50)
        some = client.samples(**options, image=image)
        batch = some[[49, 2, 2, 31]]
        for row, i in enumerate([49, 2, 2, 31]):
            assert np.array_equal(batch["image"][row], stream["image"][i])
        assert np.array_equal(some[31]["image"], stream["image"][31])


def test_longer_lists_than_a_request_are_asked_for_in_parts(server, whole, monkeypatch):
    monkeypatch.setattr("touchstone.samples._SAMPLES_PER_REQUEST", 7)
    samples = touchstone.connect(server.target).samples(**OPTIONS)
    indices = touchstone.Permutation(1000, 3)[:100].tolist()
    expect_these(samples[indices], whole, indices)
    encoded = touchstone.connect(server.target).samples(
        **dict(OPTIONS, columns=("image",)), image=touchstone.image(8, 8, encoding="png"))
    images = encoded[list(range(20))]["image"]
    assert len(images) == 20 and images[13] == encoded[13]["image"]


def test_threads_share_one(samples, whole):
    with concurrent.futures.ThreadPoolExecutor(8) as pool:
        for i, sample in enumerate(pool.map(samples.__getitem__, range(200))):
            assert np.array_equal(sample["descriptor_us"], whole["descriptor_us"][i])


def _three(samples):
    return samples[[2, 0, 998]]["descriptor_us"]


def test_other_processes_get_a_copy(samples, whole):
    samples[0]  # with a connection, which must not travel
    with multiprocessing.get_context("spawn").Pool(2) as pool:
        for values in pool.map(_three, [samples] * 4):
            assert np.array_equal(values, whole["descriptor_us"][[2, 0, 998]])
    assert pickle.loads(pickle.dumps(samples)).header == samples.header


@pytest.mark.parametrize("index, words", [(1000, "sample 1000 of 1000"), (-1001, "sample -1001 of 1000"),
                                          ([0, 1000], "sample 1000 of 1000")])
def test_what_is_not_there_is_an_index_error(samples, index, words):
    with pytest.raises(IndexError, match=words):
        samples[index]


@pytest.mark.parametrize("index", ["seven", 1.5, None, ["a"], np.array([[1]])])
def test_what_is_no_index_is_refused(samples, index):
    with pytest.raises(touchstone.InvalidRequest, match="whole number"):
        samples[index]


def test_an_empty_list_is_refused(samples):
    with pytest.raises(touchstone.InvalidRequest, match="empty"):
        samples[[]]


def test_a_lost_server_is_waited_for(new_server, whole, start_again):
    server = new_server()
    samples = touchstone.connect(server.target).samples(**OPTIONS)
    samples[0]
    waits = []
    start_again(server, once=lambda: waits.append(1) or len(waits) == 3)
    server.kill()
    expect_these(samples[[8, 3]], whole, [8, 3])


def test_another_dataset_at_the_same_address_is_noticed(new_server, tmp_path):
    server = new_server()
    samples = touchstone.connect(server.target).samples(**OPTIONS)
    samples[0]
    server.kill()
    model = tmp_path / "other.yaml"
    model.write_text("touchstone: model/1\nname: other\neffects:\n  - gaussian_noise: {sigma_us: 500}\n")
    new_server("--default-model", str(model), port=server.port)
    with pytest.raises(touchstone.SourceChanged, match="model hash"):
        samples[0]


def test_a_shuffled_epoch_is_every_sample_once(samples, whole):
    order = touchstone.Permutation(len(samples), seed=11)
    seen = np.concatenate([samples[order[begin:begin + 128]]["index"] for begin in range(0, 1000, 128)])
    assert sorted(seen) == list(range(1000))


