"""Touches of a plan as one session, which can be gone on with."""

from __future__ import annotations

import hashlib
import re
from typing import TYPE_CHECKING, Any

from .errors import InvalidRequest, Refused
from .measurements import Row

if TYPE_CHECKING:
    from .client import Client


def check_name(name: str) -> str:
    if not re.fullmatch(r"[A-Za-z0-9_.-]{1,64}", name):
        raise InvalidRequest(f"Session {name!r}: 1 to 64 letters, digits, '_', '-' and '.' were expected.")
    return name


def touch_id(session: str, object: str, number: int) -> str:
    """The id under which a physical source journals a touch. The command line uses the same, so either can resume."""
    text = f"{session}/{object}/{number}"
    if len(text.encode()) <= 128:
        return text
    return f"{session}/{hashlib.sha256(object.encode()).hexdigest()[:16]}/{number}"


class Session:
    """Made by Client.session(). Holds the lease, where the source needs one, from `with` to its end.

    with client.session("monday") as session:
        rows = [session.touch(row) for row in touchstone.read_plan("plan.csv")]
    """

    def __init__(self, client: Client, name: str, take_lease: bool = False):
        self.name = check_name(name)
        self._client = client
        self._take_lease = take_lease
        self._lease: Any = None

    def __enter__(self) -> Session:
        self._lease = self._client.lease(take=self._take_lease)
        self._lease.__enter__()
        return self

    def __exit__(self, kind: Any, *_: Any) -> None:
        # Ctrl-C, or an error in mid-touch: what moves stops first.
        if kind is not None and issubclass(kind, KeyboardInterrupt) and self._client.is_physical:
            self._client.stop(f"interrupted in session {self.name}")
        self._lease.__exit__(None, None, None)
        self._lease = None

    def touch(self, row: Row, series: bool = False) -> Row:
        """Makes the touch, or gets it from the journal if it was made before; the row with its times.

        A source that is lost in between is asked again, for the same touch, as long as the client's retry_for_s. Where
        a person must put down or turn the object, Refused says how; Client.rig.mount() reports that it is done.
        With `series` the arm's states come along (Client.touch).
        """
        if self._lease is None:
            raise Refused(f'Session {self.name} is not open; use it as "with client.session({self.name!r}) as session".')
        result = self._client.touch(row.object, row.command, session=self.name,
                                    ids=[touch_id(self.name, row.object, row.touch)], series=series)
        return Row(row.touch, row.object, row.command, tuple(float(t) for t in result["contact_time_us"][0]),
                   result.measured[0].session_time_s if result.measured else row.session_time_s, result)
