"""The commands of the wheel that holds Touchstone's programs: each becomes the program of its name.

Apart from the package `touchstone`, whose imports (gRPC, NumPy) would take longer than many a command.
"""

from __future__ import annotations

import functools
import os
import pathlib
import sys

PROGRAMS = pathlib.Path(__file__).parent / "bin"


def _become(name: str) -> None:
    program = PROGRAMS / name
    # Commands that are Python modules run where the wheel lies (client/cli/python_command.cpp).
    os.environ.setdefault("TOUCHSTONE_PYTHON", sys.executable)
    os.execv(program, [str(program), *sys.argv[1:]])


touchstone = functools.partial(_become, "touchstone")
touchstone_server = functools.partial(_become, "touchstone-server")
touchstone_gateway = functools.partial(_become, "touchstone-gateway")
touchstone_probe = functools.partial(_become, "touchstone-probe")
touchstone_rig_emulator = functools.partial(_become, "touchstone-rig-emulator")
