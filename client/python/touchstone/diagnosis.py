"""compare(), diagnose(), propose(), check(), explain() and uncertainty() of a Client."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Sequence
from typing import Any, Callable

import grpc

from . import arguments, checks, errors
from .connection import Connection
from .evidence import MeasurementsLike, MeshesLike, evidence, sessions
from .models import ModelLike, model_ref
from .posterior import posterior
from .report import Report
from .retry import Retry
from .v1 import diagnosis_pb2, diagnosis_pb2_grpc

# stage ("fitting tip_radius"), and how much of the whole is done, 0 to 1.
OnProgress = Callable[[str, float], None]


def _why_nothing(report: Report) -> str:
    """Why propose() has nothing to propose, and what is missing."""
    needed = max((data.needed for data in report.message.data), default=0)
    if report.verdict == "too_little_data":
        return (f"{report.summary} Make more touches first{f' ({needed} usable ones)' if needed else ''}: client.plan(touchstone.faces(), "
                "OBJECT) plans some, for a session or touch() to make.")
    if report.message.data_problems:
        return f"the set must be fixed first. {report.summary}"
    return "no explanations are left that further measurements would tell apart."


@arguments.checked
class Diagnosis:
    """The questions about measured touches and photographs: how wrong is a model, where, why, and what to add.

    measurements: a measurement file (.csv), a folder of photographs (images.csv, camera.yaml; with its touches.csv a
    joint diagnosis), or the name of a session that the server keeps. meshes: a folder with a file for each object, or
    {object: file or touchstone.Mesh}; none for objects that the server has.
    """

    def __init__(self, connection: Connection):
        self._connection = connection

    def compare(self, measurements: MeasurementsLike, model: ModelLike = None, *, meshes: MeshesLike = None,
                other_model: ModelLike = None, on_progress: OnProgress | None = None) -> Report:
        """How wrong the model is, and where; changes nothing. With another model, of touches: report.versus says which errs less.

        Of several measurement files, sessions of one rig: the error in each (report.data), and report.sessions.

        Args:
          measurements: a measurement file (.csv), a folder of photographs, the name of a session at the server, or a list of files.
          model: a name, a hash, a path to a model file, its text, or a Model; default: the server's.
          meshes: a folder with a file for each object, or {object: file or touchstone.Mesh}; none for objects that the server has.
          other_model: a second model, of touches.
          on_progress: is told the stage and the share that is done, 0 to 1.

        Raises:
          InvalidRequest: a file, a row or the model cannot be used; the message says where.
        """
        first, further = sessions(measurements, model, meshes, (), 0)
        request = diagnosis_pb2.CompareRequest(evidence=first, further=further)
        if other_model is not None:
            request.other_model.CopyFrom(model_ref(other_model))
        return self._report("Compare", request, on_progress)

    def diagnose(self, measurements: MeasurementsLike, model: ModelLike = None, *, meshes: MeshesLike = None,
                 also: Sequence[str | os.PathLike[str]] = (), seed: int = 0, with_surface_map: bool = False,
                 on_progress: OnProgress | None = None) -> Report:
        """Also why, what to add, and what the error becomes. The same arguments give the same report.

        Args:
          measurements: also several files, sessions of one rig in the order in which they were made: report.sessions says
            which values they share and which changed; the improved model is that of the last one.
          model: a name, a hash, a path to a model file, its text, or a Model; default: the server's.
          meshes: as of compare().
          also: model files whose effects compete with the catalogue.
          seed: of permutations and draws, 0 to 2^64 - 1.
          with_surface_map: put a map of the surfaces' departures into the improved model, where they are what is left.
          on_progress: is told the stage and the share that is done, 0 to 1.

        Raises:
          InvalidRequest: a file, a row or the model cannot be used; the message says where. Mistakes in the data that can be read
            are no error: report.verdict is "check_data".
        """
        first, further = sessions(measurements, model, meshes, also, seed)
        request = diagnosis_pb2.DiagnoseRequest(evidence=first, further=further, with_surface_map=with_surface_map)
        return self._report("Diagnose", request, on_progress)

    def propose(self, measurements: str | os.PathLike[str], model: ModelLike = None, *, meshes: MeshesLike = None,
                touches: int | None = None, photographs: int | None = None, seed: int = 0,
                on_progress: OnProgress | None = None) -> Report:
        """The touches (or photographs) to make next to tell the explanations that are left apart: report.next_touches.

        Args:
          measurements: a measurement file or a folder of photographs.
          model: as of compare().
          meshes: as of compare().
          touches: how many, from 1. Default: 24.
          photographs: how many, from 1, where there are photographs. Default: 12. Of a set of both kinds the one that is given is
            proposed, photographs if neither is.
          seed: of draws, 0 to 2^64 - 1.
          on_progress: is told the stage and the share that is done, 0 to 1.
        """
        request = diagnosis_pb2.ProposeRequest(evidence=evidence(measurements, model, meshes, (), seed))
        if touches is not None:
            request.touches = checks.whole_number("touches", touches, 1, 2**32 - 1)
        if photographs is not None:
            request.photographs = checks.whole_number("photographs", photographs, 1, 2**32 - 1)
        report = self._report("Propose", request, on_progress)
        if not report.message.next:
            arguments.warn(f"Nothing is proposed: {_why_nothing(report)}")
        return report

    def check(self, plan: str | os.PathLike[str], model: ModelLike = None, *, meshes: MeshesLike = None,
              noise_us: float | None = None, improve: int = 0, find: str = "", between: Sequence[str] = (), seed: int = 0,
              on_progress: OnProgress | None = None) -> Report:
        """What a plan of touches can find before any is made: report.detectable.

        Args:
          plan: a measurement file; its times, if it has any, are not read.
          model: as of compare(); what the rig is thought to be.
          meshes: as of compare().
          noise_us: standard deviation of one finger's time; default: that of the model's noise.
          improve: how many touches to propose (report.next_touches), for one of the next two questions.
          find: an effect that is to be found at smaller sizes.
          between: two effects that are to be told apart.
          seed: of draws, 0 to 2^64 - 1.
          on_progress: is told the stage and the share that is done, 0 to 1.
        """
        request = diagnosis_pb2.CheckRequest(
            evidence=evidence(plan, model, meshes, (), seed), improve=checks.whole_number("improve", improve, 0, 2**32 - 1),
            find=find, between=between,
        )
        if noise_us is not None:
            request.noise_us = checks.positive("noise_us", noise_us)
        return self._report("Check", request, on_progress)

    def explain(self, effect: str, measurements: str | os.PathLike[str], model: ModelLike = None, *,
                meshes: MeshesLike = None, on_progress: OnProgress | None = None) -> Report:
        """Why one effect is, or is not, what the model lacks: report.explained. Of touches with poses.

        Args:
          effect: its name in the catalogue, "tip_radius".
          measurements: a measurement file, or the name of a session at the server.
          model: as of compare().
          meshes: as of compare().
          on_progress: is told the stage and the share that is done, 0 to 1.
        """
        request = diagnosis_pb2.ExplainRequest(evidence=evidence(measurements, model, meshes, (), 0), effect=effect)
        return self._report("Explain", request, on_progress)

    def uncertainty(self, report: Report | str | os.PathLike[str], plan: str | os.PathLike[str], *, meshes: MeshesLike = None,
                    on_progress: OnProgress | None = None) -> Report:
        """How well the model of a diagnosis predicts the touches of a plan: .uncertainty of the report that it answers with.

        Args:
          report: of diagnose() on touches, or the file that it was saved as.
          plan: a measurement file; its times, if it has any, are not read.
        """
        request = diagnosis_pb2.UncertaintyRequest(evidence=evidence(plan, None, meshes, (), 0), posterior=posterior(report))
        return self._report("Uncertainty", request, on_progress)

    def _report(self, method: str, request: Any, on_progress: OnProgress | None) -> Report:
        """The last message of a stream; asked for again at the next source if one is lost."""
        retry = Retry(len(self._connection.targets), self._connection.retry_for_s)
        while True:
            call = getattr(diagnosis_pb2_grpc.DiagnosisStub(self._connection.channel()), method)(request)
            try:
                for response in call:
                    retry.succeeded()
                    if response.HasField("report"):
                        return Report(response.report)
                    if on_progress is not None and response.HasField("progress"):
                        on_progress(response.progress.stage, response.progress.done)
                raise errors.SourceFailed("The source ended without a report.", target=self._connection.target)
            except grpc.RpcError as error:
                failure = errors.from_rpc(error, self._connection.target, request)
                if not errors.is_lost(error):
                    raise failure from None
            finally:
                with contextlib.suppress(Exception):
                    call.cancel()
            self._connection.move_on()
            retry.lost(failure)
