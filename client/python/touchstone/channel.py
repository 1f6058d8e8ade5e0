"""Where every connection of this package begins: whether it may go through a proxy is decided here.

Its twin is server/service/channel/channel.h.
"""

from __future__ import annotations

import ipaddress
import os
import re
import socket
from collections.abc import Sequence
from typing import Any

import grpc

# gRPC's own handlers of fork() wait for its threads, at times for ever (2 of 120 forks with gRPC 1.51 and signs of life), and
# are of no use: after a fork this package refuses to call (connection.py). Read when the first channel is made.
os.environ.setdefault("GRPC_ENABLE_FORK_SUPPORT", "0")


def _split(address: str) -> tuple[str, bool]:
    """Host of "host:port", without brackets, and whether it is such an address."""
    host, _, port = address.rpartition(":")
    return host.removeprefix("[").removesuffix("]"), bool(re.fullmatch(r"[0-9]{1,5}", port, re.ASCII))


def _is_loopback(host: str) -> bool:
    try:
        address = ipaddress.ip_address(host)
    except ValueError:
        # Only whole addresses: 127.evil.example is a name like any other.
        return host.lower() == "localhost"
    mapped = getattr(address, "ipv4_mapped", None)
    return (mapped or address).is_loopback


def is_local(target: str) -> bool:
    """Whether only this machine reaches a target, as touchstone-server decides it for its own address."""
    if target.startswith(("unix:", "unix-abstract:")):
        return True
    # "dns://server/name:port" asks that server what the name means, and stays a foreign one.
    addresses = re.sub(r"^(dns:///|dns:|ipv4:|ipv6:)", "", target).split(",")
    return all(named and _is_loopback(host) for host, named in map(_split, addresses))


def _first_set(*names: str) -> tuple[str, str]:
    """The first variable that is set, also to nothing, and its value."""
    return next(((name, os.environ[name]) for name in names if name in os.environ), ("", ""))


def proxy_for(target: str) -> str:
    """The proxy through which gRPC reaches a target, "the proxy http://proxy:3128 (https_proxy)"; "" where it needs none.

    User and password are left out. The rules are gRPC's own, but for this machine, which never needs one.
    """
    name, url = _first_set("grpc_proxy", "https_proxy", "http_proxy")
    if is_local(target) or not url.startswith("http://"):
        return ""
    host = _split(re.sub(r"^(dns:|ipv4:|ipv6:)", "", target).rpartition("/")[2])[0].lower()
    ends = [end.strip().lower() for end in _first_set("no_grpc_proxy", "no_proxy")[1].split(",")]
    if host == socket.gethostname().lower() or any(end and host.endswith(end) for end in ends):
        return ""
    server = re.split(r"[/?#]", url.removeprefix("http://").rpartition("@")[2])[0]
    return f"the proxy http://{server} ({name})"


def open_channel(target: str, options: Sequence[tuple[str, Any]],
                 credentials: grpc.ChannelCredentials | None = None) -> grpc.Channel:
    """A channel; in plain text without `credentials`."""
    if not proxy_for(target):
        options = (*options, ("grpc.enable_http_proxy", 0))
    if credentials is None:
        return grpc.insecure_channel(target, options=options)
    return grpc.secure_channel(target, credentials, options=options)
