"""What only a physical source has: an arm, an end effector, a camera, and an object on its fixture."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Callable

from . import arguments, checks
from .errors import Refused
from .lease import holder
from .measurements import Row
from .plans import Touches
from .v1 import control_pb2, control_pb2_grpc, rig_pb2, rig_pb2_grpc

if TYPE_CHECKING:
    from .client import Client

_RIG = rig_pb2_grpc.RigStub
_CONTROL = control_pb2_grpc.ControlStub
_FACES = {
    "+x": rig_pb2.UP_FACE_PLUS_X, "-x": rig_pb2.UP_FACE_MINUS_X, "+y": rig_pb2.UP_FACE_PLUS_Y,
    "-y": rig_pb2.UP_FACE_MINUS_Y, "+z": rig_pb2.UP_FACE_PLUS_Z, "-z": rig_pb2.UP_FACE_MINUS_Z,
}
_FACE_NAMES = {number: name for name, number in _FACES.items()}
_CHECKS_A_REQUEST = 100
_NAMED = 20  # impossible touches


@dataclasses.dataclass(frozen=True)
class TouchCheck:
    """Whether a touch is possible; if not, `reason` says why. `up_face` ("+z") is the face that must point up."""

    possible: bool
    reason: str
    up_face: str
    duration_s: float


def _ask(object: str, up_face: str) -> None:
    input(f"Put {object} on the fixture with its face {up_face} up, then press Enter. ")


@arguments.checked
class Rig:
    """Client.rig. Moving needs a lease, which is acquired where no `with client.lease()` holds one."""

    def __init__(self, client: Client):
        self._client = client

    def status(self) -> rig_pb2.RigState:
        """How every part is, now: the message of proto/touchstone/v1/rig.proto, SI units."""
        return self._state("GetRig", rig_pb2.GetRigRequest(), repeat=True)

    def stop(self, reason: str = "") -> int:
        """Stops every motion now, until reset(); needs no lease. A software stop: not safety-rated.

        Returns the touches aborted.
        """
        return self._client.stop(reason)

    def reset(self, reason: str) -> control_pb2.State:
        """Releases a stop, for a person who has made sure that the rig may move. Moves nothing; ends the lease.

        Raises:
          Refused: the source is no rig; a stop there ends what runs and holds nothing.
        """
        if not self._client.is_physical:
            raise Refused(f"{self._client.target} is a {self._client.describe().kind} source, which has no rig: a stop ends what runs there "
                          "and holds nothing, so there is none to release.")
        request = control_pb2.ResetRequest(holder=holder(), reason=reason)
        state: control_pb2.State = self._client.call(_CONTROL, "Reset", request, repeat=False)
        return state

    def power_on(self) -> rig_pb2.RigState:
        """Powers the arm on and releases its brakes; never unlocks a protective stop."""
        with self._client.holding_lease() as token:
            return self._state("PowerOn", rig_pb2.PowerOnRequest(lease_token=token))

    def home(self) -> rig_pb2.RigState:
        """Backs the tool out along its own axis and goes to the home joints."""
        with self._client.holding_lease() as token:
            return self._state("Home", rig_pb2.HomeRequest(lease_token=token))

    def mount(self, object: str, up_face: str = "+z") -> rig_pb2.RigState:
        """Says which object lies on the fixture with which face up; where the rig changes it by itself, it does."""
        checks.choice("up_face", up_face, _FACES)
        with self._client.holding_lease() as token:
            request = rig_pb2.MountObjectRequest(object=object, up_face=_FACES[up_face], lease_token=token)
            return self._state("MountObject", request)

    def _state(self, method: str, request: Any, repeat: bool = False) -> rig_pb2.RigState:
        state: rig_pb2.RigState = self._client.call(_RIG, method, request, repeat=repeat)
        return state

    def prepare(self, object: str, up_face: str, ask: Callable[[str, str], None] = _ask) -> None:
        """mount(), if it does not lie so. Where a person must put it down the arm goes home, then ask(object, up_face)."""
        state = self.status()
        if (state.object, _FACE_NAMES.get(state.up_face, "")) == (object, up_face):
            return
        if not state.mounts_itself:
            self.home()
            ask(object, up_face)
        self.mount(object, up_face)

    def check(self, object: str, touches: Touches) -> list[TouchCheck]:
        """Every check that these touches pass before anything moves, without motion."""
        messages, result = arguments.instance("touches", touches, Touches).to_messages(), []
        for first in range(0, len(messages), _CHECKS_A_REQUEST):
            request = rig_pb2.CheckTouchesRequest(object=object, touches=messages[first:first + _CHECKS_A_REQUEST])
            reply = self._client.call(_RIG, "CheckTouches", request)
            result += [TouchCheck(c.possible, c.reason, _FACE_NAMES.get(c.up_face, ""), c.duration_s) for c in reply.checks]
        return result

    def groups(self, rows: Sequence[Row], skip_impossible: bool = False) -> dict[tuple[str, str], list[Row]]:
        """The rows by (object, up_face), in the order of the plan; what lies there comes first. Nothing moves.

        Args:
          skip_impossible: leave out touches that the rig cannot make, with a UserWarning.

        Raises:
          Refused: touches are impossible here, without skip_impossible; or all of them are.
        """
        groups: dict[tuple[str, str], list[Row]] = {}
        impossible: list[str] = []
        for row in rows:
            [check] = self.check(row.object, row.command)
            if check.possible:
                groups.setdefault((row.object, check.up_face), []).append(row)
            else:
                impossible.append(f"touch {row.touch} of {row.object}: {check.reason}")
        if impossible:
            names = "; ".join(impossible[:_NAMED]) + (f"; and {len(impossible) - _NAMED} more" if len(impossible) > _NAMED else "")
            said = f"{len(impossible)} of {len(rows)} touches are impossible here: {names}"
            if not skip_impossible or not groups:
                raise Refused(f"{said}. Nothing was moved; change the plan"
                              + ("." if not groups else ", or leave them out with skip_impossible=True."))
            arguments.warn(f"{said}. They are left out.")
        state = self.status()
        objects = list(dict.fromkeys(row.object for row in rows))
        mounted = (state.object, _FACE_NAMES.get(state.up_face, ""))
        rank = lambda key: (key[0] != state.object, objects.index(key[0]), key != mounted)
        return {key: groups[key] for key in sorted(groups, key=rank)}
