"""python -m touchstone.training.worth: what a better model is worth to a recogniser; `touchstone worth`."""

from __future__ import annotations

import contextlib
import json
import os
import shutil

import touchstone
from touchstone import command
from touchstone.connection import chosen_targets
from touchstone.progress import Progress

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
        server = chosen_targets(options.server or None)
        if server is not None:
            for option, given in (("--mesh", options.mesh), ("--mesh-dir", options.mesh_dir)):
                if given:
                    where = "--server" if options.server else "TOUCHSTONE_SERVER (--server none)"
                    raise touchstone.InvalidRequest(f"{option}: works only without {where}; give it to touchstone-server instead (the same "
                                                    "option there)")
            client = stack.enter_context(touchstone.connect(server))
        progress = stack.enter_context(Progress(options.quiet))
        found = worth(options.set, options.model, options.better, options.train, fitted=options.fitted, meshes=options.mesh,
                      mesh_dirs=options.mesh_dir, client=client, samples=options.samples, touches=options.touches, poses=options.poses,
                      seeds=options.seeds, seed=options.seed, on_progress=progress)
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
    add("--server", default="", metavar="HOST:PORT", help="A touchstone-server; none: one is started. Default: TOUCHSTONE_SERVER, else none")
    add("--samples", type=command.whole_number, default=960, metavar="N", help="Simulated touches of each object in training. Default: 960")
    add("--touches", type=command.whole_number, default=8, metavar="N", help="Touches that the recogniser sees at once. Default: 8")
    add("--poses", default="faces", choices=POSES, help="Where simulated touches go: faces, sphere, or set: the poses of the set that are not "
        "tested. Default: faces")
    add("--seeds", type=command.whole_number, default=5, metavar="N", help="How often all is simulated and trained anew, from 2. Default: 5")
    add("--seed", type=command.whole_number, default=1, metavar="N", help="The first of them. Default: 1")
    add("--figure", metavar="FILE", help="Draw accuracies and learning curves: .svg, .png or .pdf")
    parser.add_output_options(force=True)
    return parser


if __name__ == "__main__":
    command.run(main)
