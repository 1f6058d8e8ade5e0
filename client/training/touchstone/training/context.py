"""What an experiment is given: sources, touches and photographs of them, random numbers, progress."""

from __future__ import annotations

import hashlib
import json
import pathlib
import sys
import time
from collections.abc import Mapping, Sequence
from typing import Any, Callable

import numpy as np

import touchstone
from touchstone.whole_file import whole_file

from . import plans
from .emulated_rig import EmulatedRig
from .separation import pose_seed
from .settings import SUPERSHAPES, Settings
from .touch_data import TouchData, collect


class Context:
    """The sources are started when they are first asked for and end with the `with` block."""

    def __init__(self, settings: Settings, simulator: touchstone.Client | None = None):
        """`simulator`: the virtual source, which its owner closes; None: that of the settings."""
        self.settings = settings
        self._simulator, self._owns_simulator = simulator, simulator is None
        self._rigs: dict[str, EmulatedRig] = {}
        self._name, self._begin = "", time.monotonic()

    def __enter__(self) -> Context:
        return self

    def __exit__(self, *_: Any) -> None:
        if self._simulator is not None and self._owns_simulator:
            self._simulator.close()
        for rig in self._rigs.values():
            rig.stop()

    @property
    def simulator(self) -> touchstone.Client:
        """The virtual source."""
        if self._simulator is None:
            self._simulator = touchstone.connect(self.settings.server or None)
        return self._simulator

    def rig(self, *options: str) -> touchstone.Client:
        """The gateway that was named; without one, an emulated rig with these options of touchstone-rig-emulator."""
        key = json.dumps(options)
        if key not in self._rigs:
            for other in self._rigs.values():  # two would share two processors with the training
                other.stop()
            self._rigs = {key: EmulatedRig(self.settings.rig, options)}
        return self._rigs[key].client

    def stop_rigs(self) -> None:
        """Ends emulated rigs, which take a good part of a core even while nothing moves; rig() starts one again."""
        for rig in self._rigs.values():
            rig.stop()
        self._rigs = {}

    def simulated(self, samples: int, *, plan: Any = None, objects: Sequence[str] = SUPERSHAPES, model: str | None = None,
                  seed: int = 1, use: str = "training", image: Any = None, **hand: float) -> TouchData:
        """`samples` touches of all objects together, in turn, by the simulator; `plan` None: of plans.simulated(). Touches of
        another `use`, as "testing", are of other poses, whatever their seed. `hand`: speed_mm_s and spacing_mm of collect()."""
        plan = plans.simulated(samples, len(objects)) if plan is None else plan
        return collect(self.simulator, objects, plan, samples, model=model, seed=pose_seed(use, seed), image=image,
                       **hand)

    def measured(self, plan: Any, *, objects: Sequence[str] = SUPERSHAPES, options: Sequence[str] = (), seed: int = 1,
                 image: Any = None) -> TouchData:
        """Every touch of the plan by the rig behind the gateway. Kept in the folder of the run: an arm takes its time."""
        what = json.dumps([list(objects), repr(plan), list(options), pose_seed("rig", seed), repr(image), self.settings.rig])
        path = self.settings.out / "measured" / f"{hashlib.sha256(what.encode()).hexdigest()[:16]}.npz"
        if path.exists():
            return TouchData.load(path)
        self.progress(0, f"touching {plan.samples(len(objects)):,} times with the rig")
        found = collect(self.rig(*options), objects, plan, plan.samples(len(objects)), seed=pose_seed("rig", seed), image=image)
        path.parent.mkdir(parents=True, exist_ok=True)
        found.save(path)
        return found

    def kept(self, what: Any, make: Callable[[], Mapping[str, np.ndarray]]) -> dict[str, np.ndarray]:
        """Arrays by name that the rig gave, made once and kept in the folder of the run. `what`: all that they depend on but
        for the gateway, as plain types."""
        text = json.dumps([what, self.settings.rig])
        path = self.settings.out / "measured" / f"{hashlib.sha256(text.encode()).hexdigest()[:16]}.npz"
        if not path.exists():
            made = make()
            path.parent.mkdir(parents=True, exist_ok=True)
            with whole_file(path, "wb") as file:
                np.savez_compressed(file, **made)
        with np.load(path) as found:
            return dict(found)

    def rng(self, *words: Any) -> np.random.Generator:
        """Random numbers of their own for whatever the words name; the same in every run."""
        text = json.dumps([self.settings.seed, self._name, *map(str, words)])
        return np.random.default_rng(int.from_bytes(hashlib.sha256(text.encode()).digest()[:8], "little"))

    def figure_path(self, name: str) -> pathlib.Path:
        """Of an SVG of this experiment, for figures.save()."""
        return self.settings.out / "figures" / f"{self._name}-{name}.svg"

    def begin(self, name: str) -> None:
        """From now on `name` is the experiment that is under way."""
        self._name, self._begin = name, time.monotonic()

    def progress(self, share: float, words: str = "") -> None:
        """Says on stderr how far this experiment is (0 to 1), and how long the rest will take once that can be told."""
        passed = time.monotonic() - self._begin
        left = f", {passed * (1 - share) / share:.0f} s left" if share > 0.05 else ""
        print(f"  {self._name}: {share:4.0%} after {passed:.0f} s{left}  {words}", file=sys.stderr, flush=True)
