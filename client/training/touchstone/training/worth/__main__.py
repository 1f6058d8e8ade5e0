"""python -m touchstone.training.worth: what a better model is worth to a recogniser."""

from __future__ import annotations

import argparse
import contextlib
import json
import pathlib
import shutil
import sys
import time
from collections.abc import Sequence

import touchstone

from .experiment import POSES, worth
from .result import Worth

_EPILOG = """examples:
  touchstone worth set.csv --model nominal.yaml --better better.yaml --fitted diagnosed.csv
  touchstone worth set.csv --model nominal.yaml --better better.yaml --train mine.py --figure worth.svg --json worth.json
      mine.py has fit(features, labels, seed), which returns an object with predict(features); without --train: XGBoost
  touchstone worth set.csv --model nominal.yaml --better better.yaml --mesh cup=cup.off --poses set
"""


def main(arguments: Sequence[str] | None = None) -> int:
    options = _parse(arguments)
    try:
        with contextlib.ExitStack() as stack:
            client = None
            if options.server:
                for option, given in (("--mesh", options.mesh), ("--mesh-dir", options.mesh_dir)):
                    if given:
                        return _refuse(f"{option}: works only without --server; give it to touchstone-server instead (the same option there)")
                client = stack.enter_context(touchstone.connect(options.server))
            found = worth(options.set, options.model, options.better, options.train, fitted=options.fitted, meshes=options.mesh,
                          mesh_dirs=options.mesh_dir, client=client, samples=options.samples, touches=options.touches, poses=options.poses,
                          seeds=options.seeds, seed=options.seed, on_progress=_Progress())
    except touchstone.TouchstoneError as error:
        return _refuse(str(error))
    return _write(found, options)


def _refuse(why: str) -> int:
    print(f"touchstone worth: {why}", file=sys.stderr)
    return 1


def _write(found: Worth, options: argparse.Namespace) -> int:
    try:
        if options.figure is not None:
            from .figure import draw

            draw(found, options.figure)
        if options.json == "-":
            print(json.dumps(found.to_dict(), indent=1))
            return 0
        if options.json is not None:
            found.save(options.json)
    except OSError as error:
        return _refuse(f"{error.filename}: {error.strerror}")
    print(found.text(shutil.get_terminal_size((100, 24)).columns))
    return 0


def _parse(arguments: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog="touchstone worth", description="What a better model is worth to your recogniser: trains it on simulated touches of the nominal "
        "model, of each step to the better one, and on measured touches, and tests each on measured touches of poses that it was not "
        "trained on. All with 95 % intervals over poses, simulation and training.",
        epilog=_EPILOG, formatter_class=argparse.RawDescriptionHelpFormatter)
    add = parser.add_argument
    add("set", metavar="SET", help="measured touches with poses (CSV), of two objects or more")
    add("--model", required=True, metavar="FILE", help="the nominal model")
    add("--better", required=True, metavar="FILE", help="the better model, as touchstone diagnose --save-model writes it")
    add("--train", metavar="FILE.py", help="the recogniser: fit(features, labels, seed) -> object with predict(features). Default: XGBoost")
    add("--fitted", metavar="SET", help="what the better model was fitted to: none of its poses is tested")
    add("--mesh", action="append", default=[], metavar="NAME=FILE", help="mesh of an object, NAME=FILE[,unit=mm|cm|m|inch][,up=z|y|x]; may be repeated")
    add("--mesh-dir", action="append", default=[], metavar="FOLDER", help="folder of mesh files that bear the names of objects; may be repeated")
    add("--server", default="", metavar="HOST:PORT", help="a touchstone-server. Default: one is started")
    add("--samples", type=int, default=960, metavar="N", help="simulated touches of each object in training (960)")
    add("--touches", type=int, default=8, metavar="N", help="touches that the recogniser sees at once (8)")
    add("--poses", default="faces", choices=POSES, help="where simulated touches go: faces, sphere, or set: the poses of the set that are not "
        "tested (faces)")
    add("--seeds", type=int, default=5, metavar="N", help="how often all is simulated and trained anew, from 2 (5)")
    add("--seed", type=int, default=1, metavar="N", help="the first of them (1)")
    add("--json", metavar="FILE", help="write every number as JSON; -: to standard output, in the table's place")
    add("--figure", type=pathlib.Path, metavar="FILE.svg", help="draw accuracies and learning curves")
    return parser.parse_args(arguments)


class _Progress:
    """A line on stderr when something new is under way, at most every 2 seconds."""

    def __init__(self) -> None:
        self._begin = self._said = time.monotonic()

    def __call__(self, what: str, share: float) -> None:
        now = time.monotonic()
        if now - self._said < 2:
            return
        self._said = now
        passed = now - self._begin
        left = f", {passed * (1 - share) / share:.0f} s left" if share > 0.05 else ""
        print(f"{share:4.0%} after {passed:.0f} s{left}  {what}", file=sys.stderr, flush=True)


if __name__ == "__main__":
    try:
        sys.exit(main())
    except KeyboardInterrupt:
        sys.exit(130)
