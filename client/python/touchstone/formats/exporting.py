"""What can be exported, to what."""

from __future__ import annotations

import contextlib
import dataclasses
import errno
import os
import pathlib
import shutil
from collections.abc import Callable, Iterator

from ..command import did_you_mean
from ..errors import InvalidRequest, NotFound, Refused
from ..mcap import SessionFile, export as export_recording
from ..whole_file import check_target, whole_folder
from . import card, hdf5, lerobot, mcap, parquet, sessions, webdataset
from .datasets import DatasetFolder, open_dataset
from .table import Table, Values, need, sha256_of

FORMATS: dict[str, Callable[[Table, pathlib.Path], None]] = {
    "webdataset": webdataset.write_webdataset, "hdf5": hdf5.write_hdf5, "parquet": parquet.write_parquet,
    "lerobot": lerobot.write_lerobot, "mcap": mcap.write_mcap,
}


@dataclasses.dataclass(frozen=True)
class Exported:
    """What was written.

    Attributes:
      folder: where; README.md in it is the dataset card.
      format: one of FORMATS.
      rows: touches or samples.
      files: relative to the folder, sorted.
      bytes: of all of them.
    """

    folder: pathlib.Path
    format: str
    rows: int
    files: tuple[str, ...]
    bytes: int


@dataclasses.dataclass(frozen=True)
class _Watched(Table):
    """A table that tells how many of its rows were read."""

    table: Table | None = None
    on_rows: Callable[[int, int], None] = lambda done, rows: None

    def batches(self) -> Iterator[dict[str, Values]]:
        assert self.table is not None
        done = 0
        for batch in self.table.batches():
            yield batch
            done += len(next(iter(batch.values())))
            self.on_rows(done, self.rows)


def export(source: str | os.PathLike[str], out: str | os.PathLike[str], to: str = "parquet", *, force: bool = False,
           on_rows: Callable[[int, int], None] | None = None) -> Exported:
    """Writes a finished dataset or a measured set in a format of other tools, into a new folder: whole or not at all.

    Args:
      source: the folder of `touchstone stream`, a measurement file (.csv), the journal of a rig's session (.db), what `touchstone
        session export` wrote (.h5), or a folder of photographs (images.csv).
      out: a folder that does not exist.
      to: "parquet", "lerobot", "webdataset", "hdf5" or "mcap".
      force: what is there is replaced, if an export made it.
      on_rows: called with the rows that are done and all rows, now and then.

    Raises:
      InvalidRequest: what cannot be meant.
      NotFound: the source, or the folder that `out` would stand in, is not there.
      Refused: a dataset that is not finished or was changed, or a package that is missing. Nothing is left of an export that fails.
    """
    write = FORMATS.get(to)
    if write is None:
        raise InvalidRequest(f"to: unknown format '{to}'{did_you_mean(to, sorted(FORMATS))}.")
    path, target = pathlib.Path(source), pathlib.Path(out)
    if not path.exists():
        raise NotFound(f"{path} is not there; the folder of a dataset, a measurement file (.csv) or a journal (.db) was expected.")
    _check_target(path, target, force)
    try:
        with whole_folder(target) as folder:
            rows = _write(path, folder, to, write, on_rows)
    except OSError as error:
        if error.filename and error.errno != errno.ENOSPC:
            raise
        # A library's, which does not say where.
        why = os.strerror(error.errno) if error.errno else str(error)
        raise Refused(f"{target} could not be written whole, and nothing is left of it: {why}.") from None
    files = sorted(file for file in target.rglob("*") if file.is_file())
    return Exported(target, to, rows, tuple(str(file.relative_to(target)) for file in files), sum(file.stat().st_size for file in files))


def _check_target(source: pathlib.Path, target: pathlib.Path, force: bool) -> None:
    if not target.exists():
        check_target(target, force)
        return
    if target.resolve() == source.resolve() or target.resolve() in source.resolve().parents:
        raise InvalidRequest(f"{target} is what is exported, or holds it; choose another folder.")
    check_target(target, force)
    exported = (target / "README.md").is_file() and "exported by touchstone" in (target / "README.md").read_text(encoding="utf-8", errors="replace")
    if not exported and not (target.is_dir() and not any(target.iterdir())):
        raise InvalidRequest(f"{target} exists and is no export of touchstone's: it is not replaced. Choose another name, or remove it.")


def _write(path: pathlib.Path, folder: pathlib.Path, to: str, write: Callable[[Table, pathlib.Path], None],
           on_rows: Callable[[int, int], None] | None) -> int:
    recording = path.suffix in (".db", ".csv", ".h5") and path.is_file()
    if recording and to in ("mcap", "hdf5"):
        return _write_recording(path, folder, to)
    if path.suffix == ".h5":
        raise InvalidRequest(f"{path}: an HDF5 file of a session goes to mcap alone; export its journal (.db) or measurement file (.csv).")
    if recording and path.suffix == ".db":
        with sessions.session_as(path, ".csv") as exported:
            return _write_table(sessions.open_measurements(exported, path.stem), folder, write, on_rows)
    if recording:
        return _write_table(sessions.open_measurements(path), folder, write, on_rows)
    if path.is_file():
        raise InvalidRequest(f"{path}: a folder of `touchstone stream`, a measurement file (.csv), a journal (.db) or an exported session (.h5) "
                             "was expected.")
    table: Table = sessions.open_photographs(path) if (path / "images.csv").exists() else open_dataset(path)
    return _write_table(table, folder, write, on_rows)


def _write_table(table: Table, folder: pathlib.Path, write: Callable[[Table, pathlib.Path], None],
                 on_rows: Callable[[int, int], None] | None) -> int:
    watched: Table = table
    # A WebDataset is copied as it is.
    if on_rows is not None and write is not webdataset.write_webdataset:
        watched = _Watched(table.name, table.rows, table.columns, table.objects, table.provenance, table.manifest, table, on_rows)
    write(watched, folder)
    if table.manifest:
        copied = isinstance(table, DatasetFolder) and all((folder / shard["name"]).exists() for shard in table.shards)
        (folder / card.manifest_name(copied)).write_text(table.manifest, encoding="utf-8")
    return table.rows


def _session_file(path: pathlib.Path) -> SessionFile:
    need("h5py", "export of HDF5")
    return SessionFile(path)


def _write_recording(path: pathlib.Path, folder: pathlib.Path, to: str) -> int:
    """A session with all that its journal has: the writers that sessions have anyway."""
    table: Table | None = None
    if path.suffix != ".h5":
        with sessions.session_as(path, ".csv") as exported:
            table = sessions.open_measurements(exported, path.stem)
    with sessions.session_as(path, ".h5") if path.suffix != ".h5" else contextlib.nullcontext(path) as file:
        if to == "hdf5":
            shutil.copyfile(file, folder / "session.h5")
            with _session_file(file) as recorded:
                rows = table.rows if table else recorded.touches + recorded.images
        else:
            rows = export_recording(file, folder / "session.mcap")["/touch"]
    if table is None:
        table = Table(path.stem, rows, (), (), {"kind": "exported session", "file": path.name, "sha256": sha256_of(path)})
    layout = {"hdf5": "`session.h5` is what `touchstone session export` writes: every row of the journal, with checksums, in SI units.",
              "mcap": "`session.mcap` has the channels of `python -m touchstone.mcap`: touches and arm states as touchstone.v1 messages, "
                      "poses and pictures as Foxglove's, in SI units. The columns below are those of the measurement file."}[to]
    (folder / "README.md").write_text(card.write_card(table, layout), encoding="utf-8")
    return rows
