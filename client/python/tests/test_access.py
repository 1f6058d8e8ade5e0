"""A source that asks who calls, over TLS and on this machine: what gets in, and what is said to what does not."""

import hashlib
import pickle
import socket
import subprocess

import pytest

import touchstone


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    """ca.pem, other.pem, server.pem (for localhost), client.pem; tokens of a reader and an admin."""
    folder = tmp_path_factory.mktemp("access")

    def openssl(*words):
        subprocess.run(["openssl", *words], cwd=folder, check=True, capture_output=True)

    key = ["-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:prime256v1", "-nodes"]
    for ca in ("ca", "other"):
        openssl("req", "-x509", *key, "-keyout", f"{ca}.key", "-out", f"{ca}.pem", "-days", "2", "-subj", f"/CN={ca}")
    for name, ca in (("server", "ca"), ("client", "ca"), ("stranger", "other")):
        (folder / f"{name}.ext").write_text("subjectAltName=DNS:localhost\n")
        openssl("req", *key, "-keyout", f"{name}.key", "-out", f"{name}.csr", "-subj", f"/CN={name}")
        openssl("x509", "-req", "-in", f"{name}.csr", "-CA", f"{ca}.pem", "-CAkey", f"{ca}.key", "-CAcreateserial", "-days",
                "2", "-extfile", f"{name}.ext", "-out", f"{name}.pem")
    write_tokens(folder, reader="reads", admin="changes")
    return folder


def write_tokens(folder, **token_of_role):
    """In a new file that takes the name: as long as the last one, it could not be told from it within a clock tick."""
    (folder / "tokens.new").write_text("".join(
        f"{role} {role} sha256:{hashlib.sha256(token.encode()).hexdigest()}\n" for role, token in token_of_role.items()
    ))
    (folder / "tokens.new").replace(folder / "tokens")


@pytest.fixture
def secure(new_server, files):
    """localhost:port of a server with TLS and tokens, and client certificates."""
    server = new_server("--tls-cert", files / "server.pem", "--tls-key", files / "server.key", "--tls-client-ca",
                        files / "ca.pem", "--token-file", files / "tokens")
    return f"localhost:{server.port}"


def test_a_token_over_tls_gets_in_as_far_as_its_role_goes(secure, files):
    with touchstone.connect(secure, ca=files / "ca.pem", token="reads") as client:
        assert client.describe().kind == "virtual"
        assert sum(batch.rows for batch in client.dataset(["lat00"], samples=100, seed=1)) == 100
        assert len(client.samples(["lat00"], samples=10, seed=1)[2:4]["object"]) == 2
        with pytest.raises(touchstone.Refused, match=r"Models\.CreateModel needs the role admin; 'reader' has the role reader"):
            client.add_model("touchstone: model/1\nname: mine\neffects: []\n")
    with touchstone.connect(secure, ca=files / "ca.pem", token="changes") as client:
        client.add_model("touchstone: model/1\nname: mine\neffects: []\n")


def test_a_client_certificate_gets_in(secure, files):
    with touchstone.connect(secure, ca=files / "ca.pem", cert=files / "client.pem", key=files / "client.key") as client:
        assert client.objects()


@pytest.mark.parametrize("shown, words", [
    ({"ca": "ca.pem"}, "asks who calls"),
    ({"ca": "ca.pem", "token": "guessed"}, "not known here"),
    ({"ca": "other.pem", "token": "reads"}, "comes from no CA in"),
    ({}, "speaks TLS: give the CA"),
    ({"ca": "ca.pem", "cert": "stranger.pem", "key": "stranger.key"}, "hangs up when it is shown the client certificate"),
])
def test_what_does_not_fit_is_said_at_once(secure, files, at_once, shown, words):
    shown = {name: value if name == "token" else str(files / value) for name, value in shown.items()}
    with pytest.raises(touchstone.Refused, match=words) as raised:
        touchstone.connect(secure, timeout_s=120, **shown)
    assert "guessed" not in str(raised.value)


def test_a_certificate_of_another_name_is_named(secure, files, at_once):
    with pytest.raises(touchstone.Refused, match=r"is not for '127\.0\.0\.1'"):
        touchstone.connect(secure.replace("localhost", "127.0.0.1"), ca=files / "ca.pem", token="reads", timeout_s=120)


def test_tls_to_a_source_that_speaks_plain_text(server, files, at_once):
    with pytest.raises(touchstone.Refused, match="speaks plain text"):
        touchstone.connect(f"localhost:{server.port}", ca=files / "ca.pem", timeout_s=120)


def test_a_token_never_goes_to_another_machine_in_plain_text():
    with pytest.raises(touchstone.InvalidRequest, match="in plain text") as raised:
        touchstone.connect(f"{socket.gethostname()}.example:50051", token="reads", timeout_s=1)
    assert "reads" not in str(raised.value)


def test_the_environment_is_taken_and_a_token_may_be_replaced(new_server, tmp_path, monkeypatch):
    write_tokens(tmp_path, reader="first")
    server = new_server("--token-file", tmp_path / "tokens")
    monkeypatch.setenv("TOUCHSTONE_TOKEN_FILE", str(tmp_path / "token"))
    (tmp_path / "token").write_text("first\n")
    with touchstone.connect(server.target) as client:
        write_tokens(tmp_path, reader="second, longer")
        with pytest.raises(touchstone.Refused, match="not known here"):
            client.describe()
        write_tokens(tmp_path, reader="third-and-longest")
        (tmp_path / "token").write_text("third-and-longest\n")
        assert client.describe()
    assert not [line for line in server.log if "third" in line or "first" in line]


def test_a_worker_shows_what_its_client_showed(new_server, files):
    server = new_server("--token-file", files / "tokens")
    with touchstone.connect(server.target, token="reads") as client:
        assert "reads" not in repr(client.credentials)
        assert len(pickle.loads(pickle.dumps(client.samples(["lat00"], samples=10, seed=1)))) == 10
        assert pickle.loads(pickle.dumps(client.samples(["lat00"], samples=10, seed=1)))[3]
