"""Datasets and sessions in formats of other tools, read back by other readers. What they must hold is what the C++ writer of HDF5
shards made of the same specification."""

import io
import json
import os
import pathlib
import subprocess
import sys
import tarfile

import pytest

import touchstone
from touchstone import mcap as touchstone_mcap

np = pytest.importorskip("numpy")
h5py = pytest.importorskip("h5py")
pa = pytest.importorskip("pyarrow")
pq = pytest.importorskip("pyarrow.parquet")
Image = pytest.importorskip("PIL.Image")

from touchstone.formats import FORMATS, export  # noqa: E402
from touchstone.formats.datasets import open_dataset  # noqa: E402

ROWS = 1000
_SPEC = ["--objects", "lat00,lat20", "--samples", str(ROWS), "--seed", "3", "--image", "12x8", "--format", "rgb", "--depth", "--mask",
         "--columns", "index,object,descriptor,contact_time,pose,contact,image", "--renderer", "cpu", "--shard-size", "400"]
_CURRENT = pathlib.Path(__file__).resolve().parents[3] / "build/current_venv/bin/python"


@pytest.fixture(scope="module")
def program(server_program):
    return server_program.parent / "touchstone"


@pytest.fixture(scope="module")
def run(program):
    """The real command line, whose commands in Python run in this interpreter."""
    def call(*words, **environment):
        return subprocess.run([program, *map(str, words)], capture_output=True, text=True, check=False,
                              env={**os.environ, "TOUCHSTONE_PYTHON": sys.executable, **environment})
    return call


@pytest.fixture(scope="module")
def datasets(run, tmp_path_factory):
    """The same samples in the three formats of `touchstone stream`, pictures as PNG where that can be."""
    folder = tmp_path_factory.mktemp("datasets")
    for format in ("webdataset", "folder", "hdf5"):
        done = run("stream", *_SPEC, "--model", _noisy(folder), "--to", format, "--out", folder / format, "--quiet")
        assert done.returncode == 0, done.stderr
    return folder


def _noisy(folder):
    """A model some of whose fingers report nothing."""
    path = folder / "noisy.yaml"
    path.write_text("touchstone: model/1\nname: noisy\nend_effector: {fingers: 3, spacing_mm: 30}\neffects:\n"
                    "  - gaussian_noise: {sigma_us: 5000}\n  - missed_contact: {probability: 0.1}\n")
    return path


def test_descriptors_that_stand_in_a_folders_csv_are_exported(run, tmp_path):
    """A dataset of descriptors without contact times."""
    read = {}
    for format in ("webdataset", "folder"):
        done = run("stream", "--objects", "lat20", "--samples", "20", "--columns", "descriptor", "--model", _noisy(tmp_path), "--to", format,
                   "--out", tmp_path / format, "--quiet")
        assert done.returncode == 0, done.stderr
        read[format] = np.concatenate([batch["descriptor_us"] for batch in open_dataset(tmp_path / format).batches()])
    np.testing.assert_array_equal(read["folder"], read["webdataset"])
    assert np.isnan(read["folder"]).any() and read["folder"].shape == (20, 3)


@pytest.fixture(scope="module")
def truth(datasets):
    """Every column, from the shards of the C++ writer."""
    columns = {}
    for path in sorted((datasets / "hdf5").glob("*.h5")):
        with h5py.File(path) as file:
            for name, values in file.items():
                columns.setdefault(name, []).append(values[...])
    found = {name: np.concatenate(parts) for name, parts in columns.items()}
    assert len(found["index"]) == ROWS and np.isnan(found["contact_time_us"]).any()
    return found


@pytest.fixture(scope="module", params=["webdataset", "folder", "hdf5"])
def source(request, datasets):
    return datasets / request.param


def _same(found, wanted):
    """Bit for bit, NaN included."""
    found = np.asarray(found)
    assert found.dtype == wanted.dtype and found.shape == wanted.shape
    assert np.array_equal(np.isnan(found), np.isnan(wanted)) if found.dtype.kind == "f" else True
    known = ~np.isnan(wanted) if found.dtype.kind == "f" else np.ones(wanted.shape, bool)
    assert found[known].tobytes() == wanted[known].tobytes()


