"""Which touches to make: the plans of a dataset, and explicit touches as arrays."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any, Literal, Union

import numpy as np
from numpy.typing import NDArray

from . import arguments, checks, units
from .errors import InvalidRequest
from .printable import printable
from .v1 import source_pb2, types_pb2

RADIUS_RATIO = 1.05
RADIUS_RATIO_OF_PICTURES = 2.4


def plan_message(plan: PlanLike) -> source_pb2.Plan:
    """The plan as a message; an error says what was given instead of one."""
    if not hasattr(plan, "to_proto"):
        raise InvalidRequest(f"plan is {printable(repr(plan))}; give touchstone.sphere(...), faces(...) or touches(...).")
    return plan.to_proto()


@dataclasses.dataclass(frozen=True)
class SpherePlan:
    """What sphere() makes; its attributes are sphere()'s arguments."""

    step_angle_deg: float
    roll_step_deg: float
    radius_ratio: float | None
    max_incidence_deg: float

    def for_pictures(self) -> SpherePlan:
        """With a radius from which the whole object shows, where none is given."""
        return dataclasses.replace(self, radius_ratio=RADIUS_RATIO_OF_PICTURES) if self.radius_ratio is None else self

    def to_proto(self) -> source_pb2.Plan:
        return source_pb2.Plan(
            sphere=source_pb2.SpherePlan(
                step_angle_rad=units.si_value("step_angle_rad", checks.positive("step_angle_deg", self.step_angle_deg)),
                roll_step_rad=units.si_value("roll_step_rad", checks.number("roll_step_deg", self.roll_step_deg)),
                radius_ratio=checks.positive("radius_ratio", RADIUS_RATIO if self.radius_ratio is None else self.radius_ratio),
                max_incidence_rad=_incidence_rad(self.max_incidence_deg),
            )
        )

    def __post_init__(self) -> None:
        self.to_proto()  # a mistake is found where it is made

    def samples(self, objects: int) -> int:
        """Samples of all touches taken once; 0: there is no end."""
        return 0


@dataclasses.dataclass(frozen=True)
class FacesPlan:
    """What faces() makes; its attributes are faces()'s arguments."""

    samples_per_face: int
    rounds: int
    max_tilt_deg: float
    spread: float
    standoff_mm: float
    max_incidence_deg: float
    stroke_beyond_target_mm: float

    def to_proto(self) -> source_pb2.Plan:
        return source_pb2.Plan(
            faces=source_pb2.FacesPlan(
                samples_per_face=checks.whole_number("samples_per_face", self.samples_per_face, 1, 1_000_000),
                rounds=checks.whole_number("rounds", self.rounds, 1, 1_000_000),
                max_tilt_rad=units.si_value("max_tilt_rad", checks.number("max_tilt_deg", self.max_tilt_deg)),
                spread=checks.number("spread", self.spread),
                standoff_m=units.si_value("standoff_m", checks.positive("standoff_mm", self.standoff_mm)),
                max_incidence_rad=_incidence_rad(self.max_incidence_deg),
                stroke_beyond_target_m=units.si_value(
                    "stroke_beyond_target_m", checks.positive("stroke_beyond_target_mm", self.stroke_beyond_target_mm)
                ),
            )
        )

    def __post_init__(self) -> None:
        self.to_proto()  # a mistake is found where it is made

    def samples(self, objects: int) -> int:
        """Samples of all touches taken once, for so many objects."""
        return 6 * self.samples_per_face * self.rounds * objects


# Columns with one entry per touch: the shape of one entry. The first five are required.
_NEEDED = {"target_mm": (3,), "approach": (3,), "lateral": (3,), "standoff_mm": (), "speed_mm_s": ()}
_OPTIONAL = {"stroke_mm": (), "session_time_s": ()}


