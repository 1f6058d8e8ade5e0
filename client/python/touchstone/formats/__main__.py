"""touchstone export, import, verify and recover."""

from __future__ import annotations

import json
import pathlib

from .. import command
from ..errors import InvalidRequest, Refused
from ..printable import printable
from ..progress import Progress
from . import recovery
from .exporting import FORMATS, export
from .importing import import_recording
from .recordings import open_recording

_EXPORT_EXAMPLES = """touchstone export data --to parquet -o data-parquet            a dataset of touchstone stream
touchstone export data --to lerobot -o data-lerobot
touchstone export session.db --to mcap -o monday                a session of a rig, with pictures and arm states
touchstone export set.csv --to parquet -o set-parquet           a measurement file"""

_IMPORT_EXAMPLES = """touchstone import recording.mcap --list                           its topics and fields
touchstone import recording.mcap --map mapping.yaml -o set.csv   then: touchstone compare set.csv ...
touchstone import bag_folder --map mapping.yaml -o session.db    a ROS 2 bag, SQLite or MCAP
touchstone import lerobot_folder --map mapping.yaml -o set.csv
touchstone import table.parquet -o set.csv                       columns with this program's names need no mapping"""


def export_parser() -> command.CommandParser:
    parser = command.CommandParser(
        "export", "Writes a dataset or a session in a format of other tools: Parquet, LeRobot, WebDataset, HDF5, MCAP. Into a new folder "
        "with a dataset card (README.md); numbers are bit for bit those of the source. Exit code 4 if the dataset is not finished or was "
        "changed.", _EXPORT_EXAMPLES)
    parser.add_argument("source", metavar="DATASET", help="The folder of a finished touchstone stream, a measurement file (.csv), a journal "
                        "(.db), what touchstone session export wrote (.h5), or a folder of photographs (images.csv)")
    parser.add_argument("--to", metavar="FORMAT", required=True, help=f"{', '.join(FORMATS)}")
    parser.add_argument("-o", "--out", metavar="FOLDER", required=True, help="The folder to make")
    parser.add_output_options(force=True)
    return parser


def _export(words: list[str]) -> None:
    options = export_parser().parse(words)
    if options.to not in FORMATS:
        raise InvalidRequest(f"--to: unknown format '{options.to}'{command.did_you_mean(options.to, list(FORMATS))}")
    with Progress(options.quiet) as progress:
        progress(f"writing {options.out}")
        written = export(options.source, options.out, options.to, force=options.force, on_rows=progress.rows)
    if options.json:
        print(json.dumps({"folder": str(written.folder), "format": written.format, "rows": written.rows, "files": list(written.files),
                          "bytes": written.bytes}, indent=2))
    files = "1 file" if len(written.files) == 1 else f"{len(written.files)} files"
    command.log(options.quiet, f"wrote {written.folder}: {written.rows} rows as {written.format}, {files}, {written.bytes / 1e6:.1f} MB")


def import_parser() -> command.CommandParser:
    parser = command.CommandParser(
        "import", "Makes a measurement set of another tool's file: MCAP, ROS 2 bag, LeRobot, Parquet. A mapping file says which topic or column is "
        "pose, time, joint, object and finger contact; what it leaves open is asked, with the candidates, and never guessed. What compare "
        "and diagnose cannot read is not written.", _IMPORT_EXAMPLES)
    parser.add_argument("source", metavar="FILE", help="An MCAP file, the folder of a ROS 2 bag or of a LeRobot dataset v3, a Parquet file or a "
                        "folder of them")
    parser.add_argument("--map", metavar="FILE", help="The mapping, YAML; client/python/FORMATS.md says what may stand in it")
    parser.add_argument("-o", "--out", metavar="FILE", help="The set: .csv, or a journal (.db)")
    parser.add_argument("--list", action="store_true", help="Say what the file has, and write nothing")
    parser.add_output_options(force=True)
    return parser


