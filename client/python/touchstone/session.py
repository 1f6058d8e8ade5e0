"""Touches of a plan as one session, which can be gone on with."""

from __future__ import annotations

import collections
import dataclasses
import hashlib
import re
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import grpc
import numpy as np

from . import arguments
from .errors import InvalidRequest, Refused, from_rpc
from .measurements import EMULATED, Row, rows_of
from .plain_csv import parse_csv
from .plans import Touches
from .v1 import sessions_pb2, sessions_pb2_grpc

if TYPE_CHECKING:
    from .client import Client


def check_name(name: str) -> str:
    if not re.fullmatch(r"[A-Za-z0-9_.-]{1,64}", name):
        raise InvalidRequest(f"Session {name!r}: 1 to 64 letters, digits, '_', '-' and '.' were expected.")
    return name


@arguments.checked
def touch_id(session: str, object: str, number: int) -> str:
    """The id under which a physical source journals a touch. The command line uses the same, so either can resume."""
    text = f"{session}/{object}/{number}"
    if len(text.encode()) <= 128:
        return text
    return f"{session}/{hashlib.sha256(object.encode()).hexdigest()[:16]}/{number}"


@arguments.checked
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
        self._emulated: bool | None = None

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
        return Row(row.touch, row.object, self._as_touched(row.command), tuple(float(t) for t in result["contact_time_us"][0]),
                   result.measured[0].session_time_s if result.measured else row.session_time_s, result, row.round, row.face)

    def made_before(self, rows: Sequence[Row]) -> tuple[list[Row], list[Row]]:
        """(those that the source's session has already, with their times; those that are still to be made). Nothing moves.

        Touches of a session are told by object and command; of repeats of one pose the first ones of `rows` are taken for those that
        are there. A source that moves nothing keeps no session: all are still to be made.
        """
        rows = list(rows)
        if not self._client.is_physical:
            return [], rows
        left = collections.Counter(_key(row) for row in self._measured())
        made, still = [], []
        for row in rows:
            if left[_key(row)] > 0:
                left[_key(row)] -= 1
                made.append(self.touch(row))
            else:
                still.append(row)
        return made, still

    def _measured(self) -> list[Row]:
        """What the source's session has, as its measurement file says it."""
        request = sessions_pb2.ExportSessionRequest(name=self.name)
        try:
            pieces = self._client.call(sessions_pb2_grpc.SessionsStub, "ExportSession", request)
            data = b"".join(piece.csv for piece in pieces if piece.file in ("", "touches.csv"))
        except grpc.RpcError as error:
            if error.code() == grpc.StatusCode.NOT_FOUND:
                return []
            raise from_rpc(error, self._client.target, request) from None
        return rows_of(*parse_csv(data, f"session {self.name}"), f"session {self.name}") if data.count(b"\n") > 1 else []

    def _as_touched(self, command: Touches) -> Touches:
        """What was touched is what the source says, whatever the plan was made from: an emulator's data are never called measured."""
        if not self._client.is_physical:
            return command
        if self._emulated is None:
            self._emulated = self._client.rig.status().emulated
        covariates = {name: values for name, values in command.covariates.items() if name != EMULATED}
        if self._emulated:
            covariates[EMULATED] = np.ones(len(command))
        return dataclasses.replace(command, covariates=covariates)


def _key(row: Row) -> tuple[Any, ...]:
    """Object and command to 12 digits: what a measurement file keeps of it."""
    command = row.command
    values = (*command.target_mm[0], *command.approach[0], *command.lateral[0], command.standoff_mm[0], command.speed_mm_s[0])
    return (row.object, *(f"{value + 0.0:.11e}" if abs(value) > 1e-12 else "0" for value in values))
