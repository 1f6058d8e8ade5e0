"""Samples as a data source of Ray Data, on a local Ray with two workers, on PyPI's current packages."""

import os
import pathlib
import subprocess

import pytest

_ENVIRONMENT = pathlib.Path(__file__).resolve().parents[3] / "build/current_venv"
_BEGIN = """
import os, pathlib, signal, sys
import numpy as np, ray, touchstone
from touchstone.ray import TouchstoneDatasource
from touchstone.samples import Samples

target, scratch = sys.argv[1:]
ray.init(num_cpus=2, include_dashboard=False, log_to_driver=False, object_store_memory=200_000_000, _temp_dir=scratch)
made = touchstone.connect(target).samples(["lat00", "lat20"], samples=1000, seed=5, columns=["object", "descriptor"])
wanted = made[:]

def compare(dataset):
    rows = dataset.take_all()
    rows.sort(key=lambda row: row["index"])
    assert [row["index"] for row in rows] == list(range(1000)), len(rows)
    assert np.array_equal([row["object"] for row in rows], wanted["object"])
    assert np.array([row["descriptor_us"] for row in rows]).tobytes() == wanted["descriptor_us"].tobytes()
"""


def run(tmp_path_factory, target, body):
    if not (_ENVIRONMENT / "installed").exists():
        pytest.skip("Ray is not installed (deploy/test python)")
    folder = tmp_path_factory.mktemp("ray")
    script = folder / "script.py"
    script.write_text(_BEGIN + body)
    # Sockets lie in its folder, and their paths may have 107 letters at most: not below tmp_path.
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    environment.update(RAY_USAGE_STATS_ENABLED="0", RAY_DATA_DISABLE_PROGRESS_BARS="1")
    done = subprocess.run([_ENVIRONMENT / "bin/python", script, target, f"/tmp/touchstone-ray-{os.getpid()}"],
                          capture_output=True, text=True, timeout=400, env=environment, check=False)
    assert done.returncode == 0, done.stdout[-2000:] + done.stderr[-6000:]
    return done.stdout


@pytest.mark.second_tier("repeated: read without a loss, by the same workers")
def test_two_workers_read_every_sample_once_with_the_bytes_of_the_stream(server, tmp_path_factory):
    run(tmp_path_factory, server.target, """
dataset = ray.data.read_datasource(TouchstoneDatasource(made, rows_per_block=100), override_num_blocks=4)
assert dataset.count() == 1000
compare(dataset)
""")


def test_what_a_killed_worker_had_read_is_read_again(server, tmp_path_factory):
    said = run(tmp_path_factory, server.target, """
class Deadly(Samples):
    # The process that first comes to sample 600 dies there, as by the kernel that needs memory.
    def __getitem__(self, index):
        here = pathlib.Path(scratch) / "died"
        if isinstance(index, slice) and index.start == 600 and not here.exists():
            here.write_text(str(os.getpid()))
            os.kill(os.getpid(), signal.SIGKILL)
        return super().__getitem__(index)

made.__class__ = Deadly
# Read while the driver makes the source: only workers may die.
source = TouchstoneDatasource(made, rows_per_block=100)
compare(ray.data.read_datasource(source, override_num_blocks=2))
died = int((pathlib.Path(scratch) / "died").read_text())
assert died != os.getpid()
print("killed", died)
""")
    assert "killed" in said