def _pixels(files):
    return np.stack([np.asarray(Image.open(io.BytesIO(file))) for file in files])


def _array(table, name, wanted):
    """A column of a pyarrow table as an array of its shape."""
    found = table[name].combine_chunks()
    while pa.types.is_list(found.type) or pa.types.is_fixed_size_list(found.type):
        found = found.flatten()
    return found.to_numpy(zero_copy_only=False).reshape(wanted.shape)


def test_parquet_is_bit_for_bit_what_was_simulated(source, truth, tmp_path):
    written = export(source, tmp_path / "out", to="parquet")
    assert written.rows == ROWS and written.files == ("README.md", "data/train-00000-of-00001.parquet", "touchstone.json")
    table = pq.read_table(tmp_path / "out/data")
    for name, values in truth.items():
        if name == "image":
            _same(_pixels(table[name].combine_chunks().field("bytes").to_pylist()), values)
        else:
            _same(_array(table, name, values), values)
    assert table["object_name"].to_pylist() == [("lat00", "lat20")[k] for k in truth["object"]]
    assert table.schema.field("descriptor_us").metadata == {b"unit": b"us"}
    assert json.loads(table.schema.metadata[b"touchstone"])["seed"] == 3


def test_polars_reads_the_parquet(datasets, truth, tmp_path):
    polars = pytest.importorskip("polars")
    export(datasets / "webdataset", tmp_path / "out", to="parquet")
    frame = polars.read_parquet(tmp_path / "out/data/*.parquet")
    assert frame.height == ROWS
    _same(frame["descriptor_us"].to_numpy(), truth["descriptor_us"])
    _same(frame["index"].to_numpy(), truth["index"])
    _same(_pixels(picture["bytes"] for picture in frame["image"]), truth["image"])


def test_the_library_datasets_reads_parquet_and_lerobot(datasets, truth, tmp_path):
    """The folder as load_dataset() takes one from the Hub; a LeRobot dataset as LeRobot itself loads its frames."""
    if not (_CURRENT.parents[1] / "installed").exists() or "datasets" not in (_CURRENT.parents[1] / "installed").read_text():
        pytest.skip("the library datasets is not installed (deploy/test python)")
    export(datasets / "webdataset", tmp_path / "p", to="parquet")
    export(datasets / "webdataset", tmp_path / "l", to="lerobot")
    np.savez(tmp_path / "truth.npz", **truth)
    script = tmp_path / "script.py"
    script.write_text(f"""
import glob, json
import datasets, numpy as np
truth = np.load({str(tmp_path / 'truth.npz')!r})
loaded = datasets.load_dataset({str(tmp_path / 'p')!r}, split="train")
assert isinstance(loaded.features["image"], datasets.Image), loaded.features
pictures = np.stack([np.asarray(picture) for picture in loaded["image"]])
assert np.array_equal(pictures, truth["image"])
columns = loaded.with_format("numpy")
for name in ("descriptor_us", "contact_point_mm", "depth_mm"):
    assert np.array_equal(np.stack(columns[name][:]), truth[name], equal_nan=True), name
# As lerobot's get_hf_features_from_features makes them of meta/info.json.
info = json.load(open({str(tmp_path / 'l/meta/info.json')!r}))
features = {{}}
for name, feature in info["features"].items():
    shape = tuple(feature["shape"])
    features[name] = (datasets.Image() if feature["dtype"] == "image" else datasets.Value(feature["dtype"]) if shape == (1,) else
                      datasets.Sequence(length=shape[0], feature=datasets.Value(feature["dtype"])) if len(shape) == 1 else
                      getattr(datasets, f"Array{{len(shape)}}D")(shape=shape, dtype=feature["dtype"]))
frames = datasets.Dataset.from_parquet(glob.glob({str(tmp_path / 'l/data/*/*.parquet')!r}), features=datasets.Features(features))
assert len(frames) == {ROWS}
assert np.array_equal(np.asarray(frames[7]["observation.images.image"]), truth["image"][7])
columns = frames.with_format("numpy")
for name in ("descriptor_us", "contact_point_mm", "depth_mm"):
    assert np.array_equal(np.stack(columns["observation." + name][:]), truth[name], equal_nan=True), name
""")
    environment = {**{name: value for name, value in os.environ.items() if name != "PYTHONPATH"}, "HF_HOME": str(tmp_path / "hub"),
                   "HF_HUB_OFFLINE": "1"}
    done = subprocess.run([_CURRENT, script], capture_output=True, text=True, check=False, env=environment)
    assert done.returncode == 0, done.stderr


