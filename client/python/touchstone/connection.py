"""A channel to one of several equal sources, opened when it is first needed and again when it is lost."""

from __future__ import annotations

import os
import random
import time
import weakref
from collections.abc import Iterable, Sequence
from typing import Any, Union

import grpc

from . import errors, retry
from .credentials import Credentials
from .errors import InvalidRequest
from .retry import Retry

Targets = Union[str, Sequence[str]]

_MIB = 1024 * 1024
_OPTIONS = (
    ("grpc.max_receive_message_length", 256 * _MIB),
    ("grpc.max_send_message_length", 256 * _MIB),
    # Every Connection has a socket of its own, and no back-off inherited from another one to the same target.
    ("grpc.use_local_subchannel_pool", 1),
    # Retrying is done here, where it is known which index comes next.
    ("grpc.enable_retries", 0),
    # By its name this is the least time between two attempts; it is also how long an attempt may take, 20 s by itself.
    ("grpc.min_reconnect_backoff_ms", int(1000 * retry.CONNECT_S)),
    # A source that was stopped, or whose machine died, sends nothing: it is asked for a sign of life during every call, also
    # where it computes for long and sends no data. gRPC's own threads answer and ask, however slowly batches are taken.
    ("grpc.keepalive_time_ms", int(1000 * retry.KEEPALIVE_S)),
    ("grpc.keepalive_timeout_ms", int(1000 * retry.KEEPALIVE_TIMEOUT_S)),
    ("grpc.http2.max_pings_without_data", 0),
)


def _options_of(target: str) -> tuple[tuple[str, Any], ...]:
    # A name may stand for many equal sources: every call goes to the next one of its addresses that answers.
    return (*_OPTIONS, ("grpc.lb_policy_name", "round_robin")) if target.startswith("dns:") else _OPTIONS


# The processes, this one and those it was forked from, in which a channel was made.
_processes_with_grpc: set[int] = set()


def grpc_was_used_before_fork() -> bool:
    """True in a process forked from one that had used gRPC, whose threads did not come along: a call would hang."""
    return any(pid != os.getpid() for pid in _processes_with_grpc)


def grpc_was_used() -> bool:
    """True if a process forked now could not use gRPC."""
    return bool(_processes_with_grpc)


def chosen_targets(targets: Targets | None) -> Targets | None:
    """What to connect to, as --server of the command line: what is given, else TOUCHSTONE_SERVER; None, also of "none": a server of
    one's own. InvalidRequest where the variable holds a path."""
    if targets is None:
        targets = os.environ.get("TOUCHSTONE_SERVER") or None
        if targets is not None and targets[0] in "/.":
            raise InvalidRequest(f"TOUCHSTONE_SERVER: '{targets}' is a path; \"host:port\" was expected (TOUCHSTONE_SERVER_PROGRAM names the "
                                 "program that connect() starts).")
    return None if targets == "none" else targets


def parse_targets(targets: Targets) -> tuple[str, ...]:
    """("host:port", ...) from one text, "a:1,b:2", or a sequence of them."""
    if isinstance(targets, str):
        targets = targets.split(",")
    if not isinstance(targets, Iterable):
        raise errors.InvalidRequest(
            f'targets is {targets!r}; "host:port" was expected, for instance "127.0.0.1:{targets if isinstance(targets, int) else 50051}".'
        )
    result = tuple(str(target).strip() for target in targets)
    if not result:
        raise errors.InvalidRequest('No target is given; say for instance "127.0.0.1:50051".')
    for target in result:
        if target.startswith(("unix:", "dns:", "ipv4:", "ipv6:", "passthrough:")):
            continue
        scheme, _, rest = target.rpartition("://")
        host, _, port = rest.rpartition(":")
        if scheme or not host or "/" in host or not (port.isascii() and port.isdigit()) or not 0 < int(port) < 65536:
            meant = rest.partition("/")[0] if scheme else ""
            example = meant if meant and ":" in meant else "127.0.0.1:50051"
            port_said = ", the port from 1 to 65535" if port.isdigit() and host and not scheme and "/" not in host else ""
            raise errors.InvalidRequest(f'Target "{target}" is not "host:port"{port_said}; say for instance "{example}".')
    return result


