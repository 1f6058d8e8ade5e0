"""Runs a test program: in a process group and a folder for temporary files of its own, with limits of time, memory and disk."""

import contextlib
import dataclasses
import os
import shutil
import signal
import subprocess
import tempfile
import time

# What a mutant may take: else one that counts the wrong way would take the machine's memory or disk with it.
_LIMITS = ["prlimit", f"--data={6 << 30}", f"--fsize={2 << 30}", "--core=0"]


@dataclasses.dataclass
class Ended:
    passed: bool
    timed_out: bool
    code: int
    output: str
    seconds: float


def environment(mutant=None, reached=None, all_tiers=False, more=()):
    """Of a test program: ours without what concerns tests, and what is asked for."""
    values = {name: value for name, value in os.environ.items() if not name.startswith(("TOUCHSTONE_", "GTEST_"))}
    values.update(more)
    if mutant is not None:
        values["TOUCHSTONE_MUTANT"] = str(mutant)
    if reached:
        values["TOUCHSTONE_MUTANT_REACHED"] = str(reached)
    if all_tiers:
        values["TOUCHSTONE_TEST_TIER"] = "all"
    return values


def run(command, cwd, values, limit_s, follow=None):
    """Ended. `follow(text)`, where given, sees the output as it grows and says how many seconds from now on are allowed, or
    None where nothing changes."""
    began = time.monotonic()
    folder = tempfile.mkdtemp(prefix="touchstone-mutant-")
    with tempfile.TemporaryFile() as output:
        process = subprocess.Popen([*_LIMITS, *map(str, command)], cwd=cwd, env={**values, "TMPDIR": folder},
                                   stdin=subprocess.DEVNULL, stdout=output, stderr=subprocess.STDOUT, start_new_session=True)
        try:
            timed_out = not _wait(process, output, began + limit_s, follow)
        finally:
            _kill(process)
            shutil.rmtree(folder, ignore_errors=True)
        text = os.pread(output.fileno(), 64 << 20, 0).decode(errors="replace")
    return Ended(process.returncode == 0 and not timed_out, timed_out, process.returncode, text, time.monotonic() - began)


def _wait(process, output, deadline, follow):
    """Whether the process ended in time."""
    seen = 0
    while True:
        try:
            process.wait(timeout=0.2 if follow else max(deadline - time.monotonic(), 0))
            return True
        except subprocess.TimeoutExpired:
            pass
        if follow:
            new = os.pread(output.fileno(), 1 << 20, seen)
            seen += len(new)
            allowed = follow(new.decode(errors="replace"))
            if allowed is not None:
                deadline = time.monotonic() + allowed
        if time.monotonic() >= deadline:
            return False


def _kill(process):
    """The process, and what it has left running."""
    with contextlib.suppress(ProcessLookupError):
        os.killpg(process.pid, signal.SIGKILL)
    process.wait()


def numbers(path):
    """What mutant.h wrote."""
    try:
        with open(path) as file:
            return sorted({int(line) for line in file})
    except FileNotFoundError:
        return []
