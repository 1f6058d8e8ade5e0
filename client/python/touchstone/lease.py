"""The lease of a source that moves something: acquired where it is needed, renewed by a thread, released at the end."""

from __future__ import annotations

import contextlib
import getpass
import os
import socket
import sys
import threading
import time
from typing import Any

import grpc

from . import errors
from .connection import Connection
from .v1 import control_pb2, control_pb2_grpc

_CONTROL = control_pb2_grpc.ControlStub
_RENEWALS_A_WINDOW = 5
_ACQUIRE_S = 10.0
_SHORTEST_ANSWER_S = 0.5
# A lease that is not renewed, because its holder was killed, has expired by then.
_HOLDER_MAY_BE_GONE_S = 2.5
_ASK_AGAIN_S = 0.1


def _program() -> str:
    """The script that runs, without its folder; the package of `python -m package`; else "python"."""
    path = sys.argv[0] if sys.argv and sys.argv[0] not in ("", "-", "-c", "-m") else "python"
    name = os.path.basename(path)
    if name == "__main__.py":
        name = os.path.basename(os.path.dirname(os.path.abspath(path)))
    return "_".join(name.split()) or "python"


def holder() -> str:
    """Person, program and process, so that two programs of one person are told apart: "ana@lab train.py 4711"."""
    try:
        user = getpass.getuser()
    except (KeyError, OSError):
        user = f"uid{os.getuid()}"
    process = f" {os.getpid()}"
    # Within 256 bytes of any encoding; the process is never cut.
    who = f"{user}@{socket.gethostname()} {_program()}".encode()[:256 - len(process)].decode(errors="ignore")
    return who + process


class Lease:
    """A lease that is held. Made by Client.lease(); ends with `with` or release().

    Attributes:
      token: for requests of your own; those of the client carry it by themselves. "" where none is needed.
      holder: who holds it, for people.
      epoch: grows by one with every lease that the source grants.
    """

    def __init__(self, connection: Connection, needed: bool, take: bool = False):
        self.token, self.holder, self.epoch = "", holder(), 0
        self._connection = connection
        self._lost: errors.TouchstoneError | None = None
        self._ending = threading.Event()
        self._thread: threading.Thread | None = None
        if not needed:
            return
        # A channel of its own: the client may close and reopen its one.
        self._own = connection.another()
        self._acquire(take)

    def _acquire(self, take: bool) -> None:
        request = control_pb2.AcquireLeaseRequest(holder=self.holder, take=take)
        until = time.monotonic() + _HOLDER_MAY_BE_GONE_S
        while True:
            try:
                # Not repeated: an answer that was lost would leave a lease behind that refuses us.
                lease = self._own.call(_CONTROL, "AcquireLease", request, timeout_s=_ACQUIRE_S, repeat=False)
                break
            except errors.Refused as error:
                if error.code != "FAILED_PRECONDITION":
                    raise
                if time.monotonic() > until:
                    raise errors.Refused(
                        f"{error} Wait until they are done, or take it from them with client.lease(take=True).",
                        error.code, error.target,
                    ) from None
            time.sleep(_ASK_AGAIN_S)
        self._hold(lease)

    def _hold(self, lease: control_pb2.Lease) -> None:
        """Renews it from now on."""
        self.token, self.holder, self.epoch, self._window_s = lease.token, lease.holder, lease.epoch, lease.window_s
        self._thread = threading.Thread(target=self._run, name="touchstone lease", daemon=True)
        self._thread.start()

    @property
    def lost(self) -> errors.TouchstoneError | None:
        """Why the lease is gone, or None while it is held."""
        return self._lost

    def check(self) -> None:
        """Raises Refused if the lease was lost."""
        if self._lost is not None:
            raise self._lost

    def follow(self) -> str:
        """The token after a reconnection: of this lease if it is still valid, else of a new one.

        Never takes it from somebody else, and not where somebody stopped the source meanwhile (Refused).
        """
        if self._thread is None:
            return self.token
        state = self._connection.call(_CONTROL, "GetState", control_pb2.GetStateRequest())
        if state.state == control_pb2.SOURCE_STATE_STOPPED or state.stop_reason:
            raise errors.Refused(
                "Somebody stopped the source: make sure that it may move, release the stop with "
                "client.rig.reset(reason) or 'touchstone rig reset', then run the same again.",
                "FAILED_PRECONDITION", self._connection.target,
            )
        try:
            self._connection.call(_CONTROL, "RenewLease", control_pb2.RenewLeaseRequest(token=self.token))
            if self._lost is None:
                return self.token
        except errors.Refused as error:
            if error.code != "ABORTED":
                raise
        self._ending.set()
        self._thread.join()
        self._ending.clear()
        self._own.disconnect()
        self._own = self._connection.another()
        self._lost = None
        self._acquire(take=False)
        return self.token

    def release(self) -> None:
        """Gives it back; the second time it does nothing."""
        if self._end_renewing():
            if self._lost is None:
                with contextlib.suppress(grpc.RpcError):  # it runs out by itself
                    self._stub().ReleaseLease(
                        control_pb2.ReleaseLeaseRequest(token=self.token),
                        timeout=max(self._window_s, _SHORTEST_ANSWER_S),
                    )
            self._own.disconnect()

    def _end_renewing(self) -> bool:
        """False if it was not renewed any more."""
        if self._thread is None:
            return False
        self._ending.set()
        self._thread.join()
        self._thread = None
        return True

    def __enter__(self) -> Lease:
        return self

    def __exit__(self, *_: Any) -> None:
        self.release()

    def _stub(self) -> control_pb2_grpc.ControlStub:
        return control_pb2_grpc.ControlStub(self._own.channel())

    def _run(self) -> None:
        renewed_at = time.monotonic()
        while not self._ending.wait(self._window_s / _RENEWALS_A_WINDOW):
            asked_at = time.monotonic()
            try:
                self._stub().RenewLease(
                    control_pb2.RenewLeaseRequest(token=self.token),
                    timeout=max(self._window_s / 2, _SHORTEST_ANSWER_S),
                )
                renewed_at = asked_at
            except grpc.RpcError as error:
                failure = errors.from_rpc(error, self._own.target)
                if failure.code == "ABORTED":
                    self._lost = errors.Refused(
                        f"The lease was lost: {failure}. Agree with whoever has it now, then run the same again: "
                        "what is done is not done twice.", "ABORTED", self._own.target,
                    )
                    return
                if time.monotonic() - renewed_at > self._window_s:
                    self._lost = errors.Refused(
                        f"The lease ran out, because the source did not answer: {failure}", "ABORTED",
                        self._own.target,
                    )
                    return
