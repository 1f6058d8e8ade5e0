"""Training at real size: a million touches with photographs streamed into a learner, and how long it waits for them."""

from __future__ import annotations

import contextlib
import os
import pathlib
import shutil
import subprocess
import tempfile
import time
import warnings
from collections.abc import Iterator

import matplotlib.pyplot as plt
import numpy as np
import torch

import touchstone
from touchstone.own_server import OwnServer, find_server
from touchstone.torch import TouchstoneDataset

from .. import figures, streaming
from ..context import Context
from ..experiment import Experiment
from ..result import Estimate, Result, Table
from ..settings import SUPERSHAPES
from ..statistics import estimate
from ..streaming import PARTS, Feeding

SIDE_PX = 64
BATCH = 500
RADIUS_RATIO = 2.4  # the camera sees the whole object
PLAN = touchstone.sphere(step_angle_deg=1, roll_step_deg=1, radius_ratio=RADIUS_RATIO)
WORKERS = (1, 2, 4)
MAX_WAIT_SHARE = 0.05
# Memory may move by as much between the second part of the run and its last and be called flat.
FLAT = 0.05


def run(context: Context) -> Result:
    settings = context.settings
    context.stop_rigs()  # it would take a part of a core that is measured here
    short, long = settings.pick((5_000, 10_000), (20_000, 1_000_000))
    seed, found = settings.seed, {}
    with streaming.one_torch_thread(), _source(settings.server) as (target, data_cores, learner_cores):
        for place, workers in enumerate(WORKERS):
            context.progress(0.02 * place, f"stream, {workers} workers")
            with _stream(target, short, seed + place, workers, data_cores) as batches, streaming.on_cores(learner_cores):
                found[f"stream, {workers} {_workers(workers)}"] = streaming.feed(batches, short, SIDE_PX, len(SUPERSHAPES), seed)
        context.progress(0.06, "shards")
        written_s, size_mb, found["shards, 1 worker"] = _from_shards(short, seed + len(WORKERS), data_cores, learner_cores)
        best = min(WORKERS, key=lambda workers: found[f"stream, {workers} {_workers(workers)}"].wait_share)
        with _stream(target, long, seed + 100, best, data_cores) as batches, streaming.on_cores(learner_cores):
            whole = streaming.feed(batches, long, SIDE_PX, len(SUPERSHAPES), seed,
                                   lambda share: context.progress(0.1 + 0.9 * share, "the long run"))
    shards = {"written_s": written_s, "size_mb": size_mb, "samples": short}
    return _result(context, found, whole, best, shards, data_cores != learner_cores)


@contextlib.contextmanager
def _source(named: str) -> Iterator[tuple[str, set[int], set[int]]]:
    """A simulator's address; the cores for it and the loader's workers, and those for the learner: one core of its own.

    A simulator that was named is left where it is.
    """
    cores = sorted(os.sched_getaffinity(0))
    data, learner = (set(cores[:-1]), {cores[-1]}) if len(cores) > 1 else (set(cores), set(cores))
    if named:
        yield named, data, learner
        return
    with streaming.on_cores(data):
        server = OwnServer(["--threads", str(len(data))])
    try:
        yield server.target, data, learner
    finally:
        server.stop()


@contextlib.contextmanager
def _stream(target, samples, seed, workers, cores):
    """Batches of the stream; the workers, which start with the first batch, run on `cores`."""
    dataset = TouchstoneDataset(target, list(SUPERSHAPES), PLAN, samples=samples, seed=seed, batch_size=BATCH,
                                image=(SIDE_PX, SIDE_PX), columns=["object", "descriptor", "image"])
    yield _Started(dataset.loader(num_workers=workers), cores)


class _Started:
    """A loader whose workers are started on these cores, whatever the learner's."""

    def __init__(self, loader, cores):
        self._loader, self._cores = loader, cores

    def __iter__(self):
        with streaming.on_cores(self._cores):
            with warnings.catch_warnings():
                # PyTorch counts the cores of this moment; several workers on them are what is to be measured.
                warnings.filterwarnings("ignore", "This DataLoader will create")
                iterator = iter(self._loader)
                first = next(iterator)
        yield first
        yield from iterator


