"""What a client shows to a source that asks who calls, and the CA that it takes the source's certificate from."""

from __future__ import annotations

import dataclasses
import os
import pathlib
import re
import socket
import ssl
from typing import Any, Callable

import grpc

from . import errors
from .channel import is_local, open_channel, proxy_for

_PROBE_S = 2.0
_HOSTNAME_MISMATCH = (62, 64)  # OpenSSL's numbers, of a name and of an address
_EXPIRED = 10


@dataclasses.dataclass(frozen=True)
class Credentials:
    """Files are read when a channel is made, the token's file for every call; it may be replaced meanwhile.

    Attributes:
      ca: PEM file of the CAs that the source's certificate may come from, or "system" for this machine's; "": plain text.
      cert: PEM file of a client certificate, and `key` of its private key; "": none.
      token: what `touchstone token new` printed; "": none, or that of `token_file`.
    """

    ca: str = ""
    cert: str = ""
    key: str = ""
    token: str = dataclasses.field(default="", repr=False)
    token_file: str = ""

    @classmethod
    def of(cls, ca: Any = None, cert: Any = None, key: Any = None, token: str | None = None,
           token_file: Any = None) -> Credentials:
        """These, and for what is None the variables TOUCHSTONE_TLS_CA, _TLS_CERT, _TLS_KEY, _TOKEN and _TOKEN_FILE."""
        env = os.environ.get
        if cert is None and key is None:
            cert, key = env("TOUCHSTONE_TLS_CERT"), env("TOUCHSTONE_TLS_KEY")
        if token is None and token_file is None:
            token = env("TOUCHSTONE_TOKEN")
            token_file = None if token else env("TOUCHSTONE_TOKEN_FILE")
        if bool(cert) != bool(key):
            raise errors.InvalidRequest("cert and key go together: a client certificate and its private key.")
        ca = env("TOUCHSTONE_TLS_CA") if ca is None else ca
        if cert and not ca:
            raise errors.InvalidRequest('A client certificate needs ca=FILE, or ca="system": it is part of TLS.')
        return cls(*(os.fspath(value or "") for value in (ca, cert, key, token, token_file)))

    def read_token(self) -> str:
        """The token as it is now; "" without one."""
        token = self.token or (_read("token_file", self.token_file).decode("utf-8", "replace").strip() if self.token_file else "")
        if token and not (token.isascii() and token.isprintable() and " " not in token):
            raise errors.InvalidRequest("The token must be one word of visible characters, as touchstone token new prints it.")
        return token

    def channel(self, target: str, options: Any) -> grpc.Channel:
        """A gRPC channel to "host:port" with these. InvalidRequest where the token would go out in plain text, or a file cannot be read."""
        if self.read_token() and not self.ca and not is_local(target):
            raise errors.InvalidRequest(
                f"The token would go to {target} in plain text, where others can read it: give the CA of the source's "
                'certificate, ca=FILE (or ca="system"), or leave the token out.'
            )
        channel = open_channel(target, options, grpc.ssl_channel_credentials(
            None if self.ca == "system" else _pem("ca", self.ca),
            _pem("key", self.key) if self.key else None, _pem("cert", self.cert) if self.cert else None,
        ) if self.ca else None)
        if not self.token and not self.token_file:
            return channel
        return grpc.intercept_channel(channel, _ShowToken(self))

    def explain(self, target: str) -> str:
        """In words what is wrong between a source and these, where TCP works but no connection came about; "" if nothing is."""
        host, _, port = target.rpartition(":")
        # The handshake would go to the source itself, which only a proxy may reach.
        if not host or not port.isdigit() or "/" in host or proxy_for(target):
            return ""
        host = host.strip("[]")
        try:
            context = _probing_context(self)
            with socket.create_connection((host, int(port)), timeout=_PROBE_S) as plain:
                with context.wrap_socket(plain, server_hostname=host) as shaken:
                    if not self.ca:
                        return f'{target} speaks TLS: give the CA of its certificate, ca=FILE or ca="system".'
                    # What a source has against a client's certificate shows after the handshake: gRPC's servers hang up.
                    if not shaken.recv(1) and self.cert:
                        return _refused(target, self.cert)
        except ssl.SSLCertVerificationError as error:
            return _explain_certificate(error, target, host, self.ca)
        except ssl.SSLError as error:
            if not self.ca:
                return ""
            if error.reason in ("WRONG_VERSION_NUMBER", "HTTP_REQUEST", "PACKET_LENGTH_TOO_LONG"):
                return f"{target} speaks plain text, not TLS: start it with --tls-cert and --tls-key, or leave ca out."
            if self.cert and "ALERT" in (error.reason or ""):
                return _refused(target, self.cert)
        except (OSError, errors.InvalidRequest):
            pass
        return ""


