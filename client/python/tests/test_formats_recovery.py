"""Files that were cut: what is said of them, and what is saved."""

import json
import os
import subprocess
import sys
import tarfile

import pytest

import touchstone

h5py = pytest.importorskip("h5py")
np = pytest.importorskip("numpy")
pytest.importorskip("pyarrow")
reader = pytest.importorskip("mcap.reader")

from touchstone.formats import export, recover, verify  # noqa: E402


@pytest.fixture(scope="module")
def run(server_program):
    def call(*words):
        return subprocess.run([server_program.parent / "touchstone", *map(str, words)], capture_output=True, text=True, check=False,
                              env={**os.environ, "TOUCHSTONE_PYTHON": sys.executable})
    return call


@pytest.fixture(scope="module")
def whole(run, tmp_path_factory):
    """A dataset of 100 samples with pictures, what it is exported to, and a measured set with its journal."""
    folder = tmp_path_factory.mktemp("whole")
    for words in (["stream", "--objects", "lat20", "--samples", "100", "--image", "12x8", "--renderer", "cpu", "--out", folder / "data"],
                  ["plan", "lat20", "--plan", "faces", "--rounds", "1", "-o", folder / "plan.csv"],
                  ["touch", "--plan", folder / "plan.csv", "-o", folder / "set.csv"],
                  ["session", "import", folder / "set.csv", "-o", folder / "set.db"],
                  ["session", "export", folder / "set.db", "-o", folder / "set.h5"]):
        done = run(*words)
        assert done.returncode == 0, done.stderr
    for to in ("mcap", "parquet", "hdf5"):
        export(folder / "data", folder / to, to=to)
    return folder


def _files(whole):
    return [whole / "data/shard-000000.tar", whole / "mcap/data.mcap", whole / "set.csv", whole / "set.db", whole / "set.h5", whole / "hdf5/data.h5",
            next((whole / "parquet/data").glob("*.parquet"))]


def _cut(path, folder, share):
    cut = folder / path.name
    cut.write_bytes(path.read_bytes()[: int(path.stat().st_size * share)])
    return cut


def _samples(path):
    samples = {}
    with tarfile.open(path) as archive:
        for member in archive:
            samples.setdefault(member.name.partition(".")[0], {})[member.name.partition(".")[2]] = archive.extractfile(member).read()
    return samples


def test_what_is_whole_is_said_to_be(whole, run):
    for path in [whole / "data", *_files(whole)]:
        done = run("verify", path)
        assert done.returncode == 0 and "is whole" in done.stderr, done.stderr
    assert json.loads(run("verify", whole / "set.db", "--json").stdout) == {
        "file": str(whole / "set.db"), "whole": True, "saved": "48 touches", "lost": ""}


@pytest.mark.parametrize("share", [0.5, 0.9, 0.97])
def test_every_cut_file_is_found(whole, run, tmp_path, share):
    for path in _files(whole):
        # A journal may end in pages that hold nothing, and a line of a measurement file where it may end.
        if path.suffix != ".csv" and (path.suffix != ".db" or share == 0.5):
            assert not verify(_cut(path, tmp_path, share)).whole, path
    done = run("verify", _cut(whole / "mcap/data.mcap", tmp_path, share))
    assert done.returncode == 4 and "is not whole" in done.stderr


@pytest.mark.parametrize("share", [0.3, 0.77, 0.9])
def test_the_samples_before_the_cut_of_a_shard_are_saved(whole, run, tmp_path, share):
    cut = _cut(whole / "data/shard-000000.tar", tmp_path, share)
    done = run("recover", cut, "-o", tmp_path / "saved.tar")
    assert done.returncode == 0, done.stderr
    before, saved = _samples(whole / "data/shard-000000.tar"), _samples(tmp_path / "saved.tar")
    assert f"{len(saved)} samples saved; lost: what came after them" in done.stderr
    assert int(100 * share) - 3 <= len(saved) < 100
    assert saved == {key: before[key] for key in list(before)[: len(saved)]}
    assert verify(tmp_path / "saved.tar").whole


def test_a_sample_that_lacks_a_member_is_not_saved(whole, tmp_path):
    """The file ends between two members of one sample."""
    path = whole / "data/shard-000000.tar"
    with tarfile.open(path) as archive:
        member = archive.getmembers()[3 * 50 + 1]
    cut = tmp_path / "cut.tar"
    cut.write_bytes(path.read_bytes()[: member.offset])
    assert recover(cut, tmp_path / "saved.tar").saved == "50 samples"