@dataclasses.dataclass(frozen=True, eq=False)
class Touches:
    """Explicit commanded touches, one row each, in the object frame. Make them with touches() or Client.plan().

    Finger i of n starts at target - approach * standoff + lateral * (i - (n-1)/2) * spacing and moves along
    approach.

    Attributes:
      target_mm: (N, 3) target point of the middle finger.
      approach: (N, 3) unit direction of motion.
      lateral: (N, 3) unit vector from the first finger to the last, perpendicular to approach.
      standoff_mm: (N,) distance from the middle finger's start to the target.
      speed_mm_s: (N,) commanded speed.
      stroke_mm: (N,) longest travel, or None: no limit.
      session_time_s: (N,) time since the session began, or None: 0.
      covariates: {"cov_NAME": (N,)} further measured conditions.
      draws: how many draws a generator took for them, those that were rejected included; 0: explicit touches.
    """

    target_mm: NDArray[np.float64]
    approach: NDArray[np.float64]
    lateral: NDArray[np.float64]
    standoff_mm: NDArray[np.float64]
    speed_mm_s: NDArray[np.float64]
    stroke_mm: NDArray[np.float64] | None = None
    session_time_s: NDArray[np.float64] | None = None
    covariates: Mapping[str, NDArray[np.float64]] = dataclasses.field(default_factory=dict)
    draws: int = 0

    def __len__(self) -> int:
        return len(self.target_mm)

    def __getitem__(self, rows: int | slice | NDArray[Any]) -> Touches:
        """Those rows; a single number gives one touch, still as an array of one row."""
        if isinstance(rows, (int, np.integer)):
            rows = slice(rows, rows + 1 or None)
        columns = {name: getattr(self, name) for name in (*_NEEDED, *_OPTIONAL)}
        picked = {name: values[rows] for name, values in columns.items() if values is not None}
        return Touches(**picked, covariates={name: values[rows] for name, values in self.covariates.items()})

    def samples(self, objects: int) -> int:
        """Samples of all touches taken once, for so many objects."""
        return len(self) * objects

    def to_proto(self) -> source_pb2.Plan:
        return source_pb2.Plan(list=source_pb2.ListPlan(touches=self.to_messages()))

    def to_messages(self) -> list[types_pb2.CommandedTouch]:
        """One touchstone.v1.CommandedTouch per row, SI."""
        target_m = self.target_mm / 1e3
        messages = []
        for k in range(len(self)):
            message = types_pb2.CommandedTouch(
                target_m=_vector(target_m[k]),
                approach=_vector(self.approach[k]),
                lateral=_vector(self.lateral[k]),
                standoff_m=units.si_value("standoff_m", self.standoff_mm[k]),
                speed_m_s=units.si_value("speed_m_s", self.speed_mm_s[k]),
            )
            if self.stroke_mm is not None:
                message.stroke_m = units.si_value("stroke_m", self.stroke_mm[k])
            if self.session_time_s is not None:
                message.session_time_s = self.session_time_s[k]
            for name, values in self.covariates.items():
                message.covariates[name] = values[k]
            messages.append(message)
        return messages

    @classmethod
    def from_messages(cls, messages: Sequence[types_pb2.CommandedTouch], draws: int = 0) -> Touches:
        """The touches of touchstone.v1.CommandedTouch messages. Strokes and session times are kept where every message has one."""

        def vectors(name: str) -> NDArray[np.float64]:
            return np.array([(v.x, v.y, v.z) for v in (getattr(message, name) for message in messages)], float).reshape(-1, 3)

        def numbers(name: str) -> NDArray[np.float64]:
            return np.array([getattr(message, name) for message in messages], float)

        def given(name: Literal["stroke_m", "session_time_s"]) -> bool:
            return bool(messages) and all(message.HasField(name) for message in messages)

        return cls(
            target_mm=units.lab_array("target_m", vectors("target_m")),
            approach=vectors("approach"),
            lateral=vectors("lateral"),
            standoff_mm=units.lab_array("standoff_m", numbers("standoff_m")),
            speed_mm_s=units.lab_array("speed_m_s", numbers("speed_m_s")),
            stroke_mm=units.lab_array("stroke_m", numbers("stroke_m")) if given("stroke_m") else None,
            session_time_s=numbers("session_time_s") if given("session_time_s") else None,
            draws=draws,
        )


PlanLike = Union[SpherePlan, FacesPlan, Touches]


@arguments.checked
def sphere(step_angle_deg: float = 1.0, roll_step_deg: float = 0.0, radius_ratio: float | None = None,
           max_incidence_deg: float = 90.0) -> SpherePlan:
    """Random approaches from a sphere round the object towards its centre; drawn again until every finger hits.

    Args:
      step_angle_deg: both angles of the start are multiples of it; above 0, at most 90.
      roll_step_deg: the hand turns about the approach by a random multiple of it; 0: no turn.
      radius_ratio: radius of the sphere over half the diagonal of the bounding box, at least 1. Default: 1.05; of a dataset
        with images 2.4, from where the whole object shows (the camera stands where the touch begins).
      max_incidence_deg: largest angle at which a finger meets the surface, 0 being square on; 90: any.
    """
    return SpherePlan(step_angle_deg, roll_step_deg, radius_ratio, max_incidence_deg)