class LeRobotReader:
    """LeRobotDataset v3.0 as its published format says (https://huggingface.co/docs/lerobot/lerobot-dataset-v3): by meta/info.json
    and meta/episodes alone."""

    def __init__(self, root):
        self.root = pathlib.Path(root)
        self.info = json.loads((self.root / "meta/info.json").read_text())
        assert self.info["codebase_version"] == "v3.0"
        self.stats = json.loads((self.root / "meta/stats.json").read_text())
        self.tasks = {row["task_index"]: row["task"] for row in pq.read_table(self.root / "meta/tasks.parquet").to_pylist()}
        self.episodes = pq.ParquetDataset(sorted((self.root / "meta/episodes").glob("*/*.parquet"))).read().to_pylist()

    def frames(self, episode):
        """A table of the episode's frames."""
        found = self.episodes[episode]
        path = self.root / self.info["data_path"].format(chunk_index=found["data/chunk_index"], file_index=found["data/file_index"])
        first = self.episodes[next(k for k, other in enumerate(self.episodes) if all(
            other[name] == found[name] for name in ("data/chunk_index", "data/file_index")))]["dataset_from_index"]
        return pq.read_table(path).slice(found["dataset_from_index"] - first, found["length"])


def test_lerobot_is_as_published_and_bit_for_bit(source, truth, tmp_path):
    export(source, tmp_path / "out", to="lerobot")
    reader = LeRobotReader(tmp_path / "out")
    info = reader.info
    assert (info["total_episodes"], info["total_frames"], info["splits"]) == (ROWS, ROWS, {"train": f"0:{ROWS}"})
    assert reader.tasks == {0: "touch lat00", 1: "touch lat20"} and info["total_tasks"] == 2
    assert info["features"]["observation.images.image"] == {"dtype": "image", "shape": [8, 12, 3], "names": ["height", "width", "channels"]}
    assert info["features"]["observation.state"]["shape"] == [3] and info["features"]["action"]["shape"] == [11]
    for name in ("timestamp", "frame_index", "episode_index", "index", "task_index"):
        assert info["features"][name]["shape"] == [1]
    table = pq.read_table(tmp_path / "out/data")
    assert set(table.column_names) == set(info["features"])
    for name, values in truth.items():
        if name not in ("image", "mask", "index"):
            _same(_array(table, f"observation.{name}", values), values)
    _same(_array(table, "observation.state", truth["descriptor_us"]), truth["descriptor_us"])
    for name in ("image", "mask"):
        _same(_pixels(table[f"observation.images.{name}"].combine_chunks().field("bytes").to_pylist()), truth[name])
    for episode in (0, 255, 256, ROWS - 1):
        (frame,) = reader.frames(episode).to_pylist()
        assert (frame["episode_index"], frame["index"], frame["frame_index"], frame["timestamp"]) == (episode, episode, 0, 0)
        assert reader.episodes[episode]["tasks"] == [reader.tasks[frame["task_index"]]] == [f"touch {frame['observation.object_name']}"]
        assert frame["action"][-1] == np.float32(truth["speed_mm_s"][episode])
    assert reader.stats["observation.state"]["mean"] == pytest.approx(np.nanmean(truth["descriptor_us"].astype(float), 0))
    assert reader.stats["observation.state"]["std"] == pytest.approx(np.nanstd(truth["descriptor_us"].astype(float), 0))
    assert np.shape(reader.stats["observation.images.image"]["max"]) == (3, 1, 1)
    assert np.ravel(reader.stats["observation.images.image"]["mean"]) == pytest.approx(truth["image"].mean((0, 1, 2)) / 255)


