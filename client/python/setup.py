"""Builds wheel and sdist with the stubs of proto/touchstone/v1, generated here. See pyproject.toml.

TOUCHSTONE_PROGRAMS names the folder that `cmake --install` filled with the components runtime, server and gateway: then its
programs, meshes and protocol become a part of the wheel, with a command for each program (deploy/package calls it so). Without
it the wheel is the client alone, for every machine.
"""

import importlib.machinery
import importlib.util
import os
import pathlib
import re
import shutil
import sys

from setuptools import Distribution, setup
from setuptools.command.build_py import build_py

try:
    from setuptools.command.bdist_wheel import bdist_wheel
except ImportError:  # before setuptools 70.1
    from wheel.bdist_wheel import bdist_wheel  # type: ignore[no-redef,import-not-found]

HERE = pathlib.Path(__file__).resolve().parent
PROGRAMS = os.environ.get("TOUCHSTONE_PROGRAMS")


def generate_stubs():
    loader = importlib.machinery.SourceFileLoader("touchstone_generate", str(HERE / "generate"))
    spec = importlib.util.spec_from_loader(loader.name, loader)
    assert spec is not None  # it is, where a loader is given
    module = importlib.util.module_from_spec(spec)
    before, sys.dont_write_bytecode = sys.dont_write_bytecode, True
    try:
        loader.exec_module(module)
    finally:
        sys.dont_write_bytecode = before
    try:
        module.generate()
    except module.GenerateError as error:
        raise SystemExit(f"touchstone: {error}") from None


def dependencies():
    """What the stubs run with: those of newer generators refuse older libraries, and protobuf's two majors newer."""
    grpc, protobuf = "grpcio>=1.51", "protobuf>=4.21"
    stubs = "".join(path.read_text(encoding="utf-8") for path in sorted((HERE / "touchstone/v1").glob("*.py")))
    found = re.search(r"GRPC_GENERATED_VERSION = '([\d.]+)'", stubs)
    if found:
        grpc = f"grpcio>={found[1]}"
    found = re.search(r"ValidateProtobufRuntimeVersion\(\s*[\w.]+,\s*(\d+),\s*(\d+),\s*(\d+)", stubs)
    if found:
        protobuf = f"protobuf>={found[1]}.{found[2]}.{found[3]},<{int(found[1]) + 2}"
    return [grpc, protobuf, "numpy>=1.21"]


class BuildPy(build_py):
    def run(self):
        super().run()
        if PROGRAMS:
            for part in ("bin", "share"):
                target = pathlib.Path(self.build_lib) / "touchstone_sim" / part
                shutil.rmtree(target, ignore_errors=True)  # of an earlier build
                shutil.copytree(pathlib.Path(PROGRAMS) / part, target)


class WheelOfPrograms(bdist_wheel):
    """Of one system, whose programs it holds, but of every Python."""

    def get_tag(self):
        return ("py3", "none", super().get_tag()[2])


class WithPrograms(Distribution):
    def has_ext_modules(self):
        return True


# First of all: setuptools wants to see every package, and a fresh clone has no stubs yet.
generate_stubs()
arguments = {"packages": ["touchstone", "touchstone.formats", "touchstone.v1"], "install_requires": dependencies(), "entry_points": {},
             "cmdclass": {"build_py": BuildPy}}
if PROGRAMS:
    names = sorted(path.name for path in (pathlib.Path(PROGRAMS) / "bin").iterdir())
    arguments["packages"] += ["touchstone_sim"]
    arguments["entry_points"] = {"console_scripts": [f"{name} = touchstone_sim:{name.replace('-', '_')}" for name in names]}
    arguments["cmdclass"]["bdist_wheel"] = WheelOfPrograms
    arguments["distclass"] = WithPrograms
setup(**arguments)
