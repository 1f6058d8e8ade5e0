"""Where OpenGL's library is missing, the CPU renderer draws, and who asks for EGL is told what to install."""

import pathlib
import subprocess

import pytest

REPOSITORY = pathlib.Path(__file__).resolve().parents[2]
PROGRAM = REPOSITORY / "build/release/bin/touchstone"
LIBRARIES = sorted({path.resolve() for name in ("libOpenGL.so.0", "libGL.so.1")
                    for folder in ("/usr/lib/x86_64-linux-gnu", "/usr/lib/aarch64-linux-gnu", "/usr/lib64", "/usr/lib")
                    if (path := pathlib.Path(folder, name)).exists()})


def capture(tmp_path, *options):
    """The command line where the libraries are files of nothing."""
    hide = "".join(f"mount --bind /dev/null {library} && " for library in LIBRARIES)
    return subprocess.run(["unshare", "--mount", "sh", "-c", hide + 'exec "$@"', "sh", PROGRAM, "capture", "lat20",
                           "--eye-mm", "300,200,150", "-o", tmp_path / "view.png", *options],
                          capture_output=True, text=True, timeout=120, check=False)


@pytest.fixture(autouse=True)
def may_hide():
    if subprocess.run(["unshare", "--mount", "true"], capture_output=True, check=False).returncode:
        pytest.skip("only root may hide files from a program (unshare --mount)")


def test_the_cpu_draws(tmp_path):
    done = capture(tmp_path)
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "view.png").read_bytes().startswith(b"\x89PNG")


def test_egl_says_what_is_missing(tmp_path):
    done = capture(tmp_path, "--renderer", "egl")
    assert done.returncode > 0 and "libopengl0" in done.stderr and "Traceback" not in done.stderr
