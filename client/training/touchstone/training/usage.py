"""What this process and its children use of the machine, from /proc (Linux): processor time, memory, bytes to the disk."""

from __future__ import annotations

import dataclasses
import os
import pathlib

_TICKS = os.sysconf("SC_CLK_TCK")
_PAGE = os.sysconf("SC_PAGE_SIZE")
_PROC = pathlib.Path("/proc")


@dataclasses.dataclass
class Usage:
    """Attributes:
      cpu_s: processor seconds of this process and all below it, ended ones included where their parent waited for them.
      core_busy_s: of each core, by all programs of the machine.
      memory_bytes: resident, the processes added up; what they share is counted for each.
      written_bytes: that they caused to be sent to the disk.
    """

    cpu_s: float
    core_busy_s: list[float]
    memory_bytes: int
    written_bytes: int


def now() -> Usage:
    cpu_s, memory, written = 0.0, 0, 0
    for pid in _family():
        try:
            fields = (_PROC / str(pid) / "stat").read_text().rpartition(")")[2].split()
            cpu_s += sum(map(int, fields[11:15])) / _TICKS  # user and system, its own and of children that ended
            memory += int((_PROC / str(pid) / "statm").read_text().split()[1]) * _PAGE
            io = dict(line.split(": ") for line in (_PROC / str(pid) / "io").read_text().splitlines())
            written += int(io["write_bytes"])
        except (OSError, IndexError, KeyError):
            continue  # it ended meanwhile, or is not ours to ask
    return Usage(cpu_s, _cores(), memory, written)


def _cores() -> list[float]:
    lines = [line.split() for line in (_PROC / "stat").read_text().splitlines() if line.startswith("cpu")]
    # user, nice, system, idle, iowait, irq, softirq, steal
    return [(sum(map(int, line[1:4])) + sum(map(int, line[6:8]))) / _TICKS for line in lines if line[0] != "cpu"]


def _family() -> list[int]:
    """This process and all below it."""
    parents = {}
    for path in _PROC.iterdir():
        if path.name.isdigit():
            try:
                parents[int(path.name)] = int((path / "stat").read_text().rpartition(")")[2].split()[1])
            except (OSError, IndexError):
                continue
    found, fresh = [], [os.getpid()]
    while fresh:
        found += fresh
        fresh = [pid for pid, parent in parents.items() if parent in fresh]
    return found
