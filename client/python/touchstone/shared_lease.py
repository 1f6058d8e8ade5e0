"""One lease for all workers of a DataLoader, which are processes of their own."""

from __future__ import annotations

import time

import torch

from .connection import Connection
from .errors import Refused
from .lease import Lease
from .v1 import control_pb2, control_pb2_grpc

_MOST_WORKERS = 256
_MOST_TOKEN_BYTES = 255
_WAIT_S = 2.0
_RETRY_S = 0.05


class LeaseSlot:
    """Memory that all workers see, also spawned ones: the token of the lease, and which workers use it.

    A `lent` token is that of a lease which another object holds and releases.
    """

    def __init__(self, lent: str = "") -> None:
        # The token's length and its bytes.
        self._token = torch.zeros(1 + _MOST_TOKEN_BYTES, dtype=torch.uint8).share_memory_()
        self._users = torch.zeros(_MOST_WORKERS, dtype=torch.uint8).share_memory_()
        self._lent = bool(lent)
        self.token = lent

    def use(self, worker: int) -> None:
        self._users[worker % _MOST_WORKERS] = 1

    def leave(self, worker: int) -> bool:
        """True if the lease is to be released: its last user has gone."""
        self._users[worker % _MOST_WORKERS] = 0
        return not self._lent and not bool(self._users.any())

    @property
    def token(self) -> str:
        return bytes(self._token[1:1 + int(self._token[0])].tolist()).decode(errors="replace")

    @token.setter
    def token(self, token: str) -> None:
        data = token.encode()
        assert len(data) <= _MOST_TOKEN_BYTES, token
        self._token[0] = 0
        self._token[1:1 + len(data)] = torch.tensor(list(data), dtype=torch.uint8)
        # Last: the bytes are not read before.
        self._token[0] = len(data)


class SharedLease(Lease):
    """The lease that another worker acquired already, or a new one for all; the last worker gives it back."""

    def __init__(self, connection: Connection, needed: bool, slot: LeaseSlot, worker: int):
        self._slot, self._worker = slot, worker
        slot.use(worker)
        super().__init__(connection, needed)

    def _acquire(self, take: bool) -> None:
        until = time.monotonic() + _WAIT_S
        while True:
            token = self._slot.token
            if token and self._adopt(token):
                return
            try:
                super()._acquire(take)
                self._slot.token = self.token
                return
            except Refused as error:
                # Another worker may have acquired it just now without having published it yet.
                if error.code != "FAILED_PRECONDITION" or time.monotonic() > until:
                    raise
            time.sleep(_RETRY_S)

    def _adopt(self, token: str) -> bool:
        try:
            lease = self._own.call(control_pb2_grpc.ControlStub, "RenewLease",
                                   control_pb2.RenewLeaseRequest(token=token))
        except Refused as error:
            if error.code != "ABORTED":
                raise
            return False
        self._hold(lease)
        return True

    def release(self) -> None:
        if self._slot.leave(self._worker):
            super().release()
        elif self._end_renewing():
            self._own.disconnect()
