"""Files that are whole or not there: the one way in which this package writes one."""

from __future__ import annotations

import contextlib
import os
import tempfile
from collections.abc import Iterator
from typing import IO, Any


@contextlib.contextmanager
def whole_file(path: str | os.PathLike[str], mode: str = "w", **options: Any) -> Iterator[IO[Any]]:
    """A file to write to, which takes the place of `path` when the block ends, and is gone when it ends with an error.

    mode: "w" or "wb"; options: as for open(). It stands beside its place, under a name that nobody can foresee, and is on the disk
    before it gets its own; an OSError says what went wrong.
    """
    name = os.path.realpath(path)  # a link stays one
    folder = os.path.dirname(name)
    descriptor, part = tempfile.mkstemp(dir=folder, prefix=f".{os.path.basename(name)[:200]}.", suffix=".part")
    try:
        with open(descriptor, mode, **options) as file:
            yield file
            file.flush()
            os.fchmod(file.fileno(), _mode_of(name))
            os.fsync(file.fileno())
        os.replace(part, name)
    except BaseException:
        with contextlib.suppress(OSError):
            os.unlink(part)
        raise
    opened = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        os.fsync(opened)
    finally:
        os.close(opened)


def _mode_of(path: str) -> int:
    """The permission bits of what is replaced, else those that open() gives a new file."""
    try:
        return os.stat(path).st_mode & 0o777
    except FileNotFoundError:
        mask = os.umask(0)
        os.umask(mask)
        return 0o666 & ~mask
