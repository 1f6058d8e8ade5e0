"""A bug report of an emulated rig, made and replayed with the programs that people use."""
import contextlib
import getpass
import json
import os
import pathlib
import re
import shutil
import socket
import subprocess
import tarfile

import pytest

from test_rig_commands import BIN, PATIENCE_S, start_gateway, touchstone, wait_for_line

pytestmark = pytest.mark.xdist_group("bundle")
SECRETS = ("ana", "bench2", "kestrel", "Kestrel")


@contextlib.contextmanager
def gateway_of(*arguments):
    gateway, address = start_gateway(*arguments)
    try:
        yield address
    finally:
        gateway.terminate()
        assert gateway.wait(timeout=PATIENCE_S) == 0


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A session with a hidden effect, its bundle, and what the rig's own gateway said of it."""
    folder = tmp_path_factory.mktemp("kestrel")
    emulator = subprocess.Popen([BIN / "touchstone-rig-emulator", "--dir", folder / "rig", "--speedup", "40", "--no-camera", "--seed",
                                 "7", "--hide", "tip_radius.radius_mm=3", "--sigma-us", "1000", "--finger-give-mm", "1000"],
                                stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
    try:
        config = pathlib.Path(wait_for_line(emulator))
        config.write_text(re.sub("(?m)^provenance_note = .*$", 'provenance_note = "for Ana, project Kestrel"', config.read_text()))
        assert "Kestrel" in config.read_text()
        touchstone("plan", "lat20", "--plan", "faces", "--samples-per-face", "4", "--rounds", "8", "-o", folder / "all.csv")
        lines = (folder / "all.csv").read_text().splitlines()
        z = lines[0].split(",").index("approach_z")
        top = [line for line in lines[1:] if float(line.split(",")[z]) < -0.9]
        (folder / "plan.csv").write_text("\n".join([lines[0], *top]) + "\n")
        with gateway_of("--config", config) as address:
            touchstone("rig", "run", folder / "plan.csv", "-o", folder / "run.db", "--session", "kestrel", server=address)
            touchstone("session", "export", "kestrel", "-o", folder / "original.csv", server=address)
            status = touchstone("rig", "status", server=address)
            said = touchstone("rig", "bundle", "kestrel", "--config", config, "--seed", "7", "-o", folder / "bug.tar.gz", server=address)
            assert "session.db, audit.jsonl, gateway.toml, state.json" in said
    finally:
        emulator.terminate()
        emulator.wait(timeout=PATIENCE_S)
    return folder, status


def member_of(bundle, name):
    file = bundle.extractfile(name)
    assert file is not None, name
    return file.read()


def test_the_bundle_names_nobody(made):
    folder, _ = made
    names = {name for name in (getpass.getuser(), socket.gethostname()) if name not in ("root", "localhost")}
    with tarfile.open(folder / "bug.tar.gz") as bundle:
        members = bundle.getmembers()
        assert {member.name for member in members} == {"manifest.json", "session.db", "audit.jsonl", "gateway.toml", "state.json"}
        assert all(member.uid == member.gid == member.mtime == 0 and not member.uname for member in members)
        parts = {member.name: member_of(bundle, member.name) for member in members}
        text = b"\n".join(parts.values())
        readable = b"\n".join(bytes_of for name, bytes_of in parts.items() if name != "session.db")
        manifest = json.loads(member_of(bundle, "manifest.json"))
    for name in {*SECRETS, *(name for name in names if len(name) > 5), str(folder), os.fspath(folder.parent)}:
        assert name.encode() not in text, name
    for name in names:  # a short one stands in numbers of the journal by chance
        assert not re.search(rb"(?<!\w)" + re.escape(name.encode()) + rb"(?!\w)", readable), name
    assert manifest["seed"] == 7 and manifest["session"]["emulated"] and manifest["replaced"]["sessions"] == 1
    assert "lat20" in manifest["session"]["objects"]


def test_the_replay_shows_exports_and_diagnoses_as_the_original(made, tmp_path):
    folder, status = made
    with gateway_of("--replay", folder / "bug.tar.gz") as address:
        touchstone("session", "export", "session-1", "-o", tmp_path / "replayed.csv", server=address)
        shown = touchstone("rig", "status", server=address)
        again = json.loads(touchstone("rig", "status", "--json", server=address))["rig"]
        touchstone("rig", "run", folder / "plan.csv", "-o", tmp_path / "again.db", "--session", "session-1", server=address)
        assert "nothing moves" in touchstone("rig", "home", server=address, code=4)
    assert (tmp_path / "replayed.csv").read_bytes() == (folder / "original.csv").read_bytes()
    assert "REPLAY of bug.tar.gz" in " ".join(shown.split())
    assert again["emulated"] and again["provenance"].startswith("replay of bug.tar.gz; ")
    # Line by line the same parts, but for names, the lease that has gone, and clocks that go on.
    for line in ("Object", "Arm", "  Software", "  Kinematics", "  Firmware", "  Fingers", "Camera"):
        before, after = ([text for text in of.splitlines() if text.startswith(line)] for of in (status, shown))
        if line not in ("Object", "Arm"):
            assert before == after and before, line
    touchstone("session", "export", tmp_path / "again.db", "-o", tmp_path / "again.csv")
    assert "cov_emulated" in (tmp_path / "again.csv").read_text().splitlines()[0]
    # What is found is the same.
    touchstone("model", "new", "-o", tmp_path / "nominal.yaml")
    found = []
    for measured in (folder / "original.csv", tmp_path / "replayed.csv"):
        shutil.copy(measured, tmp_path / "set.csv")
        touchstone("diagnose", tmp_path / "set.csv", "--model", tmp_path / "nominal.yaml", "--json", tmp_path / "report.json", "--force")
        report = json.loads((tmp_path / "report.json").read_text())
        del report["provenance"]["date"], report["duration_s"]
        found.append(report)
    assert "tip_radius" in json.dumps(found[0])
    assert found[0] == found[1]


def test_mistakes_are_answered_in_words(made, tmp_path):
    folder, _ = made
    config = folder / "rig" / "gateway.toml"
    out = tmp_path / "bug.tar.gz"
    assert "--config or --journal is missing" in touchstone("rig", "bundle", "kestrel", "-o", out, code=2)
    wrong = touchstone("rig", "bundle", "kestral", "--config", config, "-o", out, code=2)
    assert "there is no session 'kestral', did you mean 'kestrel'" in wrong
    assert "nowhere.toml" in touchstone("rig", "bundle", "kestrel", "--config", "nowhere.toml", "-o", out, code=2)
    assert "Default: simulate" not in touchstone("rig", "bundle", "--help")
    assert not out.exists()
    half = tmp_path / "half.tar.gz"
    half.write_bytes((folder / "bug.tar.gz").read_bytes()[:4000])
    result = subprocess.run([BIN / "touchstone-gateway", "--replay", half, "--listen", "127.0.0.1:0"], capture_output=True, text=True,
                            timeout=PATIENCE_S, check=False)
    assert result.returncode != 0 and "half.tar.gz" in result.stderr + result.stdout, result