def test_the_messages_before_the_cut_of_an_mcap_are_saved(whole, tmp_path):
    mcap_writer = pytest.importorskip("mcap.writer")
    # In small chunks, as a recorder writes them.
    with open(tmp_path / "log.mcap", "wb") as stream:
        writer = mcap_writer.Writer(stream, chunk_size=1000)
        writer.start(profile="lab")
        channel = writer.register_channel(topic="/a", message_encoding="json", schema_id=0)
        writer.add_metadata("who", {"name": "me"})
        for k in range(1000):
            writer.add_message(channel_id=channel, log_time=k, publish_time=k, data=json.dumps({"k": k}).encode())
        writer.finish()
    found = recover(_cut(tmp_path / "log.mcap", tmp_path, 1.0), tmp_path / "same.mcap")
    assert found.whole and found.saved == "1000 messages of 1 topics"
    (tmp_path / "cut.mcap").write_bytes((tmp_path / "log.mcap").read_bytes()[: (tmp_path / "log.mcap").stat().st_size // 2])
    found = recover(tmp_path / "cut.mcap", tmp_path / "saved.mcap")
    assert not found.whole
    with open(tmp_path / "saved.mcap", "rb") as stream:
        opened = reader.make_reader(stream)
        messages = [json.loads(message.data)["k"] for _, _, message in opened.iter_messages()]
        assert opened.get_header().profile == "lab"
    assert messages == list(range(len(messages))) and 300 < len(messages) < 1000
    assert found.saved == f"{len(messages)} messages of 1 topics"


def test_the_touches_of_a_damaged_journal_are_saved(whole, run, tmp_path):
    """A byte of one touch's command is another."""
    data = bytearray((whole / "set.db").read_bytes())
    rows = touchstone.read_plan(whole / "set.csv")
    times = np.array(rows[20].time_us) / 1e6
    at = next(data.find(np.array([time]).astype(kind).tobytes()) for kind in (">f8", "<f8") for time in times
              if data.find(np.array([time]).astype(kind).tobytes()) >= 0)
    data[at + 3] ^= 1
    (tmp_path / "set.db").write_bytes(data)
    assert not verify(tmp_path / "set.db").whole
    done = run("recover", tmp_path / "set.db", "-o", tmp_path / "saved.csv")
    assert done.returncode == 0 and "47 touches saved" in done.stderr, done.stderr
    assert [row.touch for row in touchstone.read_plan(tmp_path / "saved.csv")] == [row.touch for row in rows if row.touch != 20]


def test_all_sessions_of_a_journal_are_read_and_saved(whole, run, tmp_path):
    journal = tmp_path / "rig.db"
    for name in ("monday", "tuesday"):
        assert run("session", "import", whole / "set.csv", "-o", journal, "--session", name).returncode == 0
    done = run("verify", journal)
    assert done.returncode == 0 and "is whole: 96 touches in 2 sessions" in done.stderr, done.stderr
    assert recover(journal, tmp_path / "saved.db").saved == "96 touches of 2 sessions"
    assert verify(tmp_path / "saved.db").saved == "96 touches in 2 sessions"
    done = run("recover", journal, "-o", tmp_path / "saved.csv")
    assert done.returncode == 2 and "2 sessions (monday, tuesday), which a .csv cannot hold" in done.stderr


def test_a_file_that_is_no_journal_is_named_so(run, tmp_path):
    (tmp_path / "junk.db").write_bytes(b"junk" * 100)
    done = run("verify", tmp_path / "junk.db")
    assert done.returncode == 4 and "it is not an SQLite file" in done.stderr


def test_the_lines_of_a_spreadsheet_are_counted_as_import_reads_them(whole, tmp_path):
    text = (whole / "set.csv").read_text()
    (tmp_path / "set.csv").write_bytes(text.replace("\n", "\r\n\r\n").encode("utf-16"))
    assert verify(tmp_path / "set.csv").saved == "48 touches"


def test_the_lines_before_the_cut_of_a_measurement_file_are_saved(whole, tmp_path):
    text = (whole / "set.csv").read_text()
    cut = tmp_path / "set.csv"
    cut.write_text(text[: text.index("\n20,") + 40])
    assert not verify(cut).whole
    found = recover(cut, tmp_path / "saved.csv")
    assert found.saved == "20 touches" and (tmp_path / "saved.csv").read_text() == text[: text.index("\n20,") + 1]


@pytest.mark.parametrize("name, message", [("set.h5", "of a cut HDF5 file nothing can be saved"), ("hdf5/data.h5", "of a cut HDF5 file"),
                                           ("parquet/data/train-00000-of-00001.parquet", "of a cut Parquet file nothing can be saved")])
def test_of_what_nothing_can_be_saved_is_said(whole, run, tmp_path, name, message):
    done = run("recover", _cut(whole / name, tmp_path, 0.6), "-o", tmp_path / "out")
    assert done.returncode == 4 and message in done.stderr and not (tmp_path / "out").exists()


@pytest.mark.parametrize("words, message", [
    (["none.tar", "-o", "x"], "none.tar is not there"),
    (["a.txt", "-o", "x"], "a file whose name ends in .mcap"),
    (["a.tar", "-o", "a.tar", "--force"], "What is recovered is never replaced"),
    (["a.tar"], "-o/--out is required (see touchstone recover --help)"),
])
def test_mistakes_are_named(run, tmp_path, monkeypatch, words, message):
    monkeypatch.chdir(tmp_path)
    for name in ("a.txt", "a.tar"):
        (tmp_path / name).write_text("text")
    done = run("recover", *words)
    assert done.returncode == 2 and message in done.stderr, done.stderr


def test_the_completion_has_what_the_parsers_have(run):
    from touchstone.formats.__main__ import recover_parser, verify_parser

    lines = run("completion", "bash").stdout.splitlines()
    for name, parser in (("verify", verify_parser()), ("recover", recover_parser())):
        completed = next(line for line in lines if line.strip().startswith(f"' {name}')"))
        options = completed.split("options='")[1].split("'")[0].split()
        assert sorted(options) == sorted(option for action in parser._actions for option in action.option_strings)
