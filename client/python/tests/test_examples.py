"""The programs of EXAMPLES.md and the cells of the notebook run as they stand; the README's promises are tests that are there."""

import ast
import json
import os
import pathlib
import re
import subprocess
import sys

import pytest

import touchstone

HERE = pathlib.Path(__file__).resolve().parent
PROGRAMS = re.findall(r"## \d+\. (.*?)\n.*?```python\n(.*?)```", (HERE.parent / "EXAMPLES.md").read_text(encoding="utf-8"), re.DOTALL)
NOTEBOOK = HERE.parent / "examples/first_steps.ipynb"
# What each library is needed by, besides an import of it.
NEEDS = {"torch": "import torch", "matplotlib": "matplotlib", "pandas": ".to_pandas()"}


def run(text, folder):
    script = folder / "program.py"
    script.write_text(text)
    package = os.path.dirname(os.path.dirname(touchstone.__file__))
    done = subprocess.run([sys.executable, "-W", "error", script], capture_output=True, text=True, timeout=120, cwd=folder, check=False,
                          env={**os.environ, "PYTHONPATH": package, "MPLBACKEND": "Agg"})
    assert done.returncode == 0, done.stderr
    assert not done.stderr
    return done.stdout


def test_there_are_five_programs():
    assert len(PROGRAMS) == 5


@pytest.mark.parametrize("program", [text for _, text in PROGRAMS], ids=[title.split()[0] + str(k) for k, (title, _) in enumerate(PROGRAMS, 1)])
def test_a_program_runs(program, server, tmp_path):
    for library, sign in NEEDS.items():
        if sign in program:
            pytest.importorskip(library, reason=f"{library} is not installed; this program needs it.")
    assert run(program.replace("127.0.0.1:50051", server.target), tmp_path)


def shown(cell):
    """The cell, with what a notebook does with its last expression: its HTML, else its repr."""
    body = ast.parse(cell).body
    if not isinstance(body[-1], ast.Expr) or cell.rstrip().endswith(";"):
        return cell
    last = ast.unparse(body[-1])
    return f"{ast.unparse(ast.Module(body[:-1], []))}\n_last = {last}\nprint(getattr(_last, '_repr_html_', _last.__repr__)())\n"


def test_the_notebook_runs_and_shows_its_tables(tmp_path):
    pytest.importorskip("matplotlib", reason="matplotlib is not installed; the notebook needs it.")
    notebook = json.loads(NOTEBOOK.read_text(encoding="utf-8"))
    cells = ["".join(cell["source"]) for cell in notebook["cells"] if cell["cell_type"] == "code"]
    assert notebook["nbformat"] == 4 and all(cell["outputs"] == [] for cell in notebook["cells"] if cell["cell_type"] == "code")
    said = run("\n".join(map(shown, cells)), tmp_path)
    assert said.count("<table>") == 5 and "object_push" in said


def test_what_the_readme_promises_first_is_tested():
    first = (HERE.parent / "README.md").read_text(encoding="utf-8").split("\n## ")[0]
    assert [line[:6] for line in first.splitlines() if re.match(r"\d\. ", line)] == ["1. **R", "2. **W", "3. **A"]
    named = re.findall(r"`(test_\w+)`", first)
    written = "".join(path.read_text(encoding="utf-8") for path in HERE.glob("test_*.py"))
    assert len(named) == 5 and all(f"def {name}(" in written for name in named)
