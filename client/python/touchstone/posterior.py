"""What a report leaves open about its model, as requests carry it."""

from __future__ import annotations

import json
import os
from typing import TYPE_CHECKING, Optional, Union

from google.protobuf import json_format

from .errors import InvalidRequest
from .v1 import types_pb2

if TYPE_CHECKING:
    from .report import Report

# A Report of diagnose(), or the path of one that was saved.
PosteriorLike = Optional[Union["Report", str, "os.PathLike[str]"]]


def posterior(report: Report | str | os.PathLike[str]) -> types_pb2.ModelPosterior:
    """The part of a report that says how sure its model is; InvalidRequest where it has none."""
    if isinstance(report, (str, os.PathLike)):
        found, name = _of_file(report), str(report)
    else:
        message = report.message
        found, name = (message.posterior if message.HasField("posterior") else None), repr(report)
    if found is None:
        raise InvalidRequest(f"{name} says nothing of how sure its model is: a report of diagnose() on touches with poses was "
                             "expected, whose verdict is not check_data or too_little_data.")
    return found


def _of_file(path: str | os.PathLike[str]) -> types_pb2.ModelPosterior | None:
    try:
        with open(path, encoding="utf-8") as file:
            report = json.load(file)
        if not isinstance(report, dict) or "posterior" not in report:
            return None
        return json_format.ParseDict(report["posterior"], types_pb2.ModelPosterior(), ignore_unknown_fields=True)
    except OSError as error:
        raise InvalidRequest(f"{path}: {error.strerror}.") from None
    except (ValueError, json_format.ParseError) as error:
        raise InvalidRequest(f"{path}: is no report as diagnose() saves it: {error}") from None
