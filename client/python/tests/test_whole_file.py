"""What this package writes is whole or as it was."""

import os
import resource
import signal

import pytest

import touchstone
from touchstone import mcap
from touchstone.report import Report
from touchstone.v1 import diagnosis_pb2
from touchstone.whole_file import whole_file, whole_folder


@pytest.fixture
def full_disk():
    """No file of this process can grow, as on a disk that is full."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    handler = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (1, before[1]))
    yield
    resource.setrlimit(resource.RLIMIT_FSIZE, before)
    signal.signal(signal.SIGXFSZ, handler)


def test_a_file_that_cannot_be_written_stays_as_it_was(tmp_path, full_disk):
    path = tmp_path / "set.csv"
    path.touch()
    with pytest.raises(OSError, match="File too large"), whole_file(path) as file:
        file.write("longer than a byte")
    assert not path.read_bytes() and os.listdir(tmp_path) == ["set.csv"]


def test_an_error_of_the_writer_leaves_nothing(tmp_path):
    def write_half():
        with whole_file(tmp_path / "set.csv") as file:
            file.write("half")
            raise ValueError("why")

    with pytest.raises(ValueError, match="why"):
        write_half()
    assert not os.listdir(tmp_path)


def test_nothing_is_written_through_a_link_that_can_be_foreseen(tmp_path):
    (tmp_path / "of another").write_text("kept")
    (tmp_path / "set.csv.part").symlink_to(tmp_path / "of another")
    with whole_file(tmp_path / "set.csv") as file:
        file.write("new")
    assert (tmp_path / "of another").read_text() == "kept" and (tmp_path / "set.csv").read_text() == "new"


def test_permission_bits_are_those_of_open_or_of_the_file_before(tmp_path):
    path = tmp_path / "set.csv"
    with whole_file(path, "wb") as file:
        file.write(b"new")
    (tmp_path / "opened").write_text("")
    assert path.stat().st_mode == (tmp_path / "opened").stat().st_mode
    path.chmod(0o640)
    with whole_file(path) as file:
        file.write("again")
    assert path.stat().st_mode & 0o777 == 0o640


_TOUCH = touchstone.touches([dict(target_mm=(0, 0, 0), approach=(0, 0, -1), lateral=(0, 1, 0), standoff_mm=100)])
_WRITERS = {
    "save": lambda path, **how: Report(diagnosis_pb2.Report()).save(path, **how),
    "save_model": lambda path, **how: Report(diagnosis_pb2.Report(improved_model_yaml="touchstone: model/1\n")).save_model(path, **how),
    "write_measurements": lambda path, **how: touchstone.write_measurements(
        path, [touchstone.Row(0, "lat20", _TOUCH, (1.0, 2.0, 3.0))], **how),
}


@pytest.mark.parametrize("write", _WRITERS.values(), ids=_WRITERS.keys())
def test_a_file_that_is_there_is_replaced_only_where_that_is_asked_for(tmp_path, write):
    path = tmp_path / "mine"
    path.write_text("precious")
    with pytest.raises(touchstone.InvalidRequest, match=r"mine exists; replace it with force=True"):
        write(path)
    assert path.read_text() == "precious"
    write(path, force=True)
    assert path.read_text() != "precious"


@pytest.mark.parametrize("write", _WRITERS.values(), ids=_WRITERS.keys())
def test_a_folder_that_is_missing_is_named(tmp_path, write):
    with pytest.raises(touchstone.NotFound, match=r"the folder .*nowhere is not there; make it"):
        write(tmp_path / "nowhere" / "file")


def test_an_mcap_file_that_is_there_is_refused_by_the_function_as_by_the_command(tmp_path):
    (tmp_path / "a.mcap").write_text("precious")
    pytest.importorskip("mcap")
    with pytest.raises(touchstone.InvalidRequest, match=r"a\.mcap exists; replace it with force=True"):
        mcap.export(tmp_path / "a.h5", tmp_path / "a.mcap")


def test_an_error_of_a_writer_names_what_was_asked_for(tmp_path):
    def fail(path):
        with whole_folder(path) as folder:
            (folder / "no/such").write_text("")

    def fail_in_words(path):
        with whole_folder(path) as folder:
            raise ValueError(f"cannot write {folder}/data.h5")

    with pytest.raises(FileNotFoundError) as error:
        fail(tmp_path / "out")
    assert error.value.filename == f"{tmp_path}/out/no/such" and ".part" not in str(error.value)
    with pytest.raises(ValueError, match=f"cannot write {tmp_path}/out/data.h5$"):
        fail_in_words(tmp_path / "out")
