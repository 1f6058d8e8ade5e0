"""Files that a kill or a full disk cut: whether they are whole, and what can be saved of them."""

from __future__ import annotations

import dataclasses
import io
import os
import pathlib
import tarfile
import tempfile
from collections.abc import Callable, Iterator
from typing import Any

from ..errors import InvalidRequest, Refused
from ..mcap import ExportError, SessionFile
from ..plain_csv import read_csv
from ..whole_file import whole_file
from . import sessions
from .table import need

_AGAIN = "Run the command that made the dataset again: it makes what is missing, byte for byte"


@dataclasses.dataclass(frozen=True)
class Found:
    """What a file has that is whole.

    Attributes:
      path: the file.
      whole: nothing is missing and nothing was changed, as far as its format can say.
      saved: what is there, "812 samples".
      lost: what is not, "" if it is whole.
    """

    path: pathlib.Path
    whole: bool
    saved: str
    lost: str = ""


def verify(source: str | os.PathLike[str]) -> Found:
    """Reads the whole file: a dataset's folder, a shard (.tar), MCAP, Parquet, an exported session (.h5), a journal (.db) or a
    measurement file (.csv).

    Raises:
      InvalidRequest: it is not there, or of no kind that can be told.
      Refused: a package is missing that reads it.
    """
    path = _existing(source)
    if path.is_dir():
        sessions.run_program("dataset", "verify", path)
        return Found(path, True, "every shard as it was written")
    return _of_kind(path)[0](path, None)


def recover(source: str | os.PathLike[str], out: str | os.PathLike[str], *, force: bool = False) -> Found:
    """Writes what is whole of a file to a new one, and says what was saved. The file itself is not changed.

    Args:
      source: a file as of verify(); a dataset's folder is not recovered but resumed.
      out: the new file.
      force: replace `out` if it exists.

    Raises:
      InvalidRequest: the file is not there, or `out` exists.
      Refused: the format leaves nothing that can be read.
    """
    path, target = _existing(source), pathlib.Path(out)
    if path.is_dir():
        raise Refused(f"{path}: a dataset is not recovered but resumed. {_AGAIN}; `touchstone dataset verify` says which shards are whole.")
    if target.exists() and (not force or target.samefile(path)):
        raise InvalidRequest(f"{target} exists; replace it with force=True, or choose another name. What is recovered is never replaced.")
    return _of_kind(path)[1](path, target)


def _existing(source: str | os.PathLike[str]) -> pathlib.Path:
    path = pathlib.Path(source)
    if not path.exists():
        raise InvalidRequest(f"{path} is not there.")
    return path


_Reader = Callable[[pathlib.Path, "pathlib.Path | None"], Found]


def _of_kind(path: pathlib.Path) -> tuple[_Reader, _Reader]:
    """What reads a file and, where it is given a name, writes what is whole."""
    kinds: dict[str, tuple[_Reader, _Reader]] = {
        ".mcap": (_mcap, _mcap), ".tar": (_shard, _shard), ".db": (_journal, _journal), ".h5": (_hdf5, _nothing_left),
        ".parquet": (_parquet, _nothing_left), ".csv": (_measurements, _measurements)}
    suffix = path.name.removesuffix(".part").rpartition(".")[2]
    if f".{suffix}" not in kinds:
        raise InvalidRequest(f"{path}: a file whose name ends in {', '.join(kinds)} was expected, or the folder of a dataset.")
    return kinds[f".{suffix}"]


class _Whole:
    """What of a file is whole, read once from its beginning; `why` is what ended it early, "" if nothing did."""

    def __init__(self) -> None:
        self.why = ""
        self.count = 0
        self.topics: set[str] = set()


# --- Shards

def _shard(path: pathlib.Path, target: pathlib.Path | None) -> Found:
    """A tar file, sample by sample; one that lacks a member which the first one has is no whole sample."""
    whole = _Whole()
    if target is None:
        for _ in _samples(path, whole):
            pass
    else:
        with whole_file(target, "wb") as out, tarfile.open(fileobj=out, mode="w", format=tarfile.USTAR_FORMAT) as written:
            for name, data in (entry for sample in _samples(path, whole) for entry in sample):
                info = tarfile.TarInfo(name)
                info.size = len(data)
                written.addfile(info, io.BytesIO(data))
            if not whole.count:
                raise Refused(f"{path}: no sample in it is whole ({whole.why}). {_AGAIN}.")
    return Found(path, not whole.why, f"{whole.count} samples", f"what came after them: {whole.why}" if whole.why else "")


