"""The models that a diagnosis of measured touches climbs through, and the rig that these touches come from.

What the rig hides is told to the emulator alone. Every model here is what client.diagnose() made of measured touches.
"""

from __future__ import annotations

import dataclasses
import hashlib
import json
import pathlib
import re
from collections.abc import Collection, Sequence
from typing import Any

import numpy as np

import touchstone
from touchstone.whole_file import whole_file

from ..context import Context
from ..features import Features, FeatureSets, curvatures, dealt_sets
from ..separation import check
from ..settings import SUPERSHAPES
from ..touch_data import TouchData

# An emulated optical sensor's noise, so that what the model lacks is seen beside it (the seed's 48 ms would hide it).
SIGMA_US = 5000.0


@dataclasses.dataclass(frozen=True)
class HiddenRig:
    """Attributes:
      name: of it in reports.
      hidden: its physics, as options of touchstone-rig-emulator; each has one cause that is in no catalogue of effects.
    """

    name: str
    hidden: tuple[str, ...]

    @property
    def options(self) -> tuple[str, ...]:
        return ("--sigma-us", f"{SIGMA_US:.0f}", *self.hidden)


# Chosen before any of them was tried, and not changed afterwards.
RIGS = (
    # Fingers of unequal length, an object that gives way, round tips, and a lead screw that is not true.
    HiddenRig("first rig", ("--hide", "finger_length.offset_mm=-0.3,0.4,-0.1", "--hide", "object_push.shift_mm=0.8", "--hide",
                            "tip_radius.radius_mm=2", "--unlisted", "lead_screw=0.5,5")),
    # Larger tips, fingers that slide on oblique surfaces, and a middle finger on a joint that yields to gravity.
    HiddenRig("second rig", ("--hide", "tip_radius.radius_mm=3", "--hide", "oblique_slip.travel_mm=0.5", "--unlisted", "soft_middle=0.4")),
    # A tilted tool, fingers of unequal length, an object that gives way a little, and one that tips.
    HiddenRig("third rig", ("--hide", "tool_tilt.angle_deg=1", "--hide", "finger_length.offset_mm=0.2,-0.3,0.1", "--hide",
                            "object_push.shift_mm=0.3", "--unlisted", "tipping=0.3")),
)
NOMINAL = ("touchstone: model/1\nname: nominal\nend_effector: {fingers: 3, spacing_mm: 30}\neffects:\n"
           f"  - gaussian_noise: {{sigma_us: {SIGMA_US:.0f}}}\n")
STANDOFF_MM = 60.0  # of every plan of faces here
# The objects whose touches are diagnosed; the models are tried on all five.
DIAGNOSED = ("lat00", "lat20")


@dataclasses.dataclass
class Rung:
    """A model of the ladder.

    Attributes:
      name: "nominal", "+ finger_length", ...
      model: the model file.
      rmse_us: of held-out measured touches, by client.compare().
    """

    name: str
    model: str
    rmse_us: float


def measured(context: Context, rig: HiddenRig = RIGS[0]) -> tuple[TouchData, TouchData]:
    """Touches that are diagnosed, of two objects, and others in other poses, of all objects: no model has seen these."""
    per_face, rounds = context.settings.pick((12, 1), (24, 2))
    plan = touchstone.faces(samples_per_face=per_face, rounds=rounds)
    test = touchstone.faces(samples_per_face=context.settings.pick(4, 40), rounds=1)
    diagnosed = context.measured(plan, objects=DIAGNOSED, options=rig.options, seed=11)
    held_out = context.measured(test, options=rig.options, seed=12)
    check(diagnosed.poses(), held_out.poses())
    return diagnosed, held_out


def climb(context: Context, rig: HiddenRig = RIGS[0]) -> list[Rung]:
    """The ladder from the nominal model to that which `diagnose --save-model` saves.

    The effects have the values of the report's improved model, in which they were fitted together. Kept beside the
    measured touches, since three experiments ask for it.
    """
    diagnosed, held_out = measured(context, rig)
    folder = context.settings.out / "measured"
    digest = hashlib.sha256(diagnosed.times_us.tobytes() + held_out.times_us.tobytes() + NOMINAL.encode()).hexdigest()[:16]
    path = folder / f"ladder-{digest}.json"
    if path.exists():
        return [Rung(**rung) for rung in json.loads(path.read_text())]
    write_set(diagnosed, folder / "diagnosed.csv")
    write_set(held_out, folder / "held_out.csv")
    report = context.simulator.diagnose(folder / "diagnosed.csv", NOMINAL, seed=1)
    rungs = [Rung(name, model, context.simulator.compare(folder / "held_out.csv", model).rmse_us)
             for name, model in models(report)]
    with whole_file(path) as file:
        json.dump([dataclasses.asdict(rung) for rung in rungs], file, indent=1)
    return rungs


def models(report: touchstone.Report) -> list[tuple[str, str]]:
    """(name, model file) of each rung of a report of NOMINAL, terms in the order of the saved file: the last rung but a
    suggestion is that file itself, what `diagnose --save-model` writes; a suggestion what it writes --with-formula."""
    found = [("nominal", NOMINAL)]
    if report.improved_model:
        found = between(NOMINAL, report.improved_model, [step.effect for step in report.steps])
    if report.suggested_model:
        found.append(("+ suggestion", report.suggested_model))
    return found


