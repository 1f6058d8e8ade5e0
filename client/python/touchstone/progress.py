"""How far a command is, as the other commands show it (client/cli/common/progress_bar.h): on a terminal one line in place, elsewhere a
line every ten seconds, and nothing of what is done at once."""

from __future__ import annotations

import os
import sys
import threading
import time
from typing import Any, TextIO

from .printable import printable

_BAR = 30
_MIN_SHARE, _MIN_ELAPSED_S = 0.01, 1.0  # less tells nothing of the rest


def duration(seconds: float) -> str:
    """ "40 s", "2 min 20 s", "1 h 5 min"."""
    whole = int(seconds)
    if whole < 60:
        return f"{whole} s"
    return f"{whole // 60} min {whole % 60} s" if whole < 3600 else f"{whole // 3600} h {whole % 3600 // 60} min"


def left(share: float, elapsed_s: float) -> str:
    """"20 s left" if it goes on as until now; "" where that cannot be told yet."""
    if share < _MIN_SHARE or elapsed_s < _MIN_ELAPSED_S:
        return ""
    return f"{duration(elapsed_s * (1 - share) / share + 0.999)} left"


class Progress:
    """For a `with` block; calling it says what is under way. A thread draws while the work is silent.

    Args:
      quiet: nothing is shown.
      output: where to; a terminal is drawn on in place. Default: stderr.
      first_s: nothing is shown before. Default: 0.5 s on a terminal, else 10 s.
      interval_s: between two drawings or lines. Default: 0.2 s on a terminal, else 10 s.
    """

    def __init__(self, quiet: bool, output: TextIO | None = None, *, first_s: float | None = None, interval_s: float | None = None):
        self._output = sys.stderr if output is None else output
        self._terminal = self._output.isatty()
        self._first_s = (0.5 if self._terminal else 10.0) if first_s is None else first_s
        self._interval_s = (0.2 if self._terminal else 10.0) if interval_s is None else interval_s
        self._quiet, self._began = quiet, time.monotonic()
        self._stage, self._share, self._counts = "", -1.0, ""
        self._lock, self._ended, self._drawn = threading.Lock(), threading.Event(), False
        self._thread = threading.Thread(target=self._run, daemon=True)

    def __enter__(self) -> Progress:
        self._began = time.monotonic()
        if not self._quiet:
            self._thread.start()
        return self

    def __exit__(self, *_: Any) -> None:
        self._ended.set()
        if self._thread.is_alive():
            self._thread.join()
        if self._drawn:
            print("\r\x1b[K", end="", file=self._output, flush=True)
            self._drawn = False

    def __call__(self, stage: str, share: float = -1.0) -> None:
        """`share` from 0 to 1 of the whole work is done; below 0: nobody knows."""
        with self._lock:
            self._stage, self._share, self._counts = stage, share, ""

    def rows(self, done: int, rows: int) -> None:
        """So many of all rows are done."""
        with self._lock:
            self._share, self._counts = done / max(rows, 1), f"{done} of {rows} rows"

    def _run(self) -> None:
        wait_s = self._first_s
        while not self._ended.wait(wait_s):
            wait_s = self._interval_s
            with self._lock:
                text = self._text(time.monotonic() - self._began)
            print(f"\r\x1b[K{text}" if self._terminal else text, end="" if self._terminal else "\n", file=self._output, flush=True)
            self._drawn = self._terminal

    def _text(self, elapsed_s: float) -> str:
        share = min(max(self._share, 0.0), 1.0)
        details = [part for part in (self._counts, left(share, elapsed_s)) if part]
        if self._terminal:
            bar = "#" * int(share * _BAR)
            begin = f"[{bar:.<{_BAR}}] {100 * share:5.1f} %" if self._share >= 0 else f"{duration(elapsed_s)} so far"
            text = "  ".join([begin, *details, *([self._stage] if self._stage else [])])
            return printable(text)[:os.get_terminal_size(self._output.fileno()).columns - 1]
        begin = f"{100 * share:.0f} % " if self._share >= 0 else ""
        return printable(", ".join([f"{begin}after {duration(elapsed_s)}", *details]) + (f": {self._stage}" if self._stage else ""))