def _samples(path: pathlib.Path, whole: _Whole) -> Iterator[list[tuple[str, bytes]]]:
    sample: list[tuple[str, bytes]] = []
    places: set[str] = set()
    try:
        with tarfile.open(path, "r:") as archive:
            for member in archive:
                file = archive.extractfile(member)
                data = file.read() if file else b""
                if sample and sample[-1][0].partition(".")[0] != member.name.partition(".")[0]:
                    places = places or _places(sample)
                    whole.count += 1
                    yield sample
                    sample = []
                sample.append((member.name, data))
        # Two empty blocks end every tar file.
        with open(path, "rb") as stream:
            stream.seek(-min(1024, path.stat().st_size), os.SEEK_END)
            whole.why = "its end is missing" if stream.read().strip(b"\0") else ""
    except (tarfile.TarError, EOFError) as error:
        whole.why = str(error)
    if sample and (_places(sample) == places or (not places and not whole.why)):
        whole.count += 1
        yield sample
    elif sample:
        whole.why = whole.why or "its last sample is cut"


def _places(sample: list[tuple[str, bytes]]) -> set[str]:
    return {name.partition(".")[2] for name, _ in sample}


# --- MCAP

def _mcap(path: pathlib.Path, target: pathlib.Path | None) -> Found:
    whole = _Whole()
    if target is None:
        for _ in _records(path, whole):
            pass
    else:
        with whole_file(target, "wb") as out:
            _write_mcap(_records(path, whole), out)
            if not whole.count:
                raise Refused(f"{path}: no message in it is whole ({whole.why or 'there are none'}).")
    return Found(path, not whole.why, f"{whole.count} messages of {len(whole.topics)} topics",
                 f"what came after them: {whole.why}" if whole.why else "")


def _records(path: pathlib.Path, whole: _Whole) -> Iterator[Any]:
    records = need("mcap.records", "reading MCAP", "mcap")
    stream_reader = need("mcap.stream_reader", "reading MCAP", "mcap")
    ended = False
    with open(path, "rb") as stream:
        read = iter(stream_reader.StreamReader(stream, validate_crcs=True).records)
        while True:
            try:
                record = next(read)
            except StopIteration:
                break
            except Exception as error:  # noqa: BLE001 (those of mcap, of struct and of the decompressors have no common base)
                whole.why = f"{type(error).__name__} {error}".strip()
                return
            ended = ended or isinstance(record, records.Footer)
            whole.count += isinstance(record, records.Message)
            if isinstance(record, records.Channel):
                whole.topics.add(record.topic)
            yield record
    whole.why = "" if ended else "its end is missing"


def _write_mcap(kept: Iterator[Any], out: Any) -> None:
    records = need("mcap.records", "writing MCAP", "mcap")
    writer = need("mcap.writer", "writing MCAP", "mcap").Writer(out)
    first = next(kept, None)
    head = first if isinstance(first, records.Header) else records.Header(profile="", library="")
    writer.start(profile=head.profile, library=head.library)
    schemas: dict[int, int] = {0: 0}
    channels: dict[int, int] = {}
    for record in kept:
        if isinstance(record, records.Schema) and record.id not in schemas:
            schemas[record.id] = writer.register_schema(name=record.name, encoding=record.encoding, data=record.data)
        elif isinstance(record, records.Channel) and record.id not in channels:
            channels[record.id] = writer.register_channel(topic=record.topic, message_encoding=record.message_encoding,
                                                          schema_id=schemas[record.schema_id], metadata=record.metadata)
        elif isinstance(record, records.Message):
            writer.add_message(channel_id=channels[record.channel_id], log_time=record.log_time, publish_time=record.publish_time,
                               sequence=record.sequence, data=record.data)
        elif isinstance(record, records.Metadata):
            writer.add_metadata(record.name, record.metadata)
        elif isinstance(record, records.Attachment):
            writer.add_attachment(create_time=record.create_time, log_time=record.log_time, name=record.name,
                                  media_type=record.media_type, data=record.data)
    writer.finish()


# --- Sessions

def _journal(path: pathlib.Path, target: pathlib.Path | None) -> Found:
    """Every touch has a checksum; `session verify` checks all of a session, and a journal may have several."""
    try:
        listed = sessions.ask_program("session", "list", path)["sessions"]
        unreadable = ""
    except (InvalidRequest, Refused) as error:
        listed, unreadable = [], str(error).partition(": ")[2]
        if target is None:
            return Found(path, False, "nothing", unreadable)
    if target is not None:
        return _saved_journal(path, target, [session["name"] for session in listed], unreadable)
    lost = []
    for session in listed:
        try:
            sessions.ask_program("session", "verify", path, session["name"])
        except Refused as error:
            lost.append(str(error).partition(": ")[2])
    return Found(path, not lost, _counted(listed), "; ".join(lost))


def _counted(listed: list[dict[str, Any]]) -> str:
    """The numbers of `session list`."""
    touches, done = (sum(session[name] for session in listed) for name in ("touches", "done"))
    return (f"{touches} touches" + (f" ({done} of them done)" if done < touches else "")
            + (f" in {len(listed)} sessions" if len(listed) != 1 else ""))


