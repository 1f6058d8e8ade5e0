"""Build hooks: the stubs of proto/touchstone/v1 are generated into every wheel and sdist. See pyproject.toml."""

import importlib.machinery
import importlib.util
import pathlib
import sys

from setuptools import setup
from setuptools.command.build_py import build_py
from setuptools.command.egg_info import egg_info
from setuptools.command.sdist import sdist

HERE = pathlib.Path(__file__).resolve().parent


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


class EggInfo(egg_info):
    """Metadata comes first, and setuptools wants to see every package by then: a fresh clone has no stubs yet."""

    def run(self):
        generate_stubs()
        super().run()


class BuildPy(build_py):
    def run(self):
        generate_stubs()
        super().run()


class Sdist(sdist):
    def run(self):
        generate_stubs()
        super().run()


setup(cmdclass={"egg_info": EggInfo, "build_py": BuildPy, "sdist": Sdist})
