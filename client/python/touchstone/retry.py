"""What a client does when a source is lost, says nothing, or is full: for every call, before a stream and in it.

Its twin is client/source/connection/retry.h; tests/test_retry.py compares both, and the table in server/LIMITS.md.
"""

from __future__ import annotations

import logging
import random
import time

from . import errors

CONNECT_S = 4.0  # that a source has to answer a new connection
KEEPALIVE_S = 2.0  # silence during a call after which it is asked for a sign of life
KEEPALIVE_TIMEOUT_S = 6.0  # that it has to give one
FIRST_PAUSE_S = 0.1  # after the first round of all sources; then twice as long
MAX_PAUSE_S = 3.0
MIN_PAUSE_SHARE = 0.5  # a pause is drawn from so much of it to the whole
RETRY_FOR_S = 60.0  # since the last thing that arrived

_log = logging.getLogger("touchstone")
# A source that restarts or hands over is back before anyone needs to hear of it.
_SILENT_FOR_S = 2.0


class Retry:
    """Decides after each loss whether to try again, and waits: the next target at once, a whole round with a pause."""

    def __init__(self, targets: int, retry_for_s: float):
        self._targets = targets
        self._retry_for_s = retry_for_s
        self._told = False
        self._since: float | None = None  # the first loss since something arrived
        self.succeeded()

    def succeeded(self) -> None:
        """Something arrived: the time allowed for retries starts again."""
        if self._told and self._since is not None:
            _log.warning("A source answers again after %.0f s.", time.monotonic() - self._since)
        self._told = False
        self._losses = 0
        self._since = None

    def lost(self, error: errors.TouchstoneError) -> None:
        """Returns when to try again, or raises `error` when the patience is over."""
        now = time.monotonic()
        self._since = now if self._since is None else self._since
        self._losses += 1
        if self._losses % self._targets:
            return
        rounds = self._losses // self._targets
        # Jitter keeps a thousand workers from coming back in the same instant.
        pause_s = min(MAX_PAUSE_S, FIRST_PAUSE_S * 2 ** min(rounds - 1, 10)) * random.uniform(MIN_PAUSE_SHARE, 1.0)
        left_s = self._since + self._retry_for_s - now
        if left_s <= 0:
            raise error from None
        if not self._told and now - self._since >= _SILENT_FOR_S:
            self._told = True
            _log.warning("%s. Trying again for %.0f s more.", error, left_s)
        time.sleep(min(pause_s, left_s))