def test_webdataset_is_bit_for_bit(source, truth, tmp_path):
    export(source, tmp_path / "out", to="webdataset")
    samples = {}
    for path in sorted((tmp_path / "out").glob("shard-*.tar")):
        with tarfile.open(path) as archive:
            for member in archive:
                key, _, place = member.name.partition(".")
                samples.setdefault(key, {})[place] = archive.extractfile(member).read()
    assert list(samples) == [f"{k:06d}" for k in range(ROWS)]
    # The shards of the program itself write -0 without a point.
    described = [json.loads(sample["json"], parse_int=lambda text: -0.0 if text == "-0" else int(text)) for sample in samples.values()]
    for name in ("target_mm", "approach", "lateral", "standoff_mm", "speed_mm_s", "index"):
        _same(np.array([row[name] for row in described], truth[name].dtype), truth[name])
    assert [row["object"] for row in described] == [("lat00", "lat20")[k] for k in truth["object"]]
    for name in ("descriptor_us", "contact_time_us", "contact_point_mm", "normal", "depth_mm", "mask"):
        _same(np.stack([np.load(io.BytesIO(sample[f"{name}.npy"])) for sample in samples.values()]), truth[name])
    _same(_pixels(sample["image.png"] for sample in samples.values()), truth["image"])


def test_a_webdataset_is_copied_and_stays_one_of_this_program(datasets, run, tmp_path):
    export(datasets / "webdataset", tmp_path / "out", to="webdataset")
    done = run("dataset", "verify", tmp_path / "out")
    assert done.returncode == 0 and "every byte as it was written" in done.stderr


def test_hdf5_is_bit_for_bit(source, truth, tmp_path):
    export(source, tmp_path / "out", to="hdf5")
    with h5py.File(tmp_path / "out/data.h5") as file:
        assert list(file.attrs["objects"]) == [b"lat00", b"lat20"]
        for name, values in truth.items():
            _same(file[name][...], values)
        assert file["depth_mm"].attrs["unit"] == "mm"


def test_mcap_is_bit_for_bit(source, truth, tmp_path):
    reader = pytest.importorskip("mcap.reader")
    export(source, tmp_path / "out", to="mcap")
    found = {}
    with open(tmp_path / "out/data.mcap", "rb") as stream:
        for _, channel, message in reader.make_reader(stream).iter_messages():
            found.setdefault(channel.topic, []).append((message.log_time, json.loads(message.data)))
    assert {topic: len(messages) for topic, messages in found.items()} == dict.fromkeys(["/touch", "/camera", "/depth", "/mask"], ROWS)
    assert [at for at, _ in found["/touch"]] == [k * 10**9 for k in range(ROWS)]
    for name, values in truth.items():
        if name not in ("image", "depth_mm", "mask"):
            _same(np.array([message[name] for _, message in found["/touch"]], values.dtype), values)
    decoded = {topic: [touchstone_base64(message["data"]) for _, message in found[topic]] for topic in ("/camera", "/depth", "/mask")}
    _same(_pixels(decoded["/camera"]), truth["image"])
    _same(np.stack([np.frombuffer(data, "<f4").reshape(8, 12) for data in decoded["/depth"]]), truth["depth_mm"])
    _same(np.stack([np.frombuffer(data, "u1").reshape(8, 12) for data in decoded["/mask"]]), truth["mask"])


def touchstone_base64(text):
    import base64

    return base64.b64decode(text)


