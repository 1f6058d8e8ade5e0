"""What a report leaves open about its model, as requests carry it."""

from __future__ import annotations

import json
import os
from collections.abc import Sequence
from typing import TYPE_CHECKING, Optional, Union

from google.protobuf import json_format

from . import arguments
from .errors import InvalidRequest
from .v1 import diagnosis_pb2, types_pb2

if TYPE_CHECKING:
    from .report import Report

# A Report of diagnose(), or the path of one that was saved.
PosteriorLike = Optional[Union["Report", str, "os.PathLike[str]"]]


def posterior(report: Report | str | os.PathLike[str]) -> types_pb2.ModelPosterior:
    """The part of a report that says how sure its model is; InvalidRequest where it has none."""
    if isinstance(report, (str, os.PathLike)):
        found, misfit_us, name = *_of_file(report), str(report)
    else:
        message = report.message
        found, name = (message.posterior if message.HasField("posterior") else None), repr(report)
        misfit_us = _misfit(message.uncertainty)
    if found is None:
        raise InvalidRequest(f"{name} says nothing of how sure its model is: a report of diagnose() on touches with poses was "
                             "expected, whose verdict is not check_data or too_little_data.")
    if misfit_us > 0:
        arguments.warn(f"The model of {name} leaves a misfit of {misfit_us / 1000:.3g} ms on the set that it was fitted to, which "
                      "these uncertainties do not hold.")
    return found


def _misfit(budgets: Sequence[diagnosis_pb2.UncertaintyBudget]) -> float:
    """In the budget of all objects, us; 0: none was found."""
    contributions = budgets[-1].contributions if budgets else ()
    return next((one.std_uncertainty for one in contributions if one.name == "misfit"), 0.0)


def _of_file(path: str | os.PathLike[str]) -> tuple[types_pb2.ModelPosterior | None, float]:
    try:
        with open(path, encoding="utf-8") as file:
            report = json.load(file)
        if not isinstance(report, dict) or "posterior" not in report:
            return None, 0.0
        budgets = json_format.ParseDict({"uncertainty": report.get("uncertainty", [])}, diagnosis_pb2.Report(), ignore_unknown_fields=True)
        return (json_format.ParseDict(report["posterior"], types_pb2.ModelPosterior(), ignore_unknown_fields=True),
                _misfit(budgets.uncertainty))
    except OSError as error:
        raise InvalidRequest(f"{path}: {error.strerror}; a report was expected, as client.diagnose(...).save(FILE) writes it.") from None
    except (ValueError, json_format.ParseError) as error:
        raise InvalidRequest(f"{path}: is no report, as client.diagnose(...).save(FILE) writes it: {error}") from None
