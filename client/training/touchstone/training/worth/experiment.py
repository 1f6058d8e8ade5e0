"""Is a better model worth it for a recogniser? The experiment better_model, on a measured set and a recogniser of the user's."""

from __future__ import annotations

import dataclasses
import os
import pathlib
import tempfile
from collections.abc import Iterator, Sequence
from typing import Callable

import numpy as np

import touchstone
from touchstone.models import ModelLike
from touchstone.own_server import OwnServer

from .. import ladder
from ..context import Context
from ..features import FeatureSets, dealt_rows, of_rows
from ..ladder import Rung
from ..recognisers import Trained
from ..result import Estimate
from ..settings import Settings
from ..touch_data import TouchData
from . import measured, result
from .intervals import Resampling, exchange
from .recogniser import Recogniser
from .result import Step, Worth

FOLDS = 5
POSES = ("faces", "sphere", "set")
_STAGES_OF_PICTURES = ("camera pose", "projection", "shading", "image sensor")  # no touch shows them


@dataclasses.dataclass(frozen=True)
class Asked:
    """What worth() is asked for; attributes as its arguments."""

    samples: int
    touches: int
    seeds: int
    seed: int
    poses: str


def worth(measurements: str | os.PathLike[str], model: ModelLike, better: ModelLike, train: str | os.PathLike[str] | None = None, *,
          fitted: str | os.PathLike[str] | None = None, meshes: Sequence[str] = (), mesh_dirs: Sequence[str] = (),
          client: touchstone.Client | None = None, samples: int = 960, touches: int = 8, poses: str = "faces", seeds: int = 5, seed: int = 1,
          on_progress: Callable[[str, float], None] | None = None) -> Worth:
    """How many measured sets of touches a recogniser knows that was trained on simulated ones of the nominal model, of each step
    to the better one, and of measured ones.

    Args:
      measurements: a measurement file with poses, of two objects or more, at one speed.
      model, better: a name, a hash, a path to a model file, its text, or a Model. The steps between add one effect after the
        other in the order of the better model's file.
      train: Python file of the recogniser (touchstone.training.worth.recogniser says what it must have); None: XGBoost.
      fitted: the set that the better model was fitted to: none of its poses is tested. None: not known, which the answer says.
      meshes, mesh_dirs: "NAME=FILE" and folders of what a server that is started for this serves beside the built-in objects.
      client: a source that serves the objects; None: one is started.
      samples: simulated touches of each object in training.
      touches: of a set, which is what the recogniser sees at once.
      poses: of simulated touches: "faces", "sphere", or "set": those of the measured touches that are not tested.
      seeds, seed: how often all is simulated and trained anew, and the first.
      on_progress: is told what is under way and the share that is done.

    Raises:
      touchstone.InvalidRequest: of a set that does not do, or of the recogniser's file, with its line.
    """
    asked = _checked(Asked(samples, touches, seeds, seed, poses))
    recogniser = Recogniser(train)
    own = None
    if client is None:
        own = OwnServer([*(f"--mesh={mesh}" for mesh in meshes), *(f"--mesh-dir={folder}" for folder in mesh_dirs)])
        client = touchstone.connect(own.target)
    elif meshes or mesh_dirs:
        raise touchstone.InvalidRequest("meshes and mesh_dirs are for a server that is started; give them to the one that runs.")
    try:
        with tempfile.TemporaryDirectory(prefix="touchstone-worth-") as folder:
            settings = Settings(pathlib.Path(folder), seeds=seeds, seed=seed)
            with Context(settings, client) as context:
                context.begin("worth")
                return _Experiment(context, recogniser, asked, on_progress).run(measurements, model, better, fitted)
    finally:
        if own is not None:
            client.close()
            own.stop()


def _checked(asked: Asked) -> Asked:
    for name, least in (("samples", 4 * asked.touches), ("touches", 1), ("seeds", 2)):
        if getattr(asked, name) < least:
            raise touchstone.InvalidRequest(f"{name} is {getattr(asked, name)}; at least {least} are needed.")
    if asked.poses not in POSES:
        raise touchstone.InvalidRequest(f"poses is {asked.poses!r}; one of {', '.join(POSES)} was expected.")
    return asked