@pytest.mark.parametrize("to", FORMATS)
def test_the_card_says_units_provenance_and_how_to_make_it_again(datasets, run, tmp_path, to):
    export(datasets / "folder", tmp_path / "out", to=to)
    card = (tmp_path / "out/README.md").read_text()
    front = card.split("---\n")[1]
    yaml = pytest.importorskip("yaml")
    assert yaml.safe_load(front)["pretty_name"] == "folder"
    for words in ("1000 rows", "| `depth_mm` | float32 | 8 x 12 | mm |", "seed 3", "gaussian_noise", '"radius_ratio"', "lat20: `",
                  "touchstone stream --like touchstone.json"):
        assert words in card
    again = run("stream", "--like", tmp_path / "out/touchstone.json", "--out", tmp_path / "again", "--quiet")
    assert again.returncode == 0, again.stderr
    for shard in (datasets / "folder").glob("shard-*"):
        assert (tmp_path / "again" / shard.name / "touches.csv").read_bytes() == (shard / "touches.csv").read_bytes()


# --- What is not exported

def test_a_changed_shard_is_refused_and_nothing_is_left(datasets, tmp_path):
    import shutil

    shutil.copytree(datasets / "webdataset", tmp_path / "data")
    with open(tmp_path / "data/shard-000001.tar", "r+b") as file:
        file.seek(5000)
        file.write(b"X")
    with pytest.raises(touchstone.Refused, match=r"shard-000001.tar is damaged or was changed"):
        export(tmp_path / "data", tmp_path / "out", to="parquet")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["data"]


def test_a_dataset_that_is_not_finished_is_refused(run, tmp_path):
    assert run("stream", *_SPEC, "--shards", "0/2", "--out", tmp_path / "data", "--quiet").returncode == 0
    with pytest.raises(touchstone.Refused, match="not finished"):
        export(tmp_path / "data", tmp_path / "out")


def test_what_is_there_is_replaced_only_if_it_is_an_export(datasets, tmp_path):
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine/thesis.txt").write_text("all of it")
    with pytest.raises(touchstone.InvalidRequest, match="is no export"):
        export(datasets / "webdataset", tmp_path / "mine", to="hdf5", force=True)
    export(datasets / "webdataset", tmp_path / "out", to="hdf5")
    with pytest.raises(touchstone.InvalidRequest, match="exists"):
        export(datasets / "webdataset", tmp_path / "out", to="parquet")
    written = export(datasets / "webdataset", tmp_path / "out", to="parquet", force=True)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["mine", "out"] and "data.h5" not in written.files
    with pytest.raises(touchstone.InvalidRequest, match="is what is exported"):
        export(datasets / "webdataset", datasets / "webdataset", force=True)


# --- The command

def test_the_command_says_what_it_wrote(datasets, run, tmp_path):
    done = run("export", datasets / "webdataset", "--to", "parquet", "-o", tmp_path / "out", "--json")
    assert done.returncode == 0, done.stderr
    told = json.loads(done.stdout)
    assert told["rows"] == ROWS and told["bytes"] == sum(path.stat().st_size for path in (tmp_path / "out").rglob("*") if path.is_file())
    assert done.stderr == f"wrote {tmp_path / 'out'}: 1000 rows as parquet, 3 files, {told['bytes'] / 1e6:.1f} MB\n"


@pytest.mark.parametrize("words, exit_code, message", [
    (["data", "--to", "parqet", "-o", "x"], 2, "--to: unknown format 'parqet', did you mean 'parquet'?"),
    (["data", "--to", "parquet"], 2, "-o/--out is required (see touchstone export --help)"),
    (["nothing", "--to", "parquet", "-o", "x"], 2, "nothing is not there"),
    (["data", "--to", "parquet", "-o", "x/y/z"], 2, "x/y is not there"),
    (["data", "--to", "parquet", "-o", "x", "--fource"], 2, "unknown option '--fource', did you mean '--force'?"),
    (["data", "more", "--to", "parquet", "-o", "x"], 2, "'more' is one argument too many"),
    ([".", "--to", "parquet", "-o", "x"], 2, "there is no dataset.json"),
    (["a.txt", "--to", "parquet", "-o", "x"], 2, "a measurement file (.csv)"),
    (["bad.csv", "--to", "parquet", "-o", "x"], 2, "bad.csv:2: speed_mm_s is 'fast', not a number"),
    (["bad.csv", "--to", "mcap", "-o", "x"], 2, "bad.csv:1: column 'standoff_mm' is missing"),
])
def test_mistakes_are_named(datasets, run, tmp_path, monkeypatch, words, exit_code, message):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "a.txt").write_text("text")
    (tmp_path / "bad.csv").write_text("touch,object,speed_mm_s\n0,lat20,fast\n")
    (tmp_path / "data").symlink_to(datasets / "webdataset")
    done = run("export", *words)
    assert done.returncode == exit_code, done.stderr
    assert done.stderr.startswith("touchstone: error: ") and message in done.stderr
    assert not (tmp_path / "x").exists()


