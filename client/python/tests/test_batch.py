"""Columns of received bytes as arrays."""

import numpy as np
import pytest

from touchstone import Batch, EncodedImages, SourceFailed
from touchstone.batch import decode_column
from touchstone.v1 import types_pb2


def column(name, kind, shape, data, offsets=()):
    return types_pb2.Column(name=name, type=kind, shape=shape, data=data, offsets=offsets)


def test_a_column_is_a_view_of_the_message():
    values = np.arange(12, dtype="<f4").reshape(4, 3)
    decoded = decode_column(column("descriptor_s", types_pb2.DATA_TYPE_FLOAT32, [3], values.tobytes()), 4)
    np.testing.assert_array_equal(decoded, values)
    assert not decoded.flags.owndata and not decoded.flags.writeable


@pytest.mark.parametrize("kind, dtype", [
    (types_pb2.DATA_TYPE_FLOAT32, "f4"), (types_pb2.DATA_TYPE_FLOAT64, "f8"), (types_pb2.DATA_TYPE_UINT8, "u1"),
    (types_pb2.DATA_TYPE_INT32, "i4"), (types_pb2.DATA_TYPE_UINT64, "u8"),
])
def test_every_type_is_known(kind, dtype):
    values = np.arange(5).astype(dtype)
    decoded = decode_column(column("a", kind, [], values.tobytes()), 5)
    assert decoded.dtype == dtype and decoded.tolist() == [0, 1, 2, 3, 4]


def test_a_batch_converts_once_and_only_what_is_asked_for():
    batch = Batch.from_columns(7, 2, [
        column("descriptor_s", types_pb2.DATA_TYPE_FLOAT32, [1], np.array([1e-3, 2e-3], "<f4").tobytes()),
        column("normal", types_pb2.DATA_TYPE_FLOAT32, [], np.array([1, 0], "<f4").tobytes()),
    ])
    assert list(batch) == ["descriptor_us", "normal"] and batch.rows == 2 and batch.start_index == 7
    np.testing.assert_allclose(batch["descriptor_us"], [[1000], [2000]], rtol=1e-6)
    assert batch["descriptor_us"] is batch["descriptor_us"]
    with pytest.raises(KeyError, match="descriptor_us, normal"):
        batch["descriptor_s"]


def test_si_columns_keep_their_names_and_bytes():
    data = np.array([1e-3, 2e-3], "<f4").tobytes()
    batch = Batch.from_columns(0, 2, [column("descriptor_s", types_pb2.DATA_TYPE_FLOAT32, [], data)], si=True)
    assert batch["descriptor_s"].tobytes() == data


def test_encoded_images_are_cut_when_asked_for():
    images = decode_column(column("image", types_pb2.DATA_TYPE_BYTES, [], b"aabbbc", [0, 2, 5, 6]), 3)
    assert isinstance(images, EncodedImages)
    assert list(images) == [b"aa", b"bbb", b"c"] and images[-1] == b"c" and images[1:] == [b"bbb", b"c"]
    with pytest.raises(IndexError):
        images[3]


@pytest.mark.parametrize("bad, says", [
    (column("a", types_pb2.DATA_TYPE_FLOAT32, [3], b"\0" * 20), "20 bytes"),
    (column("a", 99, [], b""), "data type 99"),
    (column("a", types_pb2.DATA_TYPE_BYTES, [], b"aa", [0, 1]), "offsets"),
    (column("a", types_pb2.DATA_TYPE_BYTES, [], b"aa", [0, 1, 9]), "offsets"),
])
def test_a_malformed_column_is_an_error_that_names_it(bad, says):
    with pytest.raises(SourceFailed, match=says):
        decode_column(bad, 2)
