"""python -m touchstone.training.worth: what a better model is worth to a recogniser; `touchstone worth`."""

from __future__ import annotations

import argparse
import contextlib
import json
import os
import shutil
import sys
import time

import touchstone
from touchstone import command

from .experiment import POSES, worth

_DESCRIPTION = """What a better model is worth to your recogniser: trains it on simulated touches of the nominal model, of each step
to the better one, and on measured touches, and tests each on measured touches of poses that it was not trained on. All with 95 %
intervals over poses, simulation and training."""
_EXAMPLES = """touchstone worth set.csv --model nominal.yaml --better better.yaml --fitted diagnosed.csv
touchstone worth set.csv --model nominal.yaml --better better.yaml --train mine.py --figure worth.svg
touchstone worth set.csv --model nominal.yaml --better better.yaml --mesh cup=cup.off --poses set"""


def main(words: list[str]) -> None:
    options = _parser().parse(words)
    if options.figure and not options.figure.endswith((".svg", ".png", ".pdf")):
        raise touchstone.InvalidRequest(f"--figure {options.figure}: .svg, .png or .pdf was expected at its end")
    if options.figure and os.path.exists(options.figure) and not options.force:
        raise touchstone.InvalidRequest(f"{options.figure}: exists already; --force replaces it")
    with contextlib.ExitStack() as stack:
        client = None
        if options.server:
            for option, given in (("--mesh", options.mesh), ("--mesh-dir", options.mesh_dir)):
                if given:
                    raise touchstone.InvalidRequest(f"{option}: works only without --server; give it to touchstone-server instead (the same "
                                                    "option there)")
            client = stack.enter_context(touchstone.connect(options.server))
        found = worth(options.set, options.model, options.better, options.train, fitted=options.fitted, meshes=options.mesh,
                      mesh_dirs=options.mesh_dir, client=client, samples=options.samples, touches=options.touches, poses=options.poses,
                      seeds=options.seeds, seed=options.seed, on_progress=None if options.quiet else _Progress())
    if options.figure:
        from .figure import draw

        draw(found, options.figure)
        command.log(options.quiet, f"{options.figure} written")
    print(json.dumps(found.to_dict(), indent=1) if options.json else found.text(shutil.get_terminal_size((100, 24)).columns))


def _parser() -> command.CommandParser:
    parser = command.CommandParser("worth", _DESCRIPTION.replace("\n", " "), _EXAMPLES)
    add = parser.add_argument
    add("set", metavar="SET", help="Measured touches with poses (CSV), of two objects or more")
    add("--model", required=True, metavar="FILE", help="The nominal model")
    add("--better", required=True, metavar="FILE", help="The better model, as touchstone diagnose --save-model writes it")
    add("--train", metavar="FILE.py", help="The recogniser: fit(features, labels, seed), which returns an object with predict(features); "
        "features(times_us, speed_mm_s, spacing_mm) if it is to see something else than local curvatures. Default: XGBoost")
    add("--fitted", metavar="SET", help="What the better model was fitted to: none of its poses is tested")
    add("--mesh", action="append", default=[], metavar="NAME=FILE",
        help="Mesh of an object, NAME=FILE[,unit=mm|cm|m|inch][,up=z|y|x]; may be repeated")
    add("--mesh-dir", action="append", default=[], metavar="FOLDER",
        help="Folder of mesh files that bear the names of objects; may be repeated")
    add("--server", default="", metavar="HOST:PORT", help="A touchstone-server. Default: one is started")
    add("--samples", type=_whole, default=960, metavar="N", help="Simulated touches of each object in training. Default: 960")
    add("--touches", type=_whole, default=8, metavar="N", help="Touches that the recogniser sees at once. Default: 8")
    add("--poses", default="faces", choices=POSES, help="Where simulated touches go: faces, sphere, or set: the poses of the set that are not "
        "tested. Default: faces")
    add("--seeds", type=_whole, default=5, metavar="N", help="How often all is simulated and trained anew, from 2. Default: 5")
    add("--seed", type=_whole, default=1, metavar="N", help="The first of them. Default: 1")
    add("--figure", metavar="FILE", help="Draw accuracies and learning curves: .svg, .png or .pdf")
    parser.add_output_options(force=True)
    return parser


def _whole(text: str) -> int:
    """1_000 and 1e3 too."""
    try:
        number = float(text.replace("_", ""))
        if number < 0 or number != int(number):
            raise ValueError
    except (ValueError, OverflowError):
        raise argparse.ArgumentTypeError(f"'{text}' is no whole number from 0 on") from None
    return int(number)


class _Progress:
    """A line on stderr of what is under way: at most every 2 seconds, every 10 where nobody watches."""

    def __init__(self) -> None:
        self._begin = self._said = time.monotonic()
        self._every_s = 2 if sys.stderr.isatty() else 10

    def __call__(self, what: str, share: float) -> None:
        now = time.monotonic()
        if now - self._said < self._every_s:
            return
        self._said = now
        passed = now - self._begin
        left = f", {passed * (1 - share) / share:.0f} s left" if share > 0.05 else ""
        print(f"{share:4.0%} after {passed:.0f} s{left}  {what}", file=sys.stderr, flush=True)


if __name__ == "__main__":
    command.run(main)