def test_help_has_the_layout_of_every_command(run):
    done = run("export", "--help", COLUMNS="80")
    assert done.returncode == 0 and done.stdout == run("help", "export", COLUMNS="80").stdout
    assert done.stdout.index("Examples:\n  touchstone export") < done.stdout.index("Usage: touchstone export [OPTIONS] DATASET")
    assert all(len(line) <= 80 or "  touchstone " in line for line in done.stdout.splitlines())
    # The list of commands and the completion have what the parser has.
    listed = run("help").stdout
    assert "export Writes a dataset or a session in a format of other tools" in " ".join(listed.split())
    completed = next(line for line in run("completion", "bash").stdout.splitlines() if line.strip().startswith("' export')"))
    from touchstone.formats.__main__ import export_parser

    options = completed.split("options='")[1].split("'")[0].split()
    assert sorted(options) == sorted(name for action in export_parser()._actions for name in action.option_strings)


def test_a_missing_package_is_named_with_what_installs_it(datasets, monkeypatch, tmp_path):
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    with pytest.raises(touchstone.Refused, match=r"export to Parquet needs the Python package pyarrow. Install it with: pip install pyarrow"):
        export(datasets / "webdataset", tmp_path / "out", to="parquet")


# --- Sessions

@pytest.fixture(scope="module")
def measured(run, tmp_path_factory):
    """A measurement file of 384 touches and the journal that it was put into."""
    folder = tmp_path_factory.mktemp("session")
    for words in (["plan", "lat20,lat00", "--plan", "faces", "-o", folder / "plan.csv"],
                  ["touch", "--plan", folder / "plan.csv", "--model", _noisy(folder), "--seed", "4", "-o", folder / "set.csv"],
                  ["session", "import", folder / "set.csv", "-o", folder / "set.db"]):
        done = run(*words)
        assert done.returncode == 0, done.stderr
    return folder


@pytest.mark.parametrize("ending", ["csv", "db"])
def test_a_session_goes_to_parquet_bit_for_bit(measured, tmp_path, ending):
    export(measured / f"set.{ending}", tmp_path / "out", to="parquet")
    table = pq.read_table(tmp_path / "out/data").to_pylist()
    rows = touchstone.read_plan(measured / "set.csv")
    assert len(table) == len(rows) == 384
    for found, row in zip(table, rows):
        assert (found["touch"], found["object_name"], found["session_time_s"]) == (row.touch, row.object, row.session_time_s)
        _same(np.array(found["contact_time_us"]), np.array(row.time_us))
    assert any(np.isnan(row.time_us).any() for row in rows)


@pytest.mark.parametrize("to", FORMATS)
def test_a_session_goes_to_every_format(measured, tmp_path, to):
    written = export(measured / "set.db", tmp_path / "out", to=to)
    assert written.rows == 384 and "Measurement file" in (tmp_path / "out/README.md").read_text()


def test_the_session_as_mcap_and_hdf5_is_what_sessions_are_exported_to(measured, run, tmp_path):
    export(measured / "set.db", tmp_path / "h", to="hdf5")
    assert run("session", "export", measured / "set.db", "-o", tmp_path / "set.h5").returncode == 0
    assert (tmp_path / "h/session.h5").read_bytes() == (tmp_path / "set.h5").read_bytes()
    export(tmp_path / "set.h5", tmp_path / "m", to="mcap")
    touchstone_mcap.export(tmp_path / "set.h5", tmp_path / "set.mcap")
    assert (tmp_path / "m/session.mcap").read_bytes() == (tmp_path / "set.mcap").read_bytes()
