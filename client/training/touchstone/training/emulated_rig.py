"""A gateway to a rig: the one that was named, or an emulated arm, end effector and camera of this process."""

from __future__ import annotations

import pathlib
import subprocess
import tempfile
import threading
from collections.abc import Sequence

import touchstone
from touchstone.own_server import find_server, start_bound

# Simulated seconds in one second, unless the options say another number; a touch takes five of them.
SPEEDUP = 120


class EmulatedRig:
    """Attributes:
      client: of the gateway.
    """

    def __init__(self, target: str, options: Sequence[str] = ()):
        """`target`: HOST:PORT of a gateway; "": starts an emulator with `options` and a gateway, which end with stop() and
        with this process, even if that is killed."""
        self._programs: list[subprocess.Popen] = []
        self._folder: tempfile.TemporaryDirectory | None = None
        if not target:
            self._folder = tempfile.TemporaryDirectory(prefix="touchstone-rig-")
            programs = pathlib.Path(find_server()).parent
            config = self._start("ready ", programs / "touchstone-rig-emulator", "--dir", f"{self._folder.name}/rig",
                                 *([] if "--speedup" in options else ["--speedup", SPEEDUP]), "--powered", *options)
            target = self._start("listening on ", programs / "touchstone-gateway", "--listen", "127.0.0.1:0", "--config", config)
        self.client = touchstone.connect(target)

    def _start(self, ready: str, *command) -> str:
        """What follows `ready` in the line that begins so."""
        log = pathlib.Path(self._folder.name) / f"{pathlib.Path(command[0]).name}.log"
        with open(log, "w", encoding="utf-8") as errors:
            process = start_bound(command, errors)
        self._programs.append(process)
        for line in process.stdout:
            if line.startswith(ready):
                # What it says later is of no use here, but a full pipe would stop it.
                threading.Thread(target=process.stdout.read, daemon=True).start()
                return line[len(ready):].strip()
        said = log.read_text(encoding="utf-8")[-2000:]
        self.stop()
        raise touchstone.SourceUnreachable(f"{command[0]} ended: {said}")

    def stop(self) -> None:
        """Ends what was started here; the gateway first, so that it loses nothing."""
        if hasattr(self, "client"):
            self.client.close()
        for process in reversed(self._programs):
            process.stdin.close()
            process.wait(timeout=60)
        self._programs = []
        if self._folder is not None:
            self._folder.cleanup()
            self._folder = None