def _saved_journal(path: pathlib.Path, target: pathlib.Path, names: list[str], unreadable: str) -> Found:
    """What is whole of it: one session as .csv or .db, several as .db."""
    if target.suffix not in (".csv", ".db"):
        raise InvalidRequest(f"{target}: what a journal has is saved as .csv or .db.")
    if target.suffix == ".csv" and len(names) > 1:
        raise InvalidRequest(f"{target}: {path} has {len(names)} sessions ({', '.join(names)}), which a .csv cannot hold together; name a .db, or "
                             f"write one: touchstone session export {path} NAME --skip-damaged -o {target}.")
    rows, lost = 0, [unreadable] if unreadable else []
    with tempfile.TemporaryDirectory(prefix="touchstone-verify-") as folder:
        saved = pathlib.Path(folder) / "saved.db"
        for at, name in enumerate(names or [""]):
            exported = pathlib.Path(folder) / f"{at}.csv"
            words: list[str | os.PathLike[str]] = ["session", "export", path, *([name] if name else []), "-o", exported]
            try:
                sessions.run_program(*words)
            except (InvalidRequest, Refused) as error:
                lost.append(str(error).partition(": ")[2])
                sessions.run_program(*words, "--skip-damaged")
            rows += len(read_csv(exported)[1])
            if target.suffix == ".db":
                sessions.run_program("session", "import", exported, "-o", saved, "--session", name or path.stem)
        with whole_file(target, "wb") as out:
            out.write((saved if target.suffix == ".db" else exported).read_bytes())
    return Found(path, not lost, f"{rows} touches" + (f" of {len(names)} sessions" if len(names) > 1 else ""), "; ".join(lost))


def _measurements(path: pathlib.Path, target: pathlib.Path | None) -> Found:
    """A CSV file whose last line may be cut off."""
    with tempfile.TemporaryDirectory(prefix="touchstone-verify-") as folder:
        def count(file: pathlib.Path) -> int:
            sessions.run_program("session", "import", file, "-o", pathlib.Path(folder) / f"{file.stem}.db")
            return len(read_csv(file)[1])

        why = ""
        try:
            rows = count(path)
        except InvalidRequest as error:
            why = str(error).partition(": ")[2]
            lines = path.read_bytes().split(b"\n")
            cut = pathlib.Path(folder) / "whole.csv"
            # The last line has no end, or is empty behind the last end.
            cut.write_bytes(b"\n".join(lines[:-1]) + b"\n")
            try:
                rows = count(cut)
            except InvalidRequest:
                raise Refused(f"{path}: {why}. Not its last line alone is wrong; `touchstone session fix` corrects what it can.") from None
            if target is not None:
                with whole_file(target, "wb") as out:
                    out.write(cut.read_bytes())
        else:
            if target is not None:
                with whole_file(target, "wb") as out:
                    out.write(path.read_bytes())
    return Found(path, not why, f"{rows} touches", f"the last line: {why}" if why else "")


# --- Formats whose index stands at the end or is spread over the file

def _hdf5(path: pathlib.Path, _: pathlib.Path | None) -> Found:
    h5py = need("h5py", "reading HDF5")
    try:
        with h5py.File(path, "r") as file:
            session = "session/format" in file
            rows = 0 if session else len(next(iter(file.values())))
            if not session:
                for dataset in file.values():
                    if isinstance(dataset, h5py.Dataset):
                        dataset[...]
        if session:
            with SessionFile(path) as opened:
                return Found(path, True, f"{opened.touches} touches, {opened.images} pictures")
    except ExportError as error:
        return Found(path, False, "nothing that can be trusted", str(error))
    except OSError as error:
        return Found(path, False, "nothing", f"it cannot be read as HDF5: {error}")
    return Found(path, True, f"{rows} samples")


def _parquet(path: pathlib.Path, _: pathlib.Path | None) -> Found:
    need("pyarrow", "reading Parquet")
    try:
        rows = need("pyarrow.parquet", "reading Parquet").read_table(path).num_rows
    except Exception as error:  # noqa: BLE001 (pyarrow's errors have no common base)
        return Found(path, False, "nothing", f"it cannot be read as Parquet: {error}")
    return Found(path, True, f"{rows} rows")


def _nothing_left(path: pathlib.Path, target: pathlib.Path | None) -> Found:
    found = _of_kind(path)[0](path, target)
    if found.whole:
        raise InvalidRequest(f"{path} is whole ({found.saved}); there is nothing to recover.")
    kind = "HDF5" if ".h5" in path.name else "Parquet"
    again = f"{_AGAIN}, or export the session's journal again" if kind == "HDF5" else "Export again: an export is whole or not there"
    raise Refused(f"{path}: of a cut {kind} file nothing can be saved, since what says where its values lie is lost ({found.lost}). {again}.")