def between(nominal: str, better: str, added: Sequence[str] | None = None) -> list[tuple[str, str]]:
    """(name, model file) of each rung from one model to another; both as a source writes them (touchstone.Model.yaml).

    One effect after the other is added in the order of `added`, by default that of the better model's file; terms stand in the
    order of that file, and the last rung is the file itself. What both models have, with other values, is part of every rung
    but the first; where nothing else differs it is the only one. A single rung: the models have the same effects.
    """
    found = [("nominal", nominal)]
    head, blocks = _blocks(better)
    before = _blocks(nominal)[1]
    named = list(dict.fromkeys(map(_title, blocks))) if added is None else list(added)
    if added is None:
        named = [name for name in named if name not in set(map(_title, before))]
    for count, name in enumerate(named, 1):
        # Refitted values of effects that the nominal model has already are part of every rung but the first.
        later = set(named[count:]) - set(named[:count])
        model = _joined(head, [block for block in blocks if _title(block) not in later])
        if _effects(model) != _effects(found[-1][1]):
            found.append((f"+ {name}", model))
    if _effects(found[-1][1]) != _effects(better):
        found.append(("+ refitted values", better))
    return found


def _blocks(model: str) -> tuple[str, list[str]]:
    """A model file up to its effects, and each effect with the lines that belong to it."""
    head, _, rest = model.partition("\neffects:")
    effects, said, _ = rest.partition("\nprovenance:")  # what the model was fitted to is no effect
    if said:
        effects += "\n"
    blocks: list[str] = []
    for line in effects.splitlines(keepends=True):
        if line.startswith("  - "):
            blocks.append(line)
        elif blocks and line.strip():
            blocks[-1] += line
    return head + "\n", blocks


def _joined(head: str, blocks: Sequence[str]) -> str:
    return head + ("effects:\n" + "".join(blocks) if blocks else "effects: []\n")


def _effects(model: str) -> tuple[str, list[str]]:
    """What makes two models differ: the end effector, and the effects; not the name."""
    head, blocks = _blocks(model)
    return re.sub("^name:.*$", "", head, flags=re.MULTILINE), blocks


def _title(block: str) -> str:
    """The name of an effect; of a formula or a lookup the name that it was given."""
    effect = block.strip().removeprefix("- ").partition(":")[0]
    given = re.search(r"^      name: (.*)$", block, re.MULTILINE) if effect in ("formula", "lookup") else None
    return given[1].strip('"') if given else effect


def without(model: str, effects: Collection[str]) -> str:
    """The model without these effects."""
    head, blocks = _blocks(model)
    return _joined(head, [block for block in blocks if _title(block) not in effects])


def with_noise(model: str, sigma_us: float) -> str:
    """The model with this standard deviation of each finger's time, whatever it had; 0: none."""
    head, blocks = _blocks(without(model, ["gaussian_noise"]))
    noise = [f"  - gaussian_noise: {{sigma_us: {sigma_us:.0f}}}\n"] if sigma_us else []
    return _joined(head, noise + blocks)


def simulated_sets(context: Context, model: str, seed: int, sets: int, touches: int, *, objects: Sequence[str] = SUPERSHAPES,
                   features: Features = curvatures, **how: Any) -> FeatureSets:
    """`sets` sets of `touches` touches of each object, by a model; what recognisers of a rung are trained on. `how`: of
    Context.simulated()."""
    data = context.simulated(sets * touches * len(objects), objects=objects, model=model, seed=seed, **how)
    return dealt_sets(data, touches, np.random.default_rng(seed), features)


def commanded(data: TouchData, rows=slice(None), standoff_mm: float = STANDOFF_MM) -> touchstone.Touches:
    """The touches that were commanded, to be simulated again."""
    unit = lambda vectors: vectors / np.linalg.norm(vectors, axis=1, keepdims=True)
    approach = unit(data.approach[rows])
    # They came as float32: lateral is made perpendicular to approach again, as the source wants it.
    lateral = data.lateral[rows] - np.sum(data.lateral[rows] * approach, 1, keepdims=True) * approach
    return touchstone.touches(target_mm=data.target_mm[rows], approach=approach, lateral=unit(lateral), standoff_mm=standoff_mm,
                              speed_mm_s=data.speed_mm_s)


def write_set(data: TouchData, path: pathlib.Path) -> None:
    """A measurement file of them."""
    touches = commanded(data)
    path.parent.mkdir(parents=True, exist_ok=True)
    touchstone.write_measurements(path, [
        touchstone.Row(k, data.objects[data.object[k]], touches[k:k + 1], tuple(data.times_us[k])) for k in range(len(data))], force=True)


def simulate_again(context: Context, data: TouchData, model: str, seed: int, *, standoff_mm: float = STANDOFF_MM) -> np.ndarray:
    """(N, fingers) contact times in microseconds, less the first finger's, of the same commanded touches by a model; NaN
    where a finger meets nothing."""
    times = np.empty_like(data.times_us)
    for k, name in enumerate(data.objects):
        rows = np.flatnonzero(data.object == k)
        if len(rows):
            times[rows] = context.simulator.touch(name, commanded(data, rows, standoff_mm), model=model, seed=seed,
                                                  start=k * 1_000_000)["descriptor_us"]
    return times
