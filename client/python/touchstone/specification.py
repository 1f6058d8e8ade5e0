"""A dataset's specification from a user's arguments."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

from . import arguments, checks, units
from .errors import InvalidRequest
from .images import ImageLike, image as default_image, to_image
from .models import ModelLike, model_ref
from .plans import FacesPlan, PlanLike, SpherePlan, Touches, plan_message, sphere
from .posterior import PosteriorLike, posterior
from .v1 import source_pb2

# Default samples per batch: enough to make a message's overhead small, and a few MB with images.
DEFAULT_BATCH_SIZE = 4096
DEFAULT_BATCH_SIZE_WITH_IMAGES = 64


_DEPTH = ("depth_mm", "depth_m")
# What is asked for by one name and comes as several columns, or as one whose name has its unit.
_GROUPS = {
    "descriptor": ("descriptor",),
    "contact_time": ("contact_time",),
    "pose": ("target", "approach", "lateral", "standoff", "speed"),
    "contact": ("contact_point", "normal"),
    "std_uncertainty": ("std_uncertainty", "beyond_measured"),
}
_UNITS = ("_us", "_s", "_mm", "_m", "_mm_s", "_m_s")


def requested_columns(names: Sequence[str]) -> list[str]:
    """The names of a request for those of columns as they come back: "descriptor" for "descriptor_us", and so on."""
    known = dict.fromkeys((*_DEPTH, "mask"), "image")
    known.update((column + unit, group) for group, columns in _GROUPS.items() for column in columns
                 for unit in ("", *_UNITS))
    # The names in their order, each once. What is not known is the source's to judge: it may have more columns.
    return list(dict.fromkeys(known.get(name, name) for name in names))


def specification(objects: str | Sequence[str], plan: PlanLike | None = None, *, samples: int | None = None,
                  seed: int = 0, model: ModelLike = None, speed_mm_s: float | None = None,
                  touch_interval_s: float = 0.0, columns: str | Sequence[str] | None = None,
                  image: ImageLike | None = None, max_draws: int = 0, uncertainty: PosteriorLike = None,
                  models_from: PosteriorLike = None) -> source_pb2.DatasetSpec:
    """The message; arguments as in Client.dataset(). samples is resolved, so that the size is known here."""
    objects = [objects] if isinstance(objects, str) else list(objects)
    if not objects or not checks.is_sequence_of_text(objects):
        raise InvalidRequest(f"objects is {objects!r}; give at least one object's name.")
    plan = sphere() if plan is None else plan
    if isinstance(plan, SpherePlan) and (image is not None or "image" in (columns or ())):
        plan = plan.for_pictures()
    message = plan_message(plan)
    # The size: a plan with an end has one of its own.
    if samples is None:
        if isinstance(plan, SpherePlan):
            raise InvalidRequest(
                "samples is missing: a sphere plan has no end of its own; say for instance samples=10_000."
            )
        samples = plan.samples(len(objects))
    _warn_of_faces_without_touches(plan, samples, len(objects))
    # The speed: explicit touches carry their own.
    if isinstance(plan, Touches):
        if speed_mm_s is not None:
            raise InvalidRequest("speed_mm_s is given, but explicit touches carry their own; set it there.")
    else:
        message.speed_m_s = units.si_value(
            "speed_m_s", checks.positive("speed_mm_s", 20.0 if speed_mm_s is None else speed_mm_s)
        )
    message.touch_interval_s = checks.number("touch_interval_s", touch_interval_s)
    # The columns: an image's options without the image are a mistake.
    options = default_image() if image is None else to_image(image)
    asked = [] if columns is None else [columns] if isinstance(columns, str) else list(columns)
    options = dataclasses.replace(
        options, depth=options.depth or any(name in _DEPTH for name in asked), mask=options.mask or "mask" in asked
    )
    names = requested_columns(asked or ["descriptor", "object", *(["image"] if image is not None else [])])
    if image is not None and "image" not in names:
        raise InvalidRequest(f'image is given, but columns is {asked}; add "image" to it.')
    spec = source_pb2.DatasetSpec(
        objects=objects,
        plan=message,
        model=model_ref(model),
        seed=checks.uint64("seed", seed),
        samples=checks.whole_number("samples", samples, 1, 2**63 - 1),
        columns=names,
        max_draws=checks.whole_number("max_draws", max_draws, 0, 2**32 - 1),
    )
    if "image" in names:
        spec.image.CopyFrom(options.to_proto())
    _add_posterior(spec, uncertainty, models_from)
    return spec


def _add_posterior(spec: source_pb2.DatasetSpec, uncertainty: PosteriorLike, models_from: PosteriorLike) -> None:
    given = [posterior(report) for report in (models_from, uncertainty) if report is not None]
    if not given:
        return
    if len(given) == 2 and given[0] != given[1]:
        raise InvalidRequest("uncertainty and models_from are two reports; a dataset has the posterior of one.")
    spec.posterior.CopyFrom(given[0])
    spec.draw_models = models_from is not None
    if uncertainty is not None and "std_uncertainty" not in spec.columns:
        spec.columns.append("std_uncertainty")


def _warn_of_faces_without_touches(plan: PlanLike, samples: int, objects: int) -> None:
    """A plan of faces goes face by face: of a part of it that is cut short some faces are never touched, in silence."""
    if not isinstance(plan, FacesPlan):
        return
    touches = -(-samples // objects)
    reached = -(-touches // plan.samples_per_face)
    if reached < 6 and -(-touches // 6) < plan.samples_per_face:
        arguments.warn(f"samples={samples} of {objects} objects are {touches} touches of each, which reach {reached} of the 6 faces: "
                      f"faces(samples_per_face={plan.samples_per_face}) makes all touches of one face before the next. With "
                      f"samples_per_face={-(-touches // 6)} they reach all.")


def resolve_batch_size(spec: source_pb2.DatasetSpec, batch_size: int | None) -> int:
    if batch_size is None:
        return DEFAULT_BATCH_SIZE_WITH_IMAGES if "image" in spec.columns else DEFAULT_BATCH_SIZE
    return checks.whole_number("batch_size", batch_size, 1, 2**32 - 1)
