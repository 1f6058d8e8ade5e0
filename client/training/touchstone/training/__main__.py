"""python -m touchstone.training: runs experiments and writes their report."""

from __future__ import annotations

import argparse
import dataclasses
import datetime
import hashlib
import pathlib
import shlex
import sys
import time

import touchstone
from touchstone import command

from . import report
from .backbone import Backbone, NoNetwork
from .context import Context
from .experiment import Experiment, experiments
from .result import Result
from .settings import Settings

_DESCRIPTION = """Recognises objects by touches and photographs that are streamed from Touchstone: the seed's experiments,
and what goes beyond them. Writes report.html, report.json and figures (SVG)."""


def main(words: list[str] | None = None) -> int:
    words = sys.argv[1:] if words is None else words
    known = experiments()
    options = _parse(known, words)
    settings = _settings(options)
    wanted = [each for each in known if "all" in options.experiments or each.name in options.experiments]
    settings.out.mkdir(parents=True, exist_ok=True)
    done, left_out = [], []
    with Context(settings) as context:
        for number, each in enumerate(wanted):
            if each.needs_backbone and settings.backbone is None:
                left_out.append((each, "needs --backbone FILE.onnx"))
                continue
            left_s = sum(e.expected_s[0 if settings.quick else 1] for e in wanted[number:])
            print(f"{number + 1}/{len(wanted)} {each.name}: {each.title} (about {left_s / 60:.0f} min for all that is left)",
                  file=sys.stderr, flush=True)
            done.append((each, _run(each, context, again=options.again)))
    # A run of some experiments leaves those of earlier runs in the report.
    now = {each.name: result for each, result in done}
    shown = [(each, now.get(each.name) or _finished(each, settings)) for each in known]
    called = "python -m touchstone.training " + shlex.join(words)
    page = report.write(settings, [(each, result) for each, result in shown if result is not None], left_out, called,
                        datetime.date.today().isoformat())
    for each, result in done:
        print(f"{each.title}: {result.words[0]}")
    for each, why in left_out:
        print(f"{each.title}: left out, {why}")
    print(f"Report: {page}")
    return 0


def _parse(known: list[Experiment], words: list[str]) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m touchstone.training", description=_DESCRIPTION,
                                     epilog="Experiments: " + "; ".join(f"{e.name}: {e.title}" for e in known))
    parser.add_argument("experiments", nargs="+", metavar="EXPERIMENT", choices=["all", *(e.name for e in known)],
                        help="all, or names of experiments")
    parser.add_argument("--out", type=pathlib.Path, default=pathlib.Path("training"), help="folder of the report (training)")
    parser.add_argument("--quick", action="store_true", help="small sets and 3 seeds: minutes instead of hours")
    parser.add_argument("--seeds", type=command.whole_number, help="repetitions, over which the intervals are (10)")
    parser.add_argument("--seed", type=command.whole_number, default=1, help="the first seed (1)")
    parser.add_argument("--server", default="", metavar="HOST:PORT", help="the simulator; without it one is started")
    parser.add_argument("--rig", default="", metavar="HOST:PORT", help="a gateway; without it an emulated rig is started")
    parser.add_argument("--rig-is-real", action="store_true", help="the gateway's arm is one of metal: call its data measured")
    parser.add_argument("--backbone", type=pathlib.Path, metavar="FILE.onnx", help="image network, trained on others' pictures")
    parser.add_argument("--everyday", type=pathlib.Path, metavar="FOLDER", help="the ten everyday meshes")
    parser.add_argument("--again", action="store_true", help="also what is finished: without it a run goes on where it ended")
    return parser.parse_args(words)


def _settings(options: argparse.Namespace) -> Settings:
    for name, path in (("--backbone", options.backbone), ("--everyday", options.everyday)):
        if path is not None and not path.exists():
            raise touchstone.InvalidRequest(f"{name} {path}: no such {'file' if name == '--backbone' else 'folder'}")
    if options.backbone is not None:
        try:
            Backbone(options.backbone, workers=1)  # a file that will not do is refused now, not an hour later
        except NoNetwork as error:
            raise touchstone.InvalidRequest(str(error)) from None
    if options.rig_is_real and not options.rig:
        raise touchstone.InvalidRequest("--rig-is-real needs --rig HOST:PORT: the rig that is started otherwise is emulated")
    if options.rig:
        _check_rig(options.rig, options.rig_is_real)
    if options.seeds is not None and options.seeds < 2:
        raise touchstone.InvalidRequest(f"--seeds {options.seeds}: at least 2 are needed for an interval")
    return Settings(options.out, options.quick, options.seeds or (3 if options.quick else 10), options.seed, options.server,
                    options.rig, options.rig_is_real, options.backbone, options.everyday)


def _check_rig(target: str, is_real: bool) -> None:
    """What the source itself says: whether it is a rig, and whether an emulator stands in for its arm."""
    with touchstone.connect(target) as client:
        if not client.is_physical:
            raise touchstone.InvalidRequest(f"--rig {target}: this is a {client.describe().kind} source, which has no arm; the address of a "
                                            "touchstone-gateway was expected. A simulator is named with --server")
        if is_real and client.rig.status().emulated:
            raise touchstone.InvalidRequest(f"--rig-is-real: the gateway at {target} says that its rig is emulated; its data measure nothing, "
                                            "and are called emulated")


def _run(experiment: Experiment, context: Context, again: bool) -> Result:
    """The experiment, or what it found before with the same code and settings."""
    context.begin(experiment.name)
    found = None if again else _finished(experiment, context.settings)
    if found is not None:
        print(f"  finished before ({_path(experiment, context.settings)})", file=sys.stderr)
        return found
    begin = time.monotonic()
    result = experiment.run(context)
    result.name, result.title, result.seconds = experiment.name, experiment.title, round(time.monotonic() - begin, 1)
    result.save(_path(experiment, context.settings), _digest(context.settings))
    return result


def _path(experiment: Experiment, settings: Settings) -> pathlib.Path:
    return settings.out / f"{experiment.name}.json"


def _finished(experiment: Experiment, settings: Settings) -> Result | None:
    """What it found before with the same code and settings."""
    found = Result.load(_path(experiment, settings), _digest(settings))
    complete = found is not None and all((settings.out / figure.file).exists() for figure in found.figures)
    return found if complete else None


def _digest(settings: Settings) -> str:
    """Of this package's code and of the settings, but for the folder."""
    code = hashlib.sha256()
    for path in sorted(pathlib.Path(__file__).parent.rglob("*.py")):
        code.update(path.read_bytes())
    code.update(repr(dataclasses.replace(settings, out=pathlib.Path())).encode())
    return code.hexdigest()


if __name__ == "__main__":
    command.run(main)
