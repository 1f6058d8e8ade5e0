"""What can go wrong, as exceptions with the source's own message. No gRPC exception leaves the package."""

from __future__ import annotations

from typing import Any

import grpc

from .channel import proxy_for
from .printable import printable
from .sent_files import name_files
from .spoken import as_python


class TouchstoneError(Exception):
    """Base of all.

    Attributes:
      code: the canonical status ("INVALID_ARGUMENT", ...); "" if the request never left this process.
      target: the source that said so; "" likewise.
    """

    def __init__(self, message: str, code: str = "", target: str = ""):
        super().__init__(printable(message))
        self.code = code
        self.target = target


class InvalidRequest(TouchstoneError, ValueError):
    """The request cannot be meant: an unknown word, a value out of range, a malformed model file."""


class NotFound(TouchstoneError, LookupError):
    """An object, model or effect that the source does not have."""


class SourceUnreachable(TouchstoneError, ConnectionError):
    """No source answered, or the only ones that did were lost and did not come back in time."""


class Refused(TouchstoneError):
    """The source understood and will not: a lease is missing, a limit is reached, the method is not offered."""


class SourceChanged(Refused):
    """Another source, or the same one restarted, would not make the same samples: going on would mix two datasets."""


class SourceFailed(TouchstoneError):
    """The source failed at a legitimate request."""


_CLASSES = {
    "INVALID_ARGUMENT": InvalidRequest,
    "OUT_OF_RANGE": InvalidRequest,
    "NOT_FOUND": NotFound,
    "UNAVAILABLE": SourceUnreachable,
    "DEADLINE_EXCEEDED": SourceUnreachable,
    "FAILED_PRECONDITION": Refused,
    "ABORTED": Refused,
    "ALREADY_EXISTS": Refused,
    "PERMISSION_DENIED": Refused,
    "UNAUTHENTICATED": Refused,
    "RESOURCE_EXHAUSTED": Refused,
    "UNIMPLEMENTED": Refused,
}


# What a lost or silent source looks like: gRPC's own words name sockets, and neither what was lost nor what to do.
_IN_WORDS = {
    "UNAVAILABLE": "no source answers there. Start touchstone-server or touchstone-gateway at this address, or correct it",
    "DEADLINE_EXCEEDED": "no answer in time. The source may be busy or its machine gone; ask again, or with more time",
}
_BROKEN = "the connection broke in the middle of an answer. Ask again; if it comes back, look at the source's log"


# What gRPC itself answers where a service is not there comes without a word.
_NOT_OFFERED = ("this source does not offer that: models, effects and diagnoses are a touchstone-server's, an arm's motions "
                "a rig's, through its touchstone-gateway; a recorded session has none of them")


def from_rpc(error: grpc.RpcError, target: str, request: Any = None) -> TouchstoneError:
    """The exception for a failed call; raise it `from None`. With the request, files that it holds are named by their paths."""
    code = error.code().name
    details = error.details() or (_NOT_OFFERED if code == "UNIMPLEMENTED" else "no message")
    details = as_python(name_files(details, request))
    kind = _CLASSES.get(code, SourceFailed)
    if kind is SourceUnreachable:
        proxy = proxy_for(target)
        through = f". It was asked through {proxy}; hosts in no_proxy are asked without it" if proxy else ""
        details = f"{target}: {_IN_WORDS[code]}{through} (gRPC: {details})"
    elif kind is SourceFailed and is_lost(error):
        details = f"{target}: {_BROKEN} (gRPC: {details})"
    return kind(details, code, target)


def is_too_fast(error: grpc.RpcError) -> bool:
    """True if this client has made too many calls in the last second: the same source answers in a moment."""
    return error.code() == grpc.StatusCode.RESOURCE_EXHAUSTED and "max_unary_calls_per_s" in (error.details() or "")


def is_lost(error: grpc.RpcError) -> bool:
    """True if the connection or the server went away, so that the same request may succeed elsewhere or later."""
    code, details = error.code(), error.details() or ""
    if code == grpc.StatusCode.UNAVAILABLE:
        return True
    # A killed server also shows as a reset stream; one whose drain ran out cancels what is left. This process
    # never takes a cancellation of its own for that: it does not look at a call after cancelling it.
    if code == grpc.StatusCode.CANCELLED:
        return True
    if code in (grpc.StatusCode.INTERNAL, grpc.StatusCode.UNKNOWN):
        return "RST_STREAM" in details or "Stream removed" in details or "Socket closed" in details
    # All streams of the source are taken: one of an ended epoch may still be closing there. A request that is too large
    # for a limit stays so; a source says where waiting helps.
    return code == grpc.StatusCode.RESOURCE_EXHAUSTED and "try again" in details
