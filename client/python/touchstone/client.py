"""connect() and the client that it returns."""

from __future__ import annotations

import contextlib
import dataclasses
import os
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from . import arguments, checks, units
from .batch import Batch
from .connection import Connection, Targets, chosen_targets
from .credentials import Credentials
from .dataset import Dataset
from .diagnosis import Diagnosis
from .errors import InvalidRequest, SourceFailed, TouchstoneError
from .images import ImageLike, Views, image as default_image, to_image, to_views
from .lease import Lease, holder as lease_holder
from .models import Description, Effect, Model, ModelLike, ObjectInfo, model_ref
from .own_server import OwnServer
from .plans import PlanLike, Touches, plan_message
from .posterior import PosteriorLike
from .printable import printable
from .retry import RETRY_FOR_S, Retry
from .rig import Rig
from .samples import Samples
from .session import Session, check_name
from .specification import specification
from .v1 import control_pb2, control_pb2_grpc, models_pb2, models_pb2_grpc, source_pb2, source_pb2_grpc

_CONTROL = control_pb2_grpc.ControlStub
_SOURCE = source_pb2_grpc.SourceStub
_MODELS = models_pb2_grpc.ModelsStub


@arguments.checked
def connect(targets: Targets | None = None, *, timeout_s: float = 3.0, retry_for_s: float = RETRY_FOR_S,
            ca: str | os.PathLike[str] | None = None, cert: str | os.PathLike[str] | None = None,
            key: str | os.PathLike[str] | None = None, token: str | None = None,
            token_file: str | os.PathLike[str] | None = None) -> Client:
    """A client of one source, or of several equal ones ("a:50051,b:50051" or a list) of which one is used at a time.

    Args:
      targets: "host:port", or several of them. Default: TOUCHSTONE_SERVER. Without either, and for "none", a touchstone-server is
        started for this process, which ends with client.close() or with the process.
      timeout_s: how long to wait for the first answer, of each target; SourceUnreachable after that.
      retry_for_s: how long a lost source is tried again, and the other targets with it, before
        SourceUnreachable is raised; counted from the last thing that arrived.
      ca: speak TLS: PEM file of the CA of the source's certificate, or "system". Default: TOUCHSTONE_TLS_CA.
      cert: PEM file of a client certificate. Default: TOUCHSTONE_TLS_CERT.
      key: PEM file of its private key. Default: TOUCHSTONE_TLS_KEY.
      token: that the source asks for. Default: TOUCHSTONE_TOKEN.
      token_file: file with it, read for every call, so that it may be replaced. Default: TOUCHSTONE_TOKEN_FILE.

    Raises:
      SourceUnreachable: none of them answers, or TLS or credentials do not fit; the message says which.
      InvalidRequest: a target is no "host:port".
    """
    checks.positive("timeout_s", timeout_s)
    checks.not_negative("retry_for_s", retry_for_s)
    targets = chosen_targets(targets)
    if targets is None:
        own = OwnServer()
        # A source of our own asks for nothing, whatever the environment has for others.
        client = Client(own.target, retry_for_s=retry_for_s, credentials=Credentials())
        client.own_server = own
    else:
        client = Client(targets, retry_for_s=retry_for_s, credentials=Credentials.of(ca, cert, key, token, token_file))
    try:
        client.describe(timeout_s=timeout_s, retry_for_s=timeout_s)
    except BaseException:
        client.close()
        raise
    return client


