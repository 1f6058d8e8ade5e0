"""Files and folders that are whole or not there: the one way in which this package writes one."""

from __future__ import annotations

import contextlib
import os
import pathlib
import shutil
import tempfile
from collections.abc import Iterator
from typing import IO, Any

from .errors import InvalidRequest, NotFound


def check_target(path: str | os.PathLike[str], force: bool) -> None:
    """That a new file or folder can get this name.

    Raises:
      InvalidRequest: it is taken, and may not be replaced.
      NotFound: the folder that it would stand in is not there.
    """
    target = pathlib.Path(path)
    if not target.absolute().parent.is_dir():
        raise NotFound(f"{target}: the folder {target.absolute().parent} is not there; make it, or choose another.")
    if target.exists() and not force:
        raise InvalidRequest(f"{target} exists; replace it with force=True, or choose another name.")


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
    except BaseException as error:
        _name(error, part, os.fspath(path))
        with contextlib.suppress(OSError):
            os.unlink(part)
        raise
    _sync(folder, os.O_RDONLY | os.O_DIRECTORY)


@contextlib.contextmanager
def whole_folder(path: str | os.PathLike[str]) -> Iterator[pathlib.Path]:
    """A folder to write files to, which takes the place of `path` (a folder of before goes) when the block ends, and is gone when
    it ends with an error. All that is in it is on the disk before it gets its name."""
    name = pathlib.Path(os.path.realpath(path))
    part = pathlib.Path(tempfile.mkdtemp(dir=name.parent, prefix=f".{name.name[:200]}.", suffix=".part"))
    try:
        yield part
        for folder, _, files in os.walk(part, topdown=False):
            for file in files:
                _sync(os.path.join(folder, file), os.O_RDONLY)
            _sync(folder, os.O_RDONLY | os.O_DIRECTORY)
        mask = os.umask(0)
        os.umask(mask)
        part.chmod(0o777 & ~mask)
        if name.exists():
            before = pathlib.Path(tempfile.mkdtemp(dir=name.parent, prefix=f".{name.name[:200]}.", suffix=".before"))
            name.rename(before)
            part.rename(name)
            shutil.rmtree(before)
        else:
            part.rename(name)
    except BaseException as error:
        _name(error, str(part), os.fspath(path))
        shutil.rmtree(part, ignore_errors=True)
        raise
    _sync(str(name.parent), os.O_RDONLY | os.O_DIRECTORY)


def _name(error: BaseException, part: str, path: str) -> None:
    """Lets an error name what was asked for, and not the hidden file or folder that takes its place when it is whole."""
    error.args = tuple(one.replace(part, path) if isinstance(one, str) else one for one in error.args)
    if isinstance(error, OSError):
        for name in ("filename", "filename2"):
            file = getattr(error, name)
            if isinstance(file, (str, os.PathLike)):
                setattr(error, name, os.fspath(file).replace(part, path))


def _sync(path: str, flags: int) -> None:
    opened = os.open(path, flags)
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