class _ShowToken(grpc.UnaryUnaryClientInterceptor, grpc.UnaryStreamClientInterceptor, grpc.StreamUnaryClientInterceptor,
                 grpc.StreamStreamClientInterceptor):
    """gRPC's own call credentials work over TLS only, and a source on this machine may ask for a token without it."""

    def __init__(self, credentials: Credentials):
        self._credentials = credentials

    def _show(self, continuation: Callable[[Any, Any], Any], details: grpc.ClientCallDetails, request: Any) -> Any:
        token = self._credentials.read_token()
        return continuation(_Details(details, token), request)

    # One for all four: each gets a request or an iterator of them, and returns what `continuation` makes of it.
    intercept_unary_unary = _show  # type: ignore[assignment]  # narrower in its types than gRPC's generic method
    intercept_unary_stream = _show  # type: ignore[assignment]  # likewise
    intercept_stream_unary = _show  # type: ignore[assignment]  # likewise
    intercept_stream_stream = _show  # type: ignore[assignment]  # likewise


class _Details(grpc.ClientCallDetails):
    def __init__(self, details: grpc.ClientCallDetails, token: str):
        self.method, self.timeout, self.credentials = details.method, details.timeout, details.credentials
        self.wait_for_ready = getattr(details, "wait_for_ready", None)
        self.compression = getattr(details, "compression", None)
        self.metadata = [*(details.metadata or ()), *([("authorization", f"Bearer {token}")] if token else ())]


def _read(what: str, path: str) -> bytes:
    try:
        return pathlib.Path(path).read_bytes()
    except OSError as error:
        raise errors.InvalidRequest(f"{what}: {path}: {error.strerror}.") from None


def _pem(what: str, path: str) -> bytes:
    """A file of certificates, or of a private key; the other way round is a mistake that gRPC reports as a lost connection."""
    text = _read(what, path)
    wanted, other = ("PRIVATE KEY", "CERTIFICATE") if what == "key" else ("CERTIFICATE", "PRIVATE KEY")
    if re.search(rb"-----BEGIN [A-Z0-9 ]*" + wanted.encode() + rb"-----", text):
        return text
    found = f"holds a {other.lower()}" if other.encode() in text else "is no PEM file"
    raise errors.InvalidRequest(f"{what}={path!r}: {path} {found}; a PEM file that begins with -----BEGIN {wanted}----- was expected.")


def _probing_context(credentials: Credentials) -> ssl.SSLContext:
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
    context.set_alpn_protocols(["h2"])
    if not credentials.ca:
        context.check_hostname = False
        context.verify_mode = ssl.CERT_NONE
    elif credentials.ca == "system":
        context.load_default_certs()
    else:
        context.load_verify_locations(credentials.ca)
    if credentials.cert:
        context.load_cert_chain(credentials.cert, credentials.key)
    return context


def _refused(target: str, cert: str) -> str:
    return (f"{target} hangs up when it is shown the client certificate {cert}: it must come from a CA that the source was "
            "given with --tls-client-ca.")


def _explain_certificate(error: ssl.SSLCertVerificationError, target: str, host: str, ca: str) -> str:
    if error.verify_code in _HOSTNAME_MISMATCH:
        return f"The certificate of {target} is not for '{host}': use a name that it has, or a certificate that has this one."
    if error.verify_code == _EXPIRED:
        return f"The certificate of {target} has expired: its source needs a new one."
    return f"The certificate of {target} comes from no CA in ca={ca} ({error.verify_message}): give the CA that signed it."