def _from_shards(samples, seed, data_cores, learner_cores) -> tuple[float, float, Feeding]:
    """Seconds that writing took, megabytes, and the learner's run on what was written."""
    folder = pathlib.Path(tempfile.mkdtemp(prefix="touchstone-shards-"))
    try:
        begin = time.monotonic()
        with streaming.on_cores(data_cores):
            subprocess.run([str(pathlib.Path(find_server()).parent / "touchstone"), "stream", "--objects", ",".join(SUPERSHAPES),
                            "--samples", str(samples), "--seed", str(seed), "--plan", "sphere", "--step-angle-deg", "1",
                            "--roll-step-deg", "1", "--radius-ratio", str(RADIUS_RATIO), "--image", f"{SIDE_PX}x{SIDE_PX}", "--encoding",
                            "raw", "--columns", "object,descriptor,image", "--threads", str(len(data_cores)), "--shard-size",
                            str(max(BATCH, samples // 10)), "--out", str(folder), "--quiet"], check=True)
        written_s = time.monotonic() - begin
        paths = sorted(folder.glob("*.tar"))
        dataset = streaming.Shards(paths, SUPERSHAPES, BATCH)
        # gRPC does not survive a fork, and this process may have used it.
        loader = torch.utils.data.DataLoader(dataset, batch_size=None, num_workers=1, multiprocessing_context="forkserver")
        with streaming.on_cores(learner_cores):
            fed = streaming.feed(_Started(loader, data_cores), samples, SIDE_PX, len(SUPERSHAPES), seed)
        return written_s, sum(path.stat().st_size for path in paths) / 1e6, fed
    finally:
        shutil.rmtree(folder)


def _result(context, found, whole, best, shards, own_core) -> Result:
    rate, share = (estimate([part[k] for part in whole.parts]) for k in (0, 1))
    growth = whole.memory_mb[-1] / whole.memory_mb[1] - 1
    others = max(0.0, whole.machine_cores - whole.cores)
    shared = "a core of its own" if own_core else "no core of its own"
    result = Result("", "", made_on=[
        (f"{whole.samples:,} samples, each a touch and a {SIDE_PX} x {SIDE_PX} grey picture of one of {len(SUPERSHAPES)} objects, "
         f"simulated while the learner learned, {best} loader {_workers(best)}"),
        f"{next(iter(found.values())).samples:,} samples for each of the short runs",
        (f"{os.cpu_count()} cores, {torch.__version__} of PyTorch; the learner had {shared}; intervals are over {PARTS} equal parts of "
         "the one run: a million samples are streamed once, and not for every seed")])
    result.words = [
        (f"{whole.samples:,} samples were learned from in {whole.seconds / 60:.1f} min, {_rate(rate)} samples a second; the learner "
         f"waited for data {share.words()} of the time, which {'keeps to' if whole.wait_share <= MAX_WAIT_SHARE else 'misses'} the "
         f"{MAX_WAIT_SHARE:.0%} that are asked for."),
        _why(whole, others, own_core),
        (f"Memory of all processes was {whole.memory_mb[1]:.0f} MB after {2 / PARTS:.0%} of the run and {whole.memory_mb[-1]:.0f} MB at its "
         f"end ({growth:+.1%}), {'flat' if abs(growth) <= FLAT else 'not flat'}. They sent {whole.written_mb:.1f} MB to the disk; the "
         f"samples themselves are {whole.samples * SIDE_PX**2 / 1e6:,.0f} MB."),
        (f"Every sample is new, so each is judged before it is learned from: {whole.accuracy[0]:.1%} were recognised in the first part of "
         f"the run and {whole.accuracy[-1]:.1%} in its last."),
        f"From shards: writing {shards['samples']:,} samples took {shards['written_s']:.1f} s ({shards['size_mb']:.0f} MB)."]
    rows = [[name, _row(fed)] for name, fed in [*found.items(), (f"the long run, {best} {_workers(best)}", whole)]]
    result.tables = [Table("A learner fed in several ways", ["fed by", "samples", "samples a second", "time waiting",
                                                             "until the first batch, s", "cores used", "cores used by others"],
                           [[name, *cells] for name, cells in rows],
                           f"Time waiting: in next(), of the time from the first batch on, wanted: at most {MAX_WAIT_SHARE:.0%}. The shards "
                           "were written before and may still be in the memory of the system.")]
    result.figures = [_draw(context, found, whole, best)]
    result.data = {"runs": {name: vars(fed) for name, fed in found.items()}, "whole": vars(whole), "workers": best, "shards": shards}
    return result


def _why(whole, others, own_core) -> str:
    used = (f"Taking batches that were ready cost {whole.handover_share:.1%} of the time. Its processes kept {whole.cores:.2f} cores "
            f"busy, other programs {others:.2f}, of {os.cpu_count()}")
    if whole.wait_share <= MAX_WAIT_SHARE:
        return f"{used}: the simulator was ahead of the learner."
    if whole.handover_share > MAX_WAIT_SHARE / 2:
        why = ["taking a batch from another process alone costs a good part of what is allowed"]
    else:
        why = ["batches were not there in time from the other cores" if own_core else "simulator and learner share their cores"]
    if others > 0.1:
        why.append("other programs took cores from both")
    return f"{used}. It waits because {' and '.join(why)}."


def _row(fed: Feeding) -> list[str]:
    rate, share = (estimate([part[k] for part in fed.parts]) for k in (0, 1))
    return [f"{fed.samples:,}", _rate(rate), share.words(), f"{fed.start_s:.1f}", f"{fed.cores:.2f}",
            f"{max(0.0, fed.machine_cores - fed.cores):.2f}"]


def _rate(rate: Estimate) -> str:
    return f"{rate.value:,.0f} ({rate.low:,.0f} to {rate.high:,.0f})"


def _workers(count: int) -> str:
    return "worker" if count == 1 else "workers"


def _draw(context, found, whole, best):
    figure, (left, right) = plt.subplots(1, 2, figsize=(9, 3.6), gridspec_kw={"width_ratios": [1.3, 1]})
    names = [*found, f"long run, {best} {_workers(best)}"]
    for place, fed in enumerate([*found.values(), whole]):
        share = estimate([100 * part[1] for part in fed.parts])
        left.barh(place, share.value, 0.6, color=figures.colour("virtual"), xerr=[[share.value - share.low], [share.high - share.value]],
                  error_kw={"ecolor": "#1f2933", "elinewidth": 1, "capsize": 2})
    left.axvline(100 * MAX_WAIT_SHARE, color="#1f2933", linestyle="--", linewidth=1)
    left.annotate(f"at most {MAX_WAIT_SHARE:.0%}", (100 * MAX_WAIT_SHARE, 1.0), xycoords=("data", "axes fraction"),
                  ha="left", va="bottom", fontsize=8)
    left.set_yticks(range(len(names)), names)
    left.invert_yaxis()
    left.set_xlim(left=0)
    left.set_xlabel("time that the learner waits for data, %")
    left.grid(False, axis="y")
    at = np.arange(1, PARTS + 1) / PARTS * whole.samples
    right.plot(at, whole.memory_mb, color="#1f2933", marker="o", markersize=4)
    right.set(xlabel="samples", ylabel="memory of all processes, MB", ylim=(0, 1.2 * max(whole.memory_mb)))
    right.ticklabel_format(axis="x", style="plain")
    right.set_xticks([0, whole.samples / 2, whole.samples], ["0", f"{whole.samples // 2:,}", f"{whole.samples:,}"])
    return figures.save(figure, context.figure_path("feeding"), "Left: time that the learner waits for data, with 95 % intervals over "
                        f"{PARTS} parts of each run; dashed: what is asked for. Right: memory during the long run.")


EXPERIMENT = Experiment("real_size", "A million samples, streamed into training", "", run, (30, 1500))
