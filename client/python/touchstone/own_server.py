"""A touchstone-server of this process: touchstone.connect() without an address starts it, and it ends with the process."""

from __future__ import annotations

import atexit
import os
import pathlib
import queue
import re
import shutil
import signal
import subprocess
import threading
import time
from collections.abc import Sequence
from typing import IO, Any

from .errors import SourceUnreachable

_READY = re.compile(r"listening on (127\.0\.0\.1:\d+)")
_STOP_WITHIN_S = 15.0
# Ends the server as soon as this process closes its end of standard input, which the kernel does should it be killed.
# (prctl's PR_SET_PDEATHSIG goes by the thread that started it, not by the process.)
_UNTIL_STDIN_ENDS = """
exec 3<&0
"$@" </dev/null 3<&- &
server=$!
{ read -r _ <&3; kill "$server"; } >/dev/null 2>&1 &
exec 3<&-
wait "$server"
"""


def find_server() -> str:
    """The program: TOUCHSTONE_SERVER_PROGRAM, else that of this wheel, else from PATH, else of the build beside this source tree."""
    named = os.environ.get("TOUCHSTONE_SERVER_PROGRAM")
    if named:
        if os.access(named, os.X_OK):
            return named
        raise SourceUnreachable(f"TOUCHSTONE_SERVER_PROGRAM is {named!r}, which is no program that can be run.")
    here = pathlib.Path(__file__).resolve()
    bundled = str(here.parents[1] / "touchstone_sim/bin/touchstone-server")
    built = str(here.parents[3] / "build/release/bin/touchstone-server")
    for found in (bundled, shutil.which("touchstone-server"), built):
        if found and os.access(found, os.X_OK):
            return found
    raise SourceUnreachable(
        "connect() without an address starts a touchstone-server of its own, and there is none in PATH. Put it there, "
        'name it in TOUCHSTONE_SERVER_PROGRAM, or give the address of one that runs: connect("HOST:PORT").'
    )


def start_bound(command: Sequence[str | os.PathLike[str]], stderr: int | IO[Any] | None) -> subprocess.Popen[str]:
    """A program whose output can be read and that does not outlive this process, even if that is killed.

    Closing its standard input ends it (SIGTERM). In a session of its own: Ctrl-C at a terminal is for this process, which
    then ends the other.
    """
    return subprocess.Popen(["sh", "-c", _UNTIL_STDIN_ENDS, "sh", *map(str, command)], text=True, stdin=subprocess.PIPE,
                            stdout=subprocess.PIPE, stderr=stderr, start_new_session=True)


class OwnServer:
    """A touchstone-server on a free port of this machine, for this process alone.

    It ends with stop() and with the process, even if that is killed.

    Attributes:
      target: "127.0.0.1:port".
    """

    def __init__(self, options: Sequence[str] = (), *, timeout_s: float = 30.0):
        """Waits until it serves. SourceUnreachable with its own words if it does not."""
        program = find_server()
        # It serves this process alone: nobody else is held up by many calls. And it has nothing to finish for anybody
        # when it is stopped; it would wait until the idle channels of this process look, which they do every 5 s.
        own = ["--listen", "127.0.0.1:0", "--max-unary-calls-per-s", "0", "--drain-s", "0.1"]
        self._process = start_bound([program, *own, *options], stderr=subprocess.PIPE)
        atexit.register(self.stop)
        self._said: list[str] = []
        targets: queue.Queue[str] = queue.Queue()
        # Both pipes are read all along, or the server would wait for a full one.
        readers = [threading.Thread(target=self._read, args=(pipe, targets), daemon=True)
                   for pipe in (self._process.stdout, self._process.stderr)]
        for reader in readers:
            reader.start()
        deadline = time.monotonic() + timeout_s
        while True:
            try:
                self.target = targets.get(timeout=0.1)
                return
            except queue.Empty:
                ended = self._process.poll() is not None
                if ended or time.monotonic() > deadline:
                    break
        if ended:
            # Its last words may still be in the pipe.
            for reader in readers:
                reader.join(timeout=5)
        said = "".join(self._said[-5:]).strip() or "nothing was said"
        what = f"ended with {self._process.returncode}" if ended else f"was not ready after {timeout_s:g} s"
        self.stop()
        raise SourceUnreachable(f"{program} {what}: {said}")

    def _read(self, pipe: IO[str], targets: queue.Queue[str]) -> None:
        with pipe:
            for line in pipe:
                found = _READY.search(line)
                if found:
                    targets.put(found.group(1))
                self._said = [*self._said[-20:], line]

    def stop(self) -> None:
        """Ends it; nothing if it has ended."""
        atexit.unregister(self.stop)
        if self._process.stdin is not None:
            self._process.stdin.close()
        try:
            self._process.wait(timeout=_STOP_WITHIN_S)
        except subprocess.TimeoutExpired:
            os.killpg(self._process.pid, signal.SIGKILL)
            self._process.wait()
