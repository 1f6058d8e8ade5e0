"""The systemd units are read by systemd without a warning, and leave their programs little to break."""
import shutil
import subprocess

import pytest

from conftest import REPOSITORY

UNITS = sorted((REPOSITORY / "deploy/systemd").glob("*.service"))
pytestmark = pytest.mark.skipif(not shutil.which("systemd-analyze"), reason="systemd-analyze is not installed")


@pytest.fixture
def unit(request, bin_folder, tmp_path):
    """The unit with the programs of this build, which need not be installed."""
    copy = tmp_path / request.param.name
    copy.write_text(request.param.read_text().replace("/usr/local/bin", str(bin_folder)))
    return copy


@pytest.mark.parametrize("unit", UNITS, indirect=True, ids=lambda path: path.stem)
def test_systemd_reads_it(unit):
    done = subprocess.run(["systemd-analyze", "verify", unit], capture_output=True, text=True, timeout=60, check=False)
    assert (done.returncode, done.stderr) == (0, "")


@pytest.mark.parametrize("unit", UNITS, indirect=True, ids=lambda path: path.stem)
def test_its_exposure_is_low(unit):
    # In tenths of systemd's scale, whose "OK" ends at 4.0.
    done = subprocess.run(["systemd-analyze", "security", "--offline=true", "--threshold=25", unit], capture_output=True,
                          text=True, timeout=60, check=False)
    assert done.returncode == 0, done.stdout