@arguments.checked
class Client(Diagnosis):
    """A source of touches and images. Usable as a context manager.

    The constructor does not connect; the first method that is called does. Every method raises InvalidRequest for what cannot be
    meant, NotFound for an object or model that the source does not have, Refused where it will not (a lease, a limit, a right), and
    SourceUnreachable once a lost source was tried again for retry_for_s.

    Attributes:
      rig: the Rig, where the source is one.
      own_server: that connect() started for it, or None; close() ends it.
    """

    def __init__(self, targets: Targets, *, retry_for_s: float = RETRY_FOR_S, credentials: Credentials | None = None):
        super().__init__(Connection(targets, checks.not_negative("retry_for_s", retry_for_s), credentials=credentials))
        self.own_server: OwnServer | None = None
        self._description: Description | None = None
        self._leases: list[Lease] = []
        self.rig = Rig(self)

    def __repr__(self) -> str:
        return printable(f"Client({', '.join(self._connection.targets)})")

    @property
    def targets(self) -> tuple[str, ...]:
        """All that it may use, "host:port"."""
        return self._connection.targets

    @property
    def target(self) -> str:
        """The one in use."""
        return self._connection.target

    @property
    def retry_for_s(self) -> float:
        """How long a lost source is tried again before SourceUnreachable, seconds."""
        return self._connection.retry_for_s

    @property
    def credentials(self) -> Credentials:
        """What the source is shown."""
        return self._connection.credentials

    def close(self) -> None:
        """Gives back what leases it holds, closes the connection, and ends the server that connect() started for this client.

        Every later call of it, and of the datasets, sessions and rig that it made, is Refused.
        """
        for lease in list(self._leases):
            lease.release()
        self._connection.close()
        if self.own_server is not None:
            self.own_server.stop()

    def __enter__(self) -> Client:
        self._connection.check_open()
        return self

    def __exit__(self, *_: Any) -> None:
        self.close()

    def describe(self, *, timeout_s: float | None = None, retry_for_s: float | None = None) -> Description:
        """What the source is, its limits, and what it can do.

        Args:
          timeout_s: how long to wait for an answer of each target; None: for ever.
          retry_for_s: how long a lost source is tried again; None: as the client's.
        """
        if timeout_s is not None:
            checks.positive("timeout_s", timeout_s)
        if retry_for_s is not None:
            checks.not_negative("retry_for_s", retry_for_s)
        self._description = Description.from_proto(
            self._connection.call(_SOURCE, "Describe", source_pb2.DescribeRequest(), timeout_s=timeout_s,
                                  retry_for_s=retry_for_s)
        )
        return self._description

    @property
    def is_physical(self) -> bool:
        """Whether the source moves something."""
        return self._described().kind == "physical"

    def _described(self) -> Description:
        """What is known of the source already, or asked for now."""
        self._connection.check_open()
        return self._description or self.describe()

    def lease(self, *, take: bool = False) -> Lease:
        """The right to move the source, for a `with` block; nothing at a source that needs none.

        Touches, images and datasets acquire one by themselves for as long as they last. Hold one to keep others out in
        between.

        Args:
          take: from whoever holds it; agree with them first.
        """
        needed = self._described().lease_required
        return _Held(self._connection, needed, take, self._leases)

    @contextlib.contextmanager
    def holding_lease(self) -> Iterator[str]:
        """The token of the lease that is held, or of one for this block; "" at a source that needs none."""
        with self._leased() as lease:
            yield lease.token

    @property
    def held_token(self) -> str:
        """The token of the lease that is held now, or ""."""
        self._connection.check_open()
        return self._leases[-1].token if self._leases else ""

    def session(self, name: str = "default", *, take_lease: bool = False) -> Session:
        """Touches of one session, under ids, so that it can be resumed. See Session."""
        self._connection.check_open()
        return Session(self, name, take_lease)

    def stop(self, reason: str = "") -> int:
        """Ends every motion now; needs no lease. Not safety-rated. Returns how many touches were under way.

        Raises:
          SourceFailed: the stop was sent, but the arm was not seen at rest: press the emergency stop if anything moves.
        """
        request = control_pb2.StopRequest(reason=reason or "client.stop()", holder=lease_holder())
        answer: control_pb2.StopResponse = self._connection.call(_CONTROL, "Stop", request, timeout_s=5.0, repeat=False)
        if not answer.standstill:
            raise SourceFailed("the stop was sent, but " + (answer.not_confirmed or "the gateway does not say whether the "
                               "arm stands still: press the emergency stop if anything moves"),
                               "UNAVAILABLE", self.target)
        return answer.aborted_touches

    def call(self, stub: type, method: str, request: Any, **how: Any) -> Any:
        """One call of the generated stubs, with this package's errors and retries."""
        return self._connection.call(stub, method, request, **how)

    def objects(self) -> list[ObjectInfo]:
        """The objects that can be touched."""
        reply = self._connection.call(_SOURCE, "ListObjects", source_pb2.ListObjectsRequest())
        return [ObjectInfo.from_proto(message) for message in reply.objects]

    def effects(self) -> list[Effect]:
        """Every effect that a model may name, with its parameters."""
        reply = self._connection.call(_MODELS, "ListEffects", models_pb2.ListEffectsRequest())
        return [Effect.from_proto(message) for message in reply.effects]

    def models(self) -> list[Model]:
        """The models in the source's store."""
        reply = self._connection.call(_MODELS, "ListModels", models_pb2.ListModelsRequest())
        return [Model.from_proto(message) for message in reply.models]

    def model(self, model: ModelLike = None) -> Model:
        """One model: a name, a hash, a file (which is only checked), or the source's default."""
        reference = model_ref(model)
        if reference.WhichOneof("ref") == "yaml":
            return self.add_model(reference.yaml, check_only=True)
        return Model.from_proto(
            self._connection.call(_MODELS, "GetModel", models_pb2.GetModelRequest(model=reference))
        )

    def add_model(self, model: ModelLike, *, check_only: bool = False) -> Model:
        """Keeps a model file (its path or its text) at the source under the name in it."""
        reference = model_ref(model)
        if reference.WhichOneof("ref") != "yaml":
            raise InvalidRequest(f"{model!r} is not a model file; give its path (*.yaml) or its text.")
        request = models_pb2.CreateModelRequest(yaml=reference.yaml, validate_only=check_only)
        return Model.from_proto(self._connection.call(_MODELS, "CreateModel", request))

    def plan(self, plan: PlanLike, object: str = "", count: int | None = None, *, seed: int = 0, start: int = 0,
             speed_mm_s: float = 20.0, model: ModelLike = None, max_draws: int = 0) -> Touches:
        """The commanded touches `start` .. `start + count - 1` of a plan for one object; nothing is touched.

        By default all from `start` on of a plan that has an end, 100 of sphere().

        A touch of sphere() or faces() is drawn again until every finger completes it; `draws` says how often. What is
        odd about the touches or the object's size is a UserWarning.

        Args:
          count: how many; no more than a plan that has an end holds.
          model: what the real rig has: its fingers, with its effects, must all meet the object. None: the source's own.
          max_draws: draws for one touch before the plan is refused, with the reason; 0: the source's own limit.
        """
        message = plan_message(plan)
        if not isinstance(plan, Touches):
            message.speed_m_s = units.si_value("speed_m_s", checks.positive("speed_mm_s", speed_mm_s))
        checks.uint64("start", start)
        end = plan.samples(1)
        if end and start >= end:
            raise InvalidRequest(f"start is {start}, and the plan ends with touch {end - 1}: it has {end} of one object.")
        left = end - start if end else 100
        count = left if count is None else checks.whole_number("count", count, 1, 2**32 - 1)
        if end and count > left:
            raise InvalidRequest(f"count is {count}, and the plan has {left} touches of one object from start={start} on: leave count out "
                                 f"for all of them, or give 1 to {left}.")
        request = source_pb2.ExpandPlanRequest(
            plan=message, object=object, seed=checks.uint64("seed", seed), first_index=start,
            count=count, model=model_ref(model),
            max_draws=checks.whole_number("max_draws", max_draws, 0, 2**32 - 1),
        )
        reply = self._connection.call(_SOURCE, "ExpandPlan", request)
        for note in reply.notes:
            arguments.warn(note)
        return Touches.from_messages(reply.touches, reply.draws.draws)

    def touch(self, object: str, touches: Touches, *, model: ModelLike = None, seed: int = 0, start: int = 0,
              lease_token: str = "", session: str = "", ids: Sequence[str] | None = None,
              series: bool = False, previous: tuple[str, Touches] | None = None) -> Batch:
        """Touches in the order given, as one session. NaN where a finger reported nothing.

        Args:
          start: touch k draws the noise of index start + k.
          lease_token: of a lease that is not this client's; by default that of client.lease(), or one for this call
            where the source needs it.
          session: that a physical source journals them in.
          ids: one per touch. A physical source answers an id that the session has from its journal, without motion, so
            that the call is repeated when the source was lost; without ids it is not.
          series: a physical source also keeps and gives the arm's states during each approach (`measured[k].series`,
            touchstone.v1.TouchSeries), about 200 kB a touch.
          previous: (object, touches) that the session made before these. What the last one leaves in the fingers of a virtual
            source (return_hysteresis), and the pause since, act on the first touch.

        Returns:
          A batch with (N, fingers) `descriptor_us`, `contact_time_us` and, where the source knows it, `travel_mm`;
          (N, fingers, 3) `contact_point_mm` and `normal`; (N,) `complete`. Its attribute `measured` has what a physical
          source measured, one message per touch (touchstone.v1.Measured). A start inside of the object or an
          implausible size of it is a UserWarning.
        """
        arguments.instance("touches", touches, Touches)
        if ids is not None and len(ids) != len(touches):
            raise InvalidRequest(f"ids has {len(ids)} entries for {len(touches)} touches; give one each.")
        if session:
            check_name(session)
        request = source_pb2.TouchRequest(
            object=object, touches=touches.to_messages(), model=model_ref(model), seed=checks.uint64("seed", seed),
            first_index=checks.uint64("start", start), lease_token=lease_token, session=session, touch_ids=ids or (),
            series=series,
        )
        if previous is not None:
            arguments.instance("previous", previous[1], Touches)
            request.previous.extend(source_pb2.PreviousTouch(object=previous[0], touch=touch)
                                    for touch in previous[1][-2:].to_messages())
        with contextlib.nullcontext() if lease_token else self._leased() as lease:
            reply = self._touch(request, lease)
        for note in reply.notes:
            arguments.warn(note)
        columns = {}
        for name, entry in (("descriptor_s", ()), ("contact_time_s", ()), ("travel_m", ()),
                            ("contact_point_m", (3,)), ("normal", (3,))):
            rows = [getattr(result, name) for result in reply.results]
            if rows and len(rows[0]):
                columns[name] = np.array([list(row) for row in rows], float).reshape(len(rows), -1, *entry)
        columns["complete"] = np.array([result.complete for result in reply.results], bool)
        batch = Batch(start, len(reply.results), columns, model_hash=reply.model_hash)
        batch.measured = [result.measured for result in reply.results if result.HasField("measured")]
        return batch

    def _touch(self, request: source_pb2.TouchRequest, lease: Lease | None) -> source_pb2.TouchResponse:
        if lease is not None:
            request.lease_token = lease.token
        reply: source_pb2.TouchResponse
        if not request.lease_token:
            reply = self._connection.call(_SOURCE, "Touch", request)
            return reply
        retry = Retry(len(self.targets), self.retry_for_s)
        again = False
        while True:
            try:
                reply = self._connection.call(_SOURCE, "Touch", request, repeat=False)
                return reply
            except TouchstoneError as error:
                # A touch of a real arm is not repeated without its id. Asked for again, it may still be under way, or
                # the lease be that of the process before.
                passing = error.code == "UNAVAILABLE" or (again and error.code == "ABORTED")
                if not (passing and request.touch_ids and lease is not None):
                    if error.code == "ABORTED" and lease is not None:
                        lease.check()
                    raise
                failure = error
            self._connection.move_on()
            retry.lost(failure)
            request.lease_token = lease.follow()
            again = True

    @contextlib.contextmanager
    def _leased(self) -> Iterator[Lease]:
        """The lease that is held, or one for this block."""
        if self._leases:
            self._leases[-1].check()
            yield self._leases[-1]
            return
        with self.lease() as lease:
            yield lease

    def capture(self, object: str, views: Views, *, image: ImageLike | None = None, normalize: bool = False,
                model: ModelLike = None, seed: int = 0, start: int = 0, lease_token: str = "") -> Batch:
        """Photographs: one for each touch (its camera) or each touchstone.Camera.

        Args:
          normalize: as image(normalize=True): dark objects on white.
          model: whose effects of photographs act on a virtual source's pictures (shaded style only); default: the
            source's. A name, a hash, a path to a model file, its text, or a Model.
          seed: of the pixels' noise, 0 to 2^64 - 1.
          start: view k draws the noise of index start + k.

        Returns:
          A batch with `image`, uint8 (N, height, width, channels) or EncodedImages, and `depth_mm`, `mask` if asked.
        """
        options = default_image() if image is None else to_image(image)
        if normalize:
            options = dataclasses.replace(options, normalize=True)
        with contextlib.ExitStack() as stack:
            token = lease_token or stack.enter_context(self.holding_lease())
            request = source_pb2.CaptureRequest(
                object=object, views=to_views(views), image=options.to_proto(), lease_token=token,
                model=model_ref(model), seed=checks.uint64("seed", seed), first_index=checks.uint64("start", start),
            )
            reply = self._connection.call(_SOURCE, "Capture", request, repeat=not token)
        return Batch.from_columns(0, reply.rows, reply.columns)

    def dataset(self, objects: str | Sequence[str], plan: PlanLike | None = None, *, samples: int | None = None,
                seed: int = 0, model: ModelLike = None, speed_mm_s: float | None = None,
                touch_interval_s: float = 0.0, columns: str | Sequence[str] | None = None,
                image: ImageLike | None = None, max_draws: int = 0, uncertainty: PosteriorLike = None,
                models_from: PosteriorLike = None, batch_size: int | None = None, start: int = 0,
                stop: int | None = None, stride: int = 1, units: str = "lab",
                session: str = "") -> Dataset:
        """A dataset to iterate over; sample i is the same bits whoever asks, however it is cut into batches.

        Args:
          objects: names; sample i shows objects[i mod count]. The column "object" is the position in this list.
          plan: sphere(...) (the default), faces(...) or touches(...).
          samples: how many; needed for a sphere plan, by default all touches of the others once.
          seed: of poses and noise, 0 to 2**64 - 1.
          model: a name, a hash, a path to a model file, its text, or a Model; default: the source's.
          speed_mm_s: commanded speed, default 20; explicit touches carry their own.
          touch_interval_s: time between the starts of neighbouring touches.
          columns: "index", "object", "descriptor", "contact_time", "pose", "contact", "image", or names as they come
            back ("descriptor_us"; "target_mm" brings its whole group, "pose"); default ("descriptor", "object"), and
            "image" if `image` is given.
          image: touchstone.image(...), or (width, height).
          max_draws: draws for one index before the stream fails; 0: the source's own limit.
          uncertainty: the Report (or its file) of the diagnosis that found the model: adds the columns "std_uncertainty_us" of
            each contact time, less the mean over its touch, and "beyond_measured" (1: nothing was measured near).
          models_from: the same report: each sample has a model of its own, drawn from what the report leaves open. The
            column "model_values" has its values, in the order of report.message.posterior.values.
          batch_size: samples a batch; default 4096, 64 with images.
          start: first sample of a part of the dataset.
          stop: the one after its last.
          stride: of every `stride` batches the first is delivered: worker w of W takes
            start=w * batch_size, stride=W.
          units: "lab" (mm, us, deg, mm/s), or "si": the wire's own columns (descriptor_s, ...), never copied.
          session: that a physical source journals the touches in.
        """
        si = bool(checks.choice("units", units, {"lab": 0, "si": 1}))
        spec = specification(
            objects, plan, samples=samples, seed=seed, model=model, speed_mm_s=speed_mm_s,
            touch_interval_s=touch_interval_s, columns=columns, image=image, max_draws=max_draws,
            uncertainty=uncertainty, models_from=models_from,
        )
        # A connection of its own: losing one stream must not close another's channel.
        return Dataset(
            self._connection.another(), spec, batch_size=batch_size, start=start, stop=stop, stride=stride, si=si,
            hold_lease=self.holding_lease, session=check_name(session) if session else "",
        )


    def samples(self, objects: str | Sequence[str], plan: PlanLike | None = None, *, samples: int | None = None,
                seed: int = 0, model: ModelLike = None, speed_mm_s: float | None = None,
                touch_interval_s: float = 0.0, columns: str | Sequence[str] | None = None,
                image: ImageLike | None = None, max_draws: int = 0, uncertainty: PosteriorLike = None,
                models_from: PosteriorLike = None, units: str = "lab",
                session: str = "") -> Samples:
        """A dataset by index, `samples[i]` or `samples[[3, 1, 7]]`: the same samples as those of dataset().

        Arguments as in dataset(). A list costs one request, so ask for as many as are needed together.
        """
        si = bool(checks.choice("units", units, {"lab": 0, "si": 1}))
        spec = specification(
            objects, plan, samples=samples, seed=seed, model=model, speed_mm_s=speed_mm_s,
            touch_interval_s=touch_interval_s, columns=columns, image=image, max_draws=max_draws,
            uncertainty=uncertainty, models_from=models_from,
        )
        return Samples(
            self._connection.another(), spec, si=si, hold_lease=self.holding_lease,
            session=check_name(session) if session else "",
        )


class _Held(Lease):
    """A lease that the client's own requests carry while it is held."""

    def __init__(self, connection: Connection, needed: bool, take: bool, held: list[Lease]):
        super().__init__(connection, needed, take)
        self._held = held
        held.append(self)

    def release(self) -> None:
        if self in self._held:
            self._held.remove(self)
        super().release()