class _Experiment:
    """One run; attributes are set as it goes."""

    def __init__(self, context: Context, recogniser: Recogniser, asked: Asked, on_progress: Callable[[str, float], None] | None):
        self.context, self.recogniser, self.asked = context, recogniser, asked
        self._tell = on_progress or (lambda what, share: None)

    def run(self, measurements: str | os.PathLike[str], model: ModelLike, better: ModelLike, fitted: str | os.PathLike[str] | None) -> Worth:
        client, asked, name = self.context.simulator, self.asked, os.fspath(measurements)
        nominal, last = client.model(model), client.model(better)
        self.set = measured.read(measurements, fitted, nominal.spacing_mm, nominal.fingers, self.context.settings.out)
        data = self.set.data
        self._check_objects(name, data)
        self.groups = measured.groups(name, data, asked.touches, self.context.rng("groups"))
        self.sets = self._sets(data, self.groups.rows)
        self.draws = Resampling(self.groups.objects, asked.seeds, self.context.rng("bootstrap"))
        self._tell("errors", 0.02)
        rungs, changes, kind = self._rungs(nominal.yaml, last.yaml)
        cells = self._simulated(rungs)
        own_cells, own_touches = self._measured()
        ends = {"nominal": 0, "better": len(rungs) - 1} if len(rungs) > 1 else {"nominal": 0}
        about = {
            "set": name, "kind": kind, "nominal": nominal.name, "better": last.name, "recogniser": self.recogniser.name,
            "touches": len(data), "objects": list(data.objects), "touches_per_set": asked.touches, "sets": len(self.groups.rows),
            "groups": len(self.groups.objects), "simulated_per_object": asked.samples, "poses": asked.poses, "seeds": asked.seeds,
            "seed": asked.seed, "incomplete": self.set.incomplete, "fitted": self.set.fitted}
        full = [each[-1][1] for each in cells]
        return Worth(
            tuple(self._step(k, rungs, changes, full) for k in range(len(rungs))), self.draws.estimate(own_cells), own_touches,
            {name: exchange(own_cells, own_touches, cells[k], self.draws) for name, k in ends.items()},
            {name: [(size, self.draws.estimate(each)) for size, each in cells[k]] for name, k in ends.items()},
            about, result.cautions(about, len(rungs)))

    def _check_objects(self, name: str, data: TouchData) -> None:
        if len(data.objects) < 2:
            raise touchstone.InvalidRequest(f"{name} has touches of one object, {data.objects[0]}; a recogniser tells two or more apart.")
        known = {each.name for each in self.context.simulator.objects()}
        unknown = [each for each in data.objects if each not in known]
        if unknown:
            raise touchstone.InvalidRequest(f"{name} has touches of {', '.join(unknown)}, which the source does not have; name the mesh "
                                            f"(--mesh {unknown[0]}=FILE) or a folder of meshes (--mesh-dir).")

    def _rungs(self, nominal: str, better: str) -> tuple[list[Rung], list[Estimate | None], str]:
        """The models, the change of the RMSE from each to the next, and what the touches are called."""
        client = self.context.simulator
        of_pictures = {each.name for each in client.effects() if each.stage in _STAGES_OF_PICTURES}
        found = ladder.between(*(ladder.without(model, of_pictures) for model in (nominal, better)))
        report = client.compare(self.set.path, found[0][1])
        touches = report.of("touches")
        rungs = [Rung(*found[0], report.rmse_us)]
        changes: list[Estimate | None] = [None]
        for k in range(1, len(found)):
            report = client.compare(self.set.path, found[k - 1][1], other_model=found[k][1])
            versus = report.versus
            assert versus is not None
            rungs.append(Rung(*found[k], versus.other.rmse))
            changes.append(result.change_of_rmse(versus.rmse_difference, versus.interval))
        return rungs, changes, "emulated" if touches is not None and touches.emulated else "measured"

    def _step(self, k: int, rungs: Sequence[Rung], changes: Sequence[Estimate | None], cells: Sequence[np.ndarray]) -> Step:
        accuracy = self.draws.estimate(cells[k])
        if k == 0:
            return Step(rungs[0], accuracy)
        return Step(rungs[k], accuracy, self.draws.difference(cells[k], cells[0]), self.draws.difference(cells[k], cells[k - 1]), changes[k])

    def _sets(self, data: TouchData, rows: np.ndarray) -> FeatureSets:
        return of_rows(data, rows, self.recogniser.features)

    def _simulated(self, rungs: Sequence[Rung]) -> list[list[tuple[int, np.ndarray]]]:
        """[(touches, (seeds, groups) shares right)] of every rung: of the first and the last from few touches to all, of the
        others of all."""
        found: list[list[tuple[int, np.ndarray]]] = []
        for k, rung in enumerate(rungs):
            sizes = self._sizes() if k in (0, len(rungs) - 1) else self._sizes()[-1:]
            cells = np.empty((len(sizes), self.asked.seeds, len(self.groups.objects)))
            for number, seed in enumerate(self.context.settings.runs):
                self._tell(f"training on {rung.name}", 0.05 + 0.85 * (k + number / self.asked.seeds) / len(rungs))
                for testing, train in self._trained_on(rung, seed):
                    for place, sets in enumerate(sizes):
                        right = self._right(_part(train, sets), seed, testing)
                        cells[place, number, testing] = self.groups.shares(right)[testing]
            found.append([(sets * self.asked.touches * self._objects, each) for sets, each in zip(sizes, cells)])
        return found

    @property
    def _objects(self) -> int:
        return len(self.set.data.objects)

    def _sizes(self) -> list[int]:
        """Sets of each object: all, a half, a quarter ..., two at least, from few to many."""
        sizes = [self.asked.samples // self.asked.touches]
        while sizes[0] >= 4 and len(sizes) < 6:
            sizes.insert(0, sizes[0] // 2)
        return sizes

    def _trained_on(self, rung: Rung, seed: int) -> Iterator[tuple[np.ndarray, FeatureSets]]:
        """((groups,) which are tested, simulated sets to train on): once, or for every fold."""
        asked, data = self.asked, self.set.data
        sets, hand = asked.samples // asked.touches, {"speed_mm_s": data.speed_mm_s, "spacing_mm": data.spacing_mm}
        if asked.poses != "set":
            plan = None if asked.poses == "faces" else touchstone.sphere()
            train = ladder.simulated_sets(self.context, rung.model, seed, sets, asked.touches, objects=data.objects,
                                          features=self.recogniser.features, plan=plan, **hand)
            yield np.ones(len(self.groups.objects), bool), train
            return
        fold = self._folds(seed)
        for number in range(fold.max() + 1):
            testing = fold == number
            rows = np.unique(self.groups.rows[~testing[self.groups.group]])
            yield testing, self._simulated_again(rows, rung, seed, sets)

    def _simulated_again(self, rows: np.ndarray, rung: Rung, seed: int, sets: int) -> FeatureSets:
        """Sets of the commanded touches of these rows, as often as it takes."""
        data, rng = self.set.data, np.random.default_rng(seed)
        picked = np.concatenate([rng.permutation(np.resize(mine, sets * self.asked.touches))
                                 for mine in (rows[data.object[rows] == k] for k in range(self._objects))])
        again = data[picked]
        times = ladder.simulate_again(self.context, again, rung.model, seed, standoff_mm=self.set.standoff_mm)
        again = dataclasses.replace(again, times_us=np.nan_to_num(times))
        return self._sets(again, dealt_rows(again, self.asked.touches, rng))

    def _folds(self, seed: int) -> np.ndarray:
        smallest = int(np.bincount(self.groups.objects).min())
        return self.groups.folds(min(FOLDS, smallest), np.random.default_rng([seed, 1]))

    def _measured(self) -> tuple[np.ndarray, int]:
        """(seeds, groups) shares right of recognisers trained on measured touches of other poses, and how many touches."""
        cells = np.empty((self.asked.seeds, len(self.groups.objects)))
        trained = []
        for number, seed in enumerate(self.context.settings.runs):
            self._tell("training on measured touches", 0.9 + 0.1 * number / self.asked.seeds)
            fold = self._folds(seed)
            for each in range(fold.max() + 1):
                testing = fold == each
                train = self.sets[~testing[self.groups.group]]
                cells[number, testing] = self.groups.shares(self._right(train, seed, testing))[testing]
                trained.append(len(train) * self.asked.touches)
        return cells, round(float(np.mean(trained)))

    def _right(self, train: FeatureSets, seed: int, testing: np.ndarray) -> np.ndarray:
        """(sets,) 1 where a recogniser trained on these knows the measured set; 0 also where its group is not `testing`."""
        asked = testing[self.groups.group]
        right = np.zeros(len(self.sets))
        sets = self.sets[asked]
        right[asked] = Trained(self.recogniser.new(seed, self._objects), train).predict(sets) == sets.objects
        return right


def _part(sets: FeatureSets, per_object: int) -> FeatureSets:
    """The first sets of each object."""
    return sets[np.concatenate([np.flatnonzero(sets.objects == k)[:per_object] for k in np.unique(sets.objects)])]
