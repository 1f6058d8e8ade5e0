"""Gives the distribution the version of the package that it runs on; see pyproject.toml."""

import pathlib
import re

from setuptools import setup

_VERSION_FILE = pathlib.Path(__file__).resolve().parent.parent / "python/touchstone/version.py"

setup(version=re.search(r'^__version__ = "(.+)"', _VERSION_FILE.read_text(encoding="utf-8"), re.MULTILINE).group(1))
