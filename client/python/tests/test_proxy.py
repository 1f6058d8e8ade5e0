"""Proxies of the environment: none for this machine, a token through none of them in plain text, and a name in messages."""

import hashlib
import json
import os
import pathlib
import socket
import subprocess
import sys
import threading

import pytest

import touchstone
from touchstone.channel import is_local, proxy_for

ROOT = pathlib.Path(__file__).resolve().parents[3]
BIN = pathlib.Path(os.environ.get("TOUCHSTONE_SERVER_PROGRAM") or ROOT / "build/release/bin/touchstone-server").parent
VARIABLES = ("http_proxy", "https_proxy", "grpc_proxy")
TOKEN = "a-token-that-nobody-may-see"
# A name that nothing resolves: only a proxy reaches it.
FAR = "bench2.touchstone.test:50051"


class RecordingProxy:
    """A proxy on a port of this machine: takes HTTP CONNECT, connects to the one server that it knows whatever it is asked for, and
    keeps all that clients sent.

    Attributes:
      url: "http://127.0.0.1:port".
      asked: the first line of each connection, "CONNECT bench2:50051 HTTP/1.1".
      sent: every byte that came from clients.
    """

    def __init__(self, server: str):
        """server: "127.0.0.1:port" where every CONNECT ends."""
        self._server = server
        self.asked: list[str] = []
        self.sent = b""
        self._lock = threading.Lock()
        self._listener = socket.create_server(("127.0.0.1", 0))
        self.url = f"http://127.0.0.1:{self._listener.getsockname()[1]}"
        threading.Thread(target=self._accept, daemon=True).start()

    def close(self) -> None:
        # A blocked accept() outlives a close().
        self._listener.shutdown(socket.SHUT_RDWR)
        self._listener.close()

    def _accept(self) -> None:
        while True:
            try:
                client, _ = self._listener.accept()
            except OSError:
                return
            threading.Thread(target=self._serve, args=(client,), daemon=True).start()

    def _keep(self, data: bytes) -> bytes:
        with self._lock:
            self.sent += data
        return data

    def _serve(self, client: socket.socket) -> None:
        head = b""
        with client:
            while b"\r\n\r\n" not in head:
                data = client.recv(4096)
                if not data:
                    return
                head += self._keep(data)
            with self._lock:
                self.asked.append(head.split(b"\r\n")[0].decode())
            host, _, port = self._server.rpartition(":")
            with socket.create_connection((host, int(port))) as server:
                client.sendall(b"HTTP/1.1 200 Connection established\r\n\r\n")
                back = threading.Thread(target=self._copy, args=(server, client, lambda data: data), daemon=True)
                back.start()
                self._copy(client, server, self._keep)
                back.join()

    @staticmethod
    def _copy(source, target, keep) -> None:
        try:
            while data := source.recv(65536):
                target.sendall(keep(data))
            target.shutdown(socket.SHUT_WR)
        except OSError:
            pass


@pytest.fixture
def proxy(server, monkeypatch):
    """A proxy in every variable that names one, in front of `server`."""
    recording = RecordingProxy(server.target)
    for name in VARIABLES:
        monkeypatch.setenv(name, recording.url)
    yield recording
    recording.close()


@pytest.fixture
def gone(nobody, monkeypatch):
    """A proxy that is not there, with a password, in https_proxy; its address."""
    monkeypatch.setenv("https_proxy", f"http://ana:secret@{nobody}/")
    return f"http://{nobody} (https_proxy)"


def run(*words):
    """Both outputs of a program of ours, and its exit status."""
    done = subprocess.run([str(BIN / words[0]), *map(str, words[1:])], capture_output=True, text=True, check=False)
    # Lines are broken where they are long.
    return done.returncode, " ".join((done.stdout + done.stderr).split())


# server/service/channel/host_port_test.cpp has the same lists.
@pytest.mark.parametrize("target", ["127.0.0.1:1", "127.1.2.3:1", "localhost:0", "LocalHost:1", "[::1]:1",
                                    "[::ffff:127.0.0.1]:1", "unix:/run/t", "unix-abstract:t", "dns:localhost:1",
                                    "dns:///127.0.0.1:1", "ipv4:127.0.0.1:1,127.0.0.2:1", "ipv6:[::1]:1"])
def test_an_address_of_this_machine_is_one_and_needs_no_proxy(target, monkeypatch):
    monkeypatch.setenv("http_proxy", "http://proxy:3128")
    assert is_local(target)
    assert proxy_for(target) == ""


@pytest.mark.parametrize("target", ["0.0.0.0:1", "[::]:1", "192.168.0.2:1", "bench2:1", "127.evil.example:1", "127.0.0.1.5:1",
                                    ":1", "localhost.x:1", "dns://10.0.0.1/localhost:1", "ipv4:127.0.0.1:1,10.0.0.1:1",
                                    "[::ffff:10.0.0.1]:1", "passthrough:127.0.0.1:1", "127.0.0.1"])
def test_an_address_of_others_is_none(target):
    assert not is_local(target)


