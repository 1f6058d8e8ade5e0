"""Every command of server/gateway/COMMISSIONING.md as it stands there, in its order, against an emulated rig, and every
key of the gateway's configuration that it names. What a person does there (hands, emergency stop) is left out."""
import os
import re
import shutil
import signal
import subprocess

import pytest

from test_rig_commands import BIN, PATIENCE_S, ROOT, SPEEDUP, emulated_rig

pytestmark = pytest.mark.xdist_group("commissioning")
PAGE = (ROOT / "server/gateway/COMMISSIONING.md").read_text(encoding="utf-8")
ADDRESS = "127.0.0.1:50052"


def rows():
    """(number, what to do, what to see) of the rows of its tables."""
    for number, line in enumerate(PAGE.splitlines(), 1):
        cells = [cell.strip() for cell in re.split(r"(?<!\\)\|", line)[1:-1]]
        if len(cells) in (2, 3) and not set(cells[0]) <= set("- "):
            yield number, cells[-2], cells[-1]


def commands():
    """(line, command, whether it is to be refused): the last one of a row whose second cell says so."""
    found = []
    for number, do, see in rows():
        row = [span for span in re.findall(r"`([^`]+)`", do) if span.startswith(("rig ", "touchstone "))]
        found += [(number, command, "is refused" in see and k == len(row) - 1) for k, command in enumerate(row)]
    return found


def run(shell, command, folder):
    """(status, output). One that watches is ended once it has said something: by SIGTERM, since a shell
    that was started in the background lets its programs ignore SIGINT."""
    environment = {**os.environ, "PATH": f"{BIN}:{os.environ['PATH']}"}
    process = subprocess.Popen(["bash", "-c", f"{shell}\n{command}"], cwd=folder, env=environment, stdin=subprocess.DEVNULL,
                               stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, start_new_session=True)
    if command.endswith("--watch"):
        first = process.stdout.readline()
        os.killpg(process.pid, signal.SIGTERM)
        process.communicate(timeout=PATIENCE_S)
        return 0 if first else 1, first
    output, _ = process.communicate(timeout=PATIENCE_S)
    return process.returncode, output


def test_its_commands_do_what_it_says(tmp_path):
    page = commands()
    assert len(page) >= 14 and sum(refused for *_, refused in page) == 1
    shell = re.search(r"```sh\n(.*?)```", PAGE, re.DOTALL).group(1)
    assert ADDRESS in shell
    with emulated_rig(tmp_path / "rig", SPEEDUP, "--object", "lat20", "--power-off") as address:
        shutil.copy(tmp_path / "rig/calibration.yaml", tmp_path)
        for number, command, refused in page:
            status, output = run(shell.replace(ADDRESS, address), command, tmp_path)
            place = f"COMMISSIONING.md:{number}: {command}: {status}\n{output}"
            if command.startswith("rig calibrate tip"):
                assert "Pose 1 of 6" in output and "a person is needed" in output, place
            else:
                assert (status != 0) == refused, place


def test_its_keys_are_those_of_the_gateway():
    named = set(re.findall(r"`((?:arm|effector|camera|limits)\.[a-z0-9_]+)", PAGE))
    known = subprocess.run([BIN / "touchstone-gateway", "--help"], capture_output=True, text=True, timeout=PATIENCE_S,
                           check=True).stdout
    assert len(named) >= 8
    assert not [key for key in named if "--" + re.sub("[._]", "-", key) not in known]
