"""Programs of the build; TOUCHSTONE_BIN names their folder."""
import os
import pathlib

import pytest

REPOSITORY = pathlib.Path(__file__).resolve().parents[2]


@pytest.fixture(scope="session")
def bin_folder():
    folder = pathlib.Path(os.environ.get("TOUCHSTONE_BIN") or REPOSITORY / "build/release/bin")
    if not (folder / "touchstone").exists():
        pytest.fail(f"{folder}/touchstone does not exist; build it, or set TOUCHSTONE_BIN.")
    return folder