class _Family:
    """The connections of one client, which close() ends together."""

    def __init__(self) -> None:
        self.closed = False
        self.members: weakref.WeakSet[Connection] = weakref.WeakSet()


class Connection:
    """Not thread-safe to reconnect; give every thread its own."""

    def __init__(self, targets: Targets, retry_for_s: float = retry.RETRY_FOR_S, begin_with: int = 0,
                 credentials: Credentials | None = None, family: _Family | None = None):
        """`begin_with`: which target comes first, modulo their number, so that many clients spread over them.

        `credentials`: what the targets are shown; None: what the environment says.
        """
        self._family = _Family() if family is None else family
        self._family.members.add(self)
        self.targets = parse_targets(targets)
        self.retry_for_s = retry_for_s
        self.credentials = Credentials.of() if credentials is None else credentials
        self._position = begin_with % len(self.targets)
        self._channel: grpc.Channel | None = None
        self._pid = 0

    @property
    def target(self) -> str:
        return self.targets[self._position]

    def another(self) -> Connection:
        """A new one to the same targets, beginning with the one in use; close() of either ends both."""
        self.check_open()
        return Connection(self.targets, self.retry_for_s, self._position, self.credentials, self._family)

    def check_open(self) -> None:
        """Raises Refused after close()."""
        if self._family.closed:
            raise errors.Refused(f"The client of {', '.join(self.targets)} is closed, and what was made with it: make a new one with "
                                 "touchstone.connect().")

    def channel(self) -> grpc.Channel:
        self.check_open()
        if self._channel is not None and self._pid != os.getpid():
            raise self._forked()
        if self._channel is None:
            if grpc_was_used_before_fork():
                raise self._forked()
            self._channel = self.credentials.channel(self.target, _options_of(self.target))
            self._pid = os.getpid()
            _processes_with_grpc.add(self._pid)
        return self._channel

    @staticmethod
    def _forked() -> errors.Refused:
        return errors.Refused(
            "This process was forked from one that had used gRPC already, and gRPC does not work after that. Use "
            'TouchstoneDataset.loader(), or DataLoader(..., multiprocessing_context="forkserver"), or connect only '
            "in the workers."
        )

    def move_on(self) -> None:
        """Leaves the target that was lost; the next call goes to the next one."""
        self.disconnect()
        self._position = (self._position + 1) % len(self.targets)

    def disconnect(self) -> None:
        """Leaves the channel; the next call opens one again."""
        if self._channel is not None and self._pid == os.getpid():
            self._channel.close()
        self._channel = None

    def close(self) -> None:
        """For good, with every connection that came from this one or that it came from: each call after it is Refused."""
        self._family.closed = True
        for member in list(self._family.members):
            member.disconnect()

    def call(self, stub: type, method: str, request: Any, *, timeout_s: float | None = None, repeat: bool = True,
             retry_for_s: float | None = None) -> Any:
        """One unary call; a lost source is replaced by the next if the call may be repeated.

        Args:
          stub: generated stub class, e.g. source_pb2_grpc.SourceStub.
          timeout_s: deadline of each attempt; the next target is tried after it.
          retry_for_s: how long to retry; by default the connection's.
        """
        patience = Retry(len(self.targets), self.retry_for_s if retry_for_s is None else retry_for_s)
        explained, silent = False, 0
        while True:
            try:
                return getattr(stub(self.channel()), method)(request, timeout=timeout_s)
            except grpc.RpcError as error:
                if errors.is_too_fast(error):
                    time.sleep(random.uniform(0.01, 0.05))
                    continue
                failure = errors.from_rpc(error, self.target, request)
                # A target that says nothing in time is left for the next one; each gets its time once.
                late = error.code() == grpc.StatusCode.DEADLINE_EXCEEDED
                silent += late
                if not (repeat and (errors.is_lost(error) or (late and silent < len(self.targets)))):
                    raise failure from None
                if not explained and len(self.targets) == 1 and isinstance(failure, errors.SourceUnreachable):
                    explained = True
                    why = self.credentials.explain(self.target)
                    if why:
                        raise errors.Refused(why, failure.code, self.target) from None
            self.move_on()
            patience.lost(failure)
