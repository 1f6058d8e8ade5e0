"""The README's Python blocks run as they stand."""

import os
import pathlib
import re
import subprocess
import sys

import pytest

import touchstone

_README = pathlib.Path(__file__).resolve().parents[1] / "README.md"
_BLOCKS = re.findall(r"```python\n(.*?)```", _README.read_text(encoding="utf-8"), re.DOTALL)


@pytest.mark.parametrize("block", _BLOCKS, ids=[f"block{k}" for k in range(len(_BLOCKS))])
def test_a_block_runs(block, server, tmp_path):
    if "import torch" in block:
        pytest.importorskip("torch", reason="PyTorch is not installed; this block needs it.")
    script = tmp_path / "block.py"
    script.write_text(block.replace("127.0.0.1:50051", server.target))
    package = os.path.dirname(os.path.dirname(touchstone.__file__))
    done = subprocess.run([sys.executable, "-W", "error", script], capture_output=True, text=True, timeout=120, cwd=tmp_path,
                          env={**os.environ, "PYTHONPATH": package}, check=False)
    assert done.returncode == 0, done.stderr
    assert not done.stderr