@arguments.checked
def faces(samples_per_face: int = 8, rounds: int = 4, max_tilt_deg: float = 20.0, spread: float = 0.6,
          standoff_mm: float = 60.0, max_incidence_deg: float = 60.0,
          stroke_beyond_target_mm: float = 30.0) -> FacesPlan:
    """The same random poses from the six faces of the bounding box in every round, so that rounds are repeats.

    A line goes through a random point of the face; the target is where it first meets the object. A touch is drawn
    again within its number until every finger starts outside of the object and meets it within the stroke.

    Args:
      samples_per_face: poses per face; all of one face come before the next, in the order +x, -x, +y, -y, +z, -z.
      rounds: repeats of all poses.
      max_tilt_deg: largest angle between the approach and the inward face normal, 0 to 60.
      spread: lines go through this share of a face's half width and height, 0 to 1.
      standoff_mm: distance of the start from the target.
      max_incidence_deg: largest angle at which a finger meets the surface, 0 being square on; 90: any.
      stroke_beyond_target_mm: every finger has met the object when it stands so far behind the target.
    """
    return FacesPlan(samples_per_face, rounds, max_tilt_deg, spread, standoff_mm, max_incidence_deg,
                     stroke_beyond_target_mm)


@arguments.checked
def touches(rows: Sequence[Mapping[str, Any]] | None = None, **columns: Any) -> Touches:
    """Explicit touches, either rows (a sequence of mappings) or columns; a single value applies to all rows.

    touches([{"target_mm": (0, 0, 0), "approach": (0, 0, -1), "lateral": (1, 0, 0), "standoff_mm": 120}])
    touches(target_mm=targets, approach=(0, 0, -1), lateral=(1, 0, 0), standoff_mm=120, speed_mm_s=20)

    Names are the attributes of Touches, and "cov_NAME" for covariates; speed_mm_s is 20 unless given.

    Raises:
      InvalidRequest: a column is missing or unknown, has another shape or another number of rows, or is not finite.
    """
    if rows is not None:
        if columns:
            raise InvalidRequest("touches() takes rows or columns, not both.")
        rows = list(rows)
        if not rows:
            raise InvalidRequest("touches() got an empty list; give at least one touch.")
        names = list(rows[0])
        for k, row in enumerate(rows):
            if set(row) != set(names):
                raise InvalidRequest(f"Touch {k} has {sorted(row)}, but touch 0 has {sorted(names)}.")
        columns = {name: [row[name] for row in rows] for name in names}
    columns.setdefault("speed_mm_s", 20.0)
    known = {**_NEEDED, **_OPTIONAL}
    checks.known_keys("A touch", (name for name in columns if not name.startswith("cov_")), known)
    for name in _NEEDED:
        if name not in columns:
            raise InvalidRequest(f"A touch needs {name}.")
    arrays = {name: _array(name, values, known.get(name, ())) for name, values in columns.items()}
    count = max((len(values) for values in arrays.values()), default=0)
    for name, values in arrays.items():
        if len(values) not in (1, count):
            raise InvalidRequest(f"{name} has {len(values)} rows, but other columns have {count}.")
        arrays[name] = np.broadcast_to(values, (count, *values.shape[1:]))
    covariates = {name: arrays.pop(name) for name in list(arrays) if name.startswith("cov_")}
    return Touches(
        target_mm=arrays["target_mm"], approach=arrays["approach"], lateral=arrays["lateral"], standoff_mm=arrays["standoff_mm"],
        speed_mm_s=arrays["speed_mm_s"], stroke_mm=arrays.get("stroke_mm"), session_time_s=arrays.get("session_time_s"),
        covariates=covariates,
    )


def _array(name: str, values: Any, shape: tuple[int, ...]) -> NDArray[np.float64]:
    """As float64 (rows, *shape), a single entry as one row."""
    try:
        array = np.asarray(values, float)
    except (TypeError, ValueError):
        raise InvalidRequest(f"{name} is not an array of numbers.") from None
    if array.ndim == len(shape):
        array = array[None]
    if array.shape[1:] != shape:
        raise InvalidRequest(f"{name} has shape {array.shape}; it must be (touches{''.join(f', {n}' for n in shape)}).")
    if not np.isfinite(array).all():
        raise InvalidRequest(f"{name} is not finite in row {np.argwhere(~np.isfinite(array))[0][0]}.")
    return array


def _incidence_rad(max_incidence_deg: float) -> float:
    return units.si_value("max_incidence_rad", checks.positive("max_incidence_deg", max_incidence_deg))


def _vector(values: NDArray[np.float64]) -> types_pb2.Vector3:
    return types_pb2.Vector3(x=values[0], y=values[1], z=values[2])
