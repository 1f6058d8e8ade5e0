"""The wheel with everything, of stand-ins for the programs: what it holds and what its commands start.

deploy/test wheel builds the real one and tries it in fresh roots.
"""

import os
import pathlib
import shutil
import subprocess
import sys
import zipfile

import pytest

ROOT = pathlib.Path(__file__).resolve().parents[3]
PROGRAMS = ["touchstone", "touchstone-gateway", "touchstone-probe", "touchstone-rig-emulator", "touchstone-server"]


def copy_of_the_sources(folder):
    """What a wheel is built from, in a place of its own: a build leaves files beside the sources."""
    leave_out = shutil.ignore_patterns("build", "dist", "*.egg-info", "v1", "__pycache__", "tests")
    shutil.copytree(ROOT / "client/python", folder / "client/python", ignore=leave_out)
    shutil.copytree(ROOT / "proto", folder / "proto")
    return folder / "client/python"


def build(sources, folder, *options, **environment):
    done = subprocess.run([sys.executable, "-m", "pip", "wheel", "--quiet", "--no-deps", "--wheel-dir", folder, *options, sources],
                          capture_output=True, text=True, check=False, env={**os.environ, **environment})
    assert done.returncode == 0, done.stderr
    (wheel,) = folder.glob("*.whl")
    return wheel


@pytest.fixture(scope="module")
def wheel(tmp_path_factory):
    folder = tmp_path_factory.mktemp("wheel")
    programs = folder / "programs"
    (programs / "bin").mkdir(parents=True)
    for name in PROGRAMS:
        (programs / "bin" / name).write_text(f'#!/bin/sh\n[ "$1" != --python ] || exec echo "$TOUCHSTONE_PYTHON"\necho "{name}:" "$@"\n')
        (programs / "bin" / name).chmod(0o755)
    shutil.copytree(ROOT / "meshes", programs / "share/touchstone/meshes")
    return build(copy_of_the_sources(folder), folder / "out", "--no-build-isolation", "--no-index", TOUCHSTONE_PROGRAMS=str(programs))


@pytest.fixture(scope="module")
def installed(wheel, tmp_path_factory):
    folder = tmp_path_factory.mktemp("installed")
    subprocess.run([sys.executable, "-m", "pip", "install", "--quiet", "--no-deps", "--no-index", "--target", folder, wheel], check=True)
    return folder


def run_there(installed, *command):
    environment = {**os.environ, "PYTHONPATH": str(installed)}
    environment.pop("TOUCHSTONE_SERVER_PROGRAM")
    return subprocess.run(command, capture_output=True, text=True, check=True, env=environment).stdout


def test_it_holds_package_stubs_programs_and_meshes(wheel):
    with zipfile.ZipFile(wheel) as file:
        modes = {info.filename: info.external_attr >> 16 for info in file.infolist()}
    stubs = [f"touchstone/v1/{proto.stem}{end}" for proto in (ROOT / "proto/touchstone/v1").glob("*.proto")
             for end in ("_pb2.py", "_pb2_grpc.py", "_pb2.pyi")]
    wanted = {"touchstone/__init__.py", "touchstone/py.typed", "touchstone/v1/__init__.py", "touchstone_sim/__init__.py",
              "touchstone_sim/share/touchstone/meshes/manifest.json", *stubs, *(f"touchstone_sim/bin/{name}" for name in PROGRAMS)}
    assert wanted <= modes.keys()
    assert all(modes[f"touchstone_sim/bin/{name}"] & 0o111 for name in PROGRAMS)


def test_it_is_of_one_system_and_every_python(wheel):
    assert wheel.name.startswith("touchstone_sim-")
    assert wheel.name.endswith("-py3-none-linux_x86_64.whl")


@pytest.mark.parametrize("name", PROGRAMS)
def test_command_becomes_the_program_of_its_name(installed, name):
    assert run_there(installed, installed / "bin" / name, "a b", "--flag") == f"{name}: a b --flag\n"


def test_commands_in_python_run_where_the_wheel_lies(installed):
    assert run_there(installed, installed / "bin/touchstone", "--python") == f"{sys.executable}\n"


def test_own_server_is_that_of_the_wheel(installed):
    found = run_there(installed, sys.executable, "-c", "from touchstone.own_server import find_server; print(find_server())")
    assert pathlib.Path(found.strip()) == installed / "touchstone_sim/bin/touchstone-server"


@pytest.mark.second_tier("long: a build in an environment of its own, with what it fetches from PyPI")
def test_source_builds_from_pypi_alone(tmp_path):
    reached = subprocess.run([sys.executable, "-m", "pip", "download", "--quiet", "--no-deps", "--retries", "1", "--timeout", "10",
                              "--dest", tmp_path / "reached", "wheel"], check=False, capture_output=True).returncode == 0
    if not reached:
        pytest.skip("PyPI cannot be reached")
    # No protoc, and nothing else, in PATH.
    wheel = build(copy_of_the_sources(tmp_path), tmp_path / "out", PATH=str(tmp_path / "empty"))
    assert wheel.name.endswith("-py3-none-any.whl")
    with zipfile.ZipFile(wheel) as file:
        assert "touchstone/v1/source_pb2_grpc.py" in file.namelist()
        assert not [name for name in file.namelist() if name.startswith("touchstone_sim/")]
