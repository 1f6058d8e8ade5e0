"""The archives of fuzz inputs: the same inputs give the same bytes, and nothing else is in a folder or an archive."""
import lzma
import os

import corpus
import pytest


def test_archives_of_the_repository_are_as_this_writes_them():
    assert corpus.readers()
    for reader in corpus.readers():
        inputs = corpus.read(reader)
        assert inputs, reader
        assert lzma.decompress((corpus.ARCHIVES / (reader + corpus.SUFFIX)).read_bytes()) == corpus.tar_of(reader, inputs), reader


def test_packed_files_are_unpacked_as_they_were_and_pack_to_the_same_bytes(tmp_path):
    first, second = tmp_path / "first", tmp_path / "second"
    first.mkdir()
    inputs = {"b": b"\0\xff\n", "a": b"", "c": bytes(range(256)) * 10}
    for name, content in inputs.items():
        (first / name).write_bytes(content)
    corpus.pack("stl", first, tmp_path)
    packed = (tmp_path / "stl.tar.xz").read_bytes()

    second.mkdir()
    (second / "stale").touch()
    corpus.unpack("stl", second, tmp_path)
    assert {path.name: path.read_bytes() for path in second.iterdir()} == inputs

    for path in second.iterdir():
        path.chmod(0o600)
        os.utime(path, (1, 1))
    corpus.pack("stl", second, tmp_path)
    assert (tmp_path / "stl.tar.xz").read_bytes() == packed
    assert corpus.readers(tmp_path) == ["stl"]


def test_added_inputs_come_to_those_that_were_there_once_each(tmp_path):
    found, again = tmp_path / "crash-1", tmp_path / "crash-2"
    found.write_bytes(b"solid")
    again.write_bytes(b"solid")
    corpus.write("stl", {"text": b"solid cube"}, tmp_path)
    assert corpus.add("stl", [found], tmp_path) == 2
    with pytest.raises(ValueError, match="is the input crash-1 of stl"):
        corpus.add("stl", [again], tmp_path)
    again.rename(found)
    found.write_bytes(b"other")
    with pytest.raises(ValueError, match="an input of stl is named so already"):
        corpus.add("stl", [found], tmp_path)
    assert corpus.read("stl", tmp_path) == {"text": b"solid cube", "crash-1": b"solid"}
