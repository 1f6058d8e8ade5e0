"""Samples as a data source of Grain, with its own shuffling, checkpoints and worker processes, on PyPI's current packages."""

import os
import pathlib
import subprocess
import textwrap

import pytest

_PYTHON = pathlib.Path(__file__).resolve().parents[3] / "build/current_venv/bin/python"


def run(tmp_path, target, body):
    """A script with `samples`, a thousand of them, in the environment that has Grain."""
    if not _PYTHON.exists() or not (_PYTHON.parents[1] / "installed").exists():
        pytest.skip("Grain is not installed (deploy/test python)")
    script = tmp_path / "script.py"
    script.write_text("\n".join([
        "import grain, touchstone",
        "def main():",
        f"    client = touchstone.connect({target!r})",
        "    samples = client.samples(['lat00', 'lat20'], samples=1000, seed=5, columns=('index', 'descriptor'))",
        textwrap.indent(textwrap.dedent(body), "    "),
        "if __name__ == '__main__':",
        "    main()",
    ]))
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    done = subprocess.run([str(_PYTHON), str(script)], capture_output=True, text=True, timeout=240, env=environment, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def test_a_shuffled_dataset_is_every_sample_once_and_resumes(server, tmp_path):
    run(tmp_path, server.target, """
        assert isinstance(samples, grain.sources.RandomAccessDataSource)
        dataset = grain.MapDataset.source(samples).shuffle(seed=1).batch(100)
        iterator = iter(dataset.to_iter_dataset())
        first = [next(iterator)["index"].tolist() for _ in range(4)]
        state = iterator.get_state()
        rest = [batch["index"].tolist() for batch in iterator]
        iterator = iter(dataset.to_iter_dataset())
        iterator.set_state(state)
        assert [batch["index"].tolist() for batch in iterator] == rest
        assert sorted(sum(first + rest, [])) == list(range(1000))
    """)


def test_workers_of_its_own_read_the_same_bytes(server, tmp_path):
    run(tmp_path, server.target, """
        import numpy as np
        sampler = grain.samplers.IndexSampler(num_records=len(samples), shuffle=True, seed=3, num_epochs=1)
        loader = grain.DataLoader(data_source=samples, sampler=sampler, worker_count=2,
                                  operations=[grain.transforms.Batch(100)])
        seen = list(loader)
        indices = np.concatenate([batch["index"] for batch in seen])
        assert sorted(indices) == list(range(1000))
        descriptors = np.concatenate([batch["descriptor_us"] for batch in seen])
        assert np.array_equal(descriptors, samples[indices.astype(int)]["descriptor_us"])
    """)
