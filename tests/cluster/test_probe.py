"""touchstone-probe, which containers and units ask with."""
import re
import subprocess

import pytest

import slurm_cluster


@pytest.fixture
def probe(bin_folder):
    def ask(*arguments):
        return subprocess.run([bin_folder / "touchstone-probe", *arguments], capture_output=True, text=True, timeout=60, check=False)

    return ask


def test_a_server_that_serves_is_told_from_one_that_is_not_there(probe, bin_folder):
    with subprocess.Popen([bin_folder / "touchstone-server", "--listen", "127.0.0.1:0", "--log-level", "off"],
                          stdout=subprocess.PIPE, text=True) as server:
        address = re.search(r"listening on (\S+)", server.stdout.readline()).group(1)
        assert probe(address).returncode == 0
        # Where TLS is expected, plain text is no answer.
        assert probe(address, "--ca", __file__).returncode == 3
        server.terminate()
    gone = probe(address, "--timeout-s", "1")
    assert gone.returncode == 3 and address in gone.stderr


@pytest.mark.parametrize("arguments", [["--ca", "/no/such/file"], ["--cert", "only.pem"], ["--timeout-s", "-1"], ["--what"]])
def test_bad_options_are_not_taken_for_a_server_that_is_down(probe, arguments):
    (port,) = slurm_cluster.free_ports(1)
    assert probe(f"127.0.0.1:{port}", *arguments).returncode == 2