@pytest.mark.parametrize("variables, words", [
    ({}, ""),
    ({"http_proxy": "http://c", "https_proxy": "http://b"}, "the proxy http://b (https_proxy)"),
    ({"http_proxy": "http://c", "grpc_proxy": "socks5://a"}, ""),
    ({"http_proxy": "http://c", "grpc_proxy": ""}, ""),
    ({"http_proxy": "http://ana:se@cret@c:1/secret?secret"}, "the proxy http://c:1 (http_proxy)"),
    ({"http_proxy": "http://c", "no_proxy": "other, .touchstone.TEST"}, ""),
    ({"http_proxy": "http://c", "no_proxy": ".touchstone.test", "no_grpc_proxy": "other"}, "the proxy http://c (http_proxy)"),
])
def test_the_proxy_of_others_is_that_which_grpc_takes(monkeypatch, variables, words):
    for name in (*VARIABLES, "no_proxy", "no_grpc_proxy"):
        monkeypatch.delenv(name, raising=False)
    for name, value in variables.items():
        monkeypatch.setenv(name, value)
    assert proxy_for(FAR) == proxy_for(f"dns:///{FAR}") == words


def test_this_machine_is_reached_without_a_proxy(server, proxy, server_program, monkeypatch):
    monkeypatch.setenv("TOUCHSTONE_SERVER_PROGRAM", str(server_program))
    for target in (server.target, f"localhost:{server.port}"):
        with touchstone.connect(target, token=TOKEN) as client:
            assert client.objects()
    with touchstone.connect() as client:
        assert client.objects()
    for words in (("touchstone", "objects", "--server", server.target), ("touchstone-probe", server.target)):
        assert run(*words)[0] == 0
    done = subprocess.run([sys.executable, str(ROOT / "deploy/wait-until-serving"), server.target, "30"], check=False)
    assert done.returncode == 0
    assert proxy.asked == []


def test_a_token_never_goes_out_in_plain_text(proxy, monkeypatch):
    with pytest.raises(touchstone.InvalidRequest, match="in plain text"):
        touchstone.connect(FAR, token=TOKEN)
    monkeypatch.setenv("TOUCHSTONE_TOKEN", TOKEN)
    status, said = run("touchstone", "objects", "--server", FAR, "--wait-s", "0")
    assert status == 2 and "in plain text" in said and TOKEN not in said
    assert proxy.sent == b""


def test_a_token_goes_through_a_proxy_within_tls(new_server, tmp_path, monkeypatch):
    def openssl(*words):
        subprocess.run(["openssl", *words], cwd=tmp_path, check=True, capture_output=True)

    openssl("req", "-x509", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:prime256v1", "-nodes", "-keyout", "server.key", "-out",
            "server.pem", "-days", "2", "-subj", "/CN=bench2", "-addext", f"subjectAltName=DNS:{FAR.split(':', maxsplit=1)[0]}")
    (tmp_path / "tokens").write_text(f"ana reader sha256:{hashlib.sha256(TOKEN.encode()).hexdigest()}\n")
    own = new_server("--tls-cert", tmp_path / "server.pem", "--tls-key", tmp_path / "server.key", "--token-file",
                     tmp_path / "tokens")
    proxy = RecordingProxy(own.target)
    monkeypatch.setenv("http_proxy", proxy.url)
    monkeypatch.setenv("TOUCHSTONE_TOKEN", TOKEN)
    monkeypatch.setenv("TOUCHSTONE_TLS_CA", str(tmp_path / "server.pem"))
    with touchstone.connect(FAR, timeout_s=60) as client:
        assert client.objects()
    status, said = run("touchstone", "objects", "--server", FAR, "--verbose")
    assert status == 0 and f"connected to {FAR} through the proxy {proxy.url} (http_proxy)" in said
    assert len(proxy.asked) >= 2 and set(proxy.asked) == {f"CONNECT {FAR} HTTP/1.1"}
    assert TOKEN.encode() not in proxy.sent
    proxy.close()


def test_a_proxy_that_is_not_there_is_named_without_its_password(gone):
    with pytest.raises(touchstone.SourceUnreachable) as raised:
        touchstone.connect(FAR, timeout_s=0.5)
    assert gone in str(raised.value) and "no_proxy" in str(raised.value) and "secret" not in str(raised.value)
    status, said = run("touchstone", "objects", "--server", FAR, "--wait-s", "0")
    assert status == 3 and gone in said and "no_proxy" in said and "secret" not in said


def test_doctor_says_which_proxy_is_used(server, gone):
    status, said = run("touchstone", "doctor", "--server", server.target)
    assert status == 0 and f"{server.target} is reached without one" in said
    status, said = run("touchstone", "doctor", "--server", FAR, "--wait-s", "0")
    assert status == 3 and f"{FAR} is reached through the proxy {gone}" in said and "secret" not in said
    status, said = run("touchstone", "doctor", "--json", "--server", server.target)
    assert json.loads(said)["proxies"] == {server.target: ""}