def _import(words: list[str]) -> None:
    parser = import_parser()
    options = parser.parse(words)
    if options.list:
        return _list(options.source, options.json)
    if options.out is None:
        parser.error("-o/--out is required")
    with Progress(options.quiet) as progress:
        progress(f"reading {options.source}")
        made = import_recording(options.source, options.out, options.map, force=options.force)
    if options.json:
        print(json.dumps({"file": str(made.path), "touches": made.rows, "left_out": list(made.left_out)}, indent=2))
    for reason in made.left_out[:5]:
        command.log(options.quiet, f"left out: {reason}")
    more = f", {len(made.left_out)} messages left out" if made.left_out else ""
    command.log(options.quiet, f"wrote {made.path} ({made.rows} touches{more})")
    return None


def _list(source: str, as_json: bool) -> None:
    recording = open_recording(pathlib.Path(source))
    if as_json:
        print(json.dumps({"kind": recording.kind, "topics": [{"name": topic.name, "type": topic.kind, "messages": topic.rows, "fields": {
            path: topic.describe(path) for path in topic.fields}} for topic in recording.topics.values()]}, indent=2))
        return
    print(f"{recording.path}: {recording.kind}")
    for topic in recording.topics.values():
        print(printable(f"\n{topic.name}  {topic.kind}, {topic.rows} messages" if topic.name else f"\n{topic.rows} rows"))
        width = max((len(path) for path in topic.fields), default=0)
        for path in topic.fields:
            print(printable(f"  {path:<{width}}  {topic.describe(path)}"))


def verify_parser() -> command.CommandParser:
    parser = command.CommandParser(
        "verify", "Reads a dataset, a session or a shard and says whether it is whole. By checksums, where the format has some; a cut or a "
        "changed file has exit code 4.", "touchstone verify data                a folder of touchstone stream\n"
        "touchstone verify session.db\ntouchstone verify shard-000003.tar")
    parser.add_argument("source", metavar="FILE", help="A dataset's folder, a shard (.tar), a journal (.db), an exported session (.h5), a "
                        "measurement file (.csv), MCAP or Parquet")
    parser.add_output_options()
    return parser


def recover_parser() -> command.CommandParser:
    parser = command.CommandParser(
        "recover", "Saves what is whole of a file that a kill or a full disk cut, and says what that is. The file itself is not changed.",
        "touchstone recover shard-000003.tar -o saved.tar     the samples before the cut\n"
        "touchstone recover log.mcap -o saved.mcap            the messages before the cut\n"
        "touchstone recover session.db -o saved.csv           the touches whose checksums are right")
    parser.add_argument("source", metavar="FILE", help="A shard (.tar), MCAP, a journal (.db) or a measurement file (.csv)")
    parser.add_argument("-o", "--out", metavar="FILE", required=True, help="The file to write; of a journal .csv or .db")
    parser.add_output_options(force=True)
    return parser


def _verify(words: list[str]) -> None:
    options = verify_parser().parse(words)
    with Progress(options.quiet) as progress:
        progress(f"reading {options.source}")
        found = recovery.verify(options.source)
    _tell(found, options.json)
    if not found.whole:
        raise Refused(f"{found.path} is not whole: {found.saved} can be read; lost: {found.lost}. `touchstone recover` saves what it can.")
    command.log(options.quiet, f"{found.path} is whole: {found.saved}")


def _recover(words: list[str]) -> None:
    options = recover_parser().parse(words)
    with Progress(options.quiet) as progress:
        progress(f"reading {options.source}")
        found = recovery.recover(options.source, options.out, force=options.force)
    _tell(found, options.json)
    command.log(options.quiet, f"wrote {options.out}: {found.saved} saved" + (f"; lost: {found.lost}" if found.lost else "; nothing was lost"))


def _tell(found: recovery.Found, as_json: bool) -> None:
    if as_json:
        print(json.dumps({"file": str(found.path), "whole": found.whole, "saved": found.saved, "lost": found.lost}, indent=2))


def main(words: list[str]) -> None:
    commands = {"export": _export, "import": _import, "verify": _verify, "recover": _recover}
    if not words or words[0] not in commands:
        raise InvalidRequest(f"'{words[0] if words else ''}' is no command of touchstone.formats; one of {', '.join(commands)} was expected.")
    commands[words[0]](words[1:])


if __name__ == "__main__":
    command.run(main)
