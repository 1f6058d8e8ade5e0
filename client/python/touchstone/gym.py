"""Recognition by touch as Gymnasium environments: which object is it, in as few touches as possible?

    import gymnasium
    import touchstone.gym

    env = gymnasium.make("touchstone/Recognise-v0", targets="127.0.0.1:50051", objects=("lat00", "lat10", "lat20"))
    observation, info = env.reset(seed=1)
    observation, reward, terminated, truncated, info = env.step(0)

Action. Discrete: 0 to touches - 1 makes that touch of a list that is the same in every episode; touches + k answers that the
object is objects[k].

Observation. float32, (touches, 1 + 2 * fingers), 0 to 1. A row is a touch: 1 if it was made in this episode; then, for each
finger, its contact time less the first finger's, in times of the whole stroke; then, for each finger, 1 if it met the
object. What was not made, and fingers that met nothing, are 0. A touch that is made again replaces what was there. At
the beginning of an episode all is 0: which object it is cannot be seen.

Reward. -touch_cost for a touch, +1 for a right answer, -1 for a wrong one. An answer ends the episode (terminated); after
max_touches touches it ends without one (truncated).

Info. After a step "touches", how many were made; after an answer also "object", which it was, and "right".

The same seed gives the same episodes, byte for byte: the source makes sample i from the model, the seed and i alone. Which
object it is and which of `repeats` noises a touch has are drawn from the environment's own generator. gymnasium.make_vec()
gives RecogniseVectorEnv, any number of environments over one stream: a step is one request to the source.

Needs Gymnasium: pip install 'client/python[gym]'.
"""

from __future__ import annotations

import weakref
from collections.abc import Sequence
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

try:
    import gymnasium
    from gymnasium import spaces
    from gymnasium.vector import AutoresetMode, VectorEnv
    from gymnasium.vector.utils import batch_space
except ImportError as error:
    raise ImportError("touchstone.gym needs Gymnasium 1.1 or later: pip install 'client/python[gym]' or pip install gymnasium "
                      f"({error})") from error

from . import checks
from .box_touches import box_touches
from .client import Client, connect
from .connection import Targets
from .errors import InvalidRequest, Refused
from .models import ModelLike
from .plans import Touches, sphere
from .samples import Samples

__all__ = ["RecogniseEnv", "RecogniseVectorEnv", "default_touches"]

_OBJECTS = ("lat00", "lat05", "lat10", "lat15", "lat20")


def default_touches(client: Client, objects: Sequence[str], per_face: int = 4, seed: int = 0) -> Touches:
    """Touches of every face of the box that holds all these objects, up to its rim, with a stroke that ends 40 mm behind it.

    The list favours none of the objects: their sizes alone are known to it.
    """
    boxes = [(each.bounds_min_mm, each.bounds_max_mm) for each in client.objects() if each.name in objects]
    if len(boxes) < len(objects):
        for name in objects:
            client.plan(sphere(), name, 1)  # the source's own words for what it does not have
    low, high = np.min([box[0] for box in boxes], 0), np.max([box[1] for box in boxes], 0)
    return box_touches(low, high, per_face, seed=seed, spread=1.0, standoff_mm=60.0, stroke_mm=100.0)


class _Table:
    """What the environments share: the source, the touches, and the rules of an episode.

    Args: as of RecogniseEnv.
    """

    def __init__(self, targets: Targets | Client | None, objects: Sequence[str], touches: Touches | None, model: ModelLike,
                 repeats: int, max_touches: int, touch_cost: float, source_seed: int):
        self.objects = [objects] if isinstance(objects, str) else list(objects)
        if len(self.objects) < 2 or len(set(self.objects)) < len(self.objects):
            raise InvalidRequest(f"objects is {objects!r}; give at least two, each once: one alone needs no recognition.")
        self.repeats = checks.whole_number("repeats", repeats, 1, 10_000)
        self.max_touches = checks.whole_number("max_touches", max_touches, 1, 1_000_000)
        self.touch_cost = checks.number("touch_cost", touch_cost)
        owned = not isinstance(targets, Client)
        self.client = targets if isinstance(targets, Client) else connect(targets)
        # An environment that nobody closes, as Gymnasium's own checker leaves some, must not leave a server behind.
        self._finalizer = weakref.finalize(self, Client.close if owned else (lambda _: None), self.client)
        if self.client.is_physical:
            self._finalizer()
            raise InvalidRequest(f"{self.client.target} moves a rig, where an episode would wait for a person at every other object; "
                                 "give a touchstone-server, or an address of none for one of this process.")
        touches = default_touches(self.client, self.objects) if touches is None else touches
        if not isinstance(touches, Touches) or not len(touches):
            raise InvalidRequest("touches must be explicit, of touchstone.touches() or client.plan(), and at least one.")
        if touches.stroke_mm is None:
            raise InvalidRequest("touches need stroke_mm: without an end of the stroke a finger that meets nothing takes for ever.")
        self.touches = len(touches)
        self._stroke_us = touches.stroke_mm / touches.speed_mm_s * 1e6
        # A touch has as many noises as it stands in the list.
        copies = touches[np.tile(np.arange(self.touches), self.repeats)]
        self._samples: Samples = self.client.samples(self.objects, copies, seed=source_seed, model=model, columns=["descriptor_us"])
        self.fingers = self._samples.header.fingers
        self.observation_space = spaces.Box(0.0, 1.0, (self.touches, 1 + 2 * self.fingers), np.float32)
        self.actions = self.touches + len(self.objects)
        self.action_space: spaces.Discrete[np.int64] = spaces.Discrete(self.actions)
        self._closed = False

    def close(self) -> None:
        self._closed = True
        self._samples.close()
        self._finalizer()

    def check_open(self) -> None:
        """Raises Refused after close()."""
        if self._closed:
            raise Refused("The environment is closed; make a new one with gymnasium.make().")

    def touch(self, objects: NDArray[np.integer[Any]], touches: NDArray[np.integer[Any]],
              repeats: NDArray[np.integer[Any]]) -> NDArray[np.float32]:
        """(N, 1 + 2 * fingers) rows of observations for one request, for (N,) positions of objects, touches and noises."""
        index = (repeats * self.touches + touches) * len(self.objects) + objects
        times_us = self._samples[index]["descriptor_us"]
        met = np.isfinite(times_us)
        share = np.clip(np.nan_to_num(times_us) / self._stroke_us[touches][:, None], 0, 1)
        seen: NDArray[np.float32] = np.concatenate([np.ones((len(index), 1)), share, met], 1).astype(np.float32)
        return seen


class RecogniseEnv(gymnasium.Env["NDArray[np.float32]", np.int64]):
    """One object in an episode. See the module for actions, observations and rewards.

    Args:
      targets: "host:port", a Client (which is not closed), or None: a touchstone-server of this process.
      objects: names; which of them it is is drawn at reset(), uniformly. reset(options={"object": name}) names it.
      touches: explicit, with stroke_mm; None: default_touches() of the objects.
      model: a name, a hash, a path to a model file, its text, or a Model; default: the source's. Without an effect of
        noise in it every touch says the same each time.
      repeats: different noises of one touch.
      max_touches: then the episode is truncated.
      touch_cost: what a touch costs, beside a right answer's 1.
      source_seed: of the noise at the source.
    """

    metadata: ClassVar[dict[str, Any]] = {"render_modes": []}  # type: ignore[misc]  # an attribute of each in Gymnasium
    observation_space: spaces.Box
    action_space: spaces.Discrete[np.int64]

    def __init__(self, targets: Targets | Client | None = None, objects: Sequence[str] = _OBJECTS, touches: Touches | None = None, *,
                 model: ModelLike = None, repeats: int = 16, max_touches: int = 12, touch_cost: float = 0.05, source_seed: int = 0,
                 render_mode: None = None):
        self._table = _Table(targets, objects, touches, model, repeats, max_touches, touch_cost, source_seed)
        self.observation_space, self.action_space = self._table.observation_space, self._table.action_space
        self.render_mode = render_mode
        self._object: int | None = None
        self._made = 0
        self._seen = np.zeros(self.observation_space.shape, np.float32)

    @property
    def objects(self) -> tuple[str, ...]:
        """The names that answers stand for, in order."""
        return tuple(self._table.objects)

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[NDArray[np.float32], dict[str, Any]]:
        """Begins an episode: an object is drawn, or options={"object": name} names it. InvalidRequest for a name that is not among them."""
        self._table.check_open()
        super().reset(seed=seed)
        self._object = _drawn(self._table, self.np_random, options)
        self._made = 0
        self._seen[:] = 0
        return self._seen.copy(), {"touches": 0}

    def step(self, action: int | np.integer[Any]) -> tuple[NDArray[np.float32], float, bool, bool, dict[str, Any]]:
        """A touch or an answer: observation, reward, terminated, truncated, info. InvalidRequest without an episode, or for an action
        out of range."""
        self._table.check_open()
        if self._object is None:
            raise InvalidRequest("The episode is over, or none has begun; call reset().")
        if not self.action_space.contains(action):
            raise InvalidRequest(f"action is {action!r}; give 0 to {self._table.touches - 1} to touch, {self._table.touches} to "
                                 f"{self._table.actions - 1} to answer.")
        table, number = self._table, int(action)
        if number >= table.touches:
            true, self._object = self._object, None
            right = number - table.touches == true
            return self._seen.copy(), 1.0 if right else -1.0, True, False, {
                "touches": self._made, "object": table.objects[true], "right": right}
        repeat = self.np_random.integers(table.repeats)
        self._seen[number] = table.touch(np.array([self._object]), np.array([number]), np.array([repeat]))[0]
        self._made += 1
        truncated = self._made >= table.max_touches
        if truncated:
            self._object = None
        return self._seen.copy(), -table.touch_cost, False, truncated, {"touches": self._made}

    def close(self) -> None:
        """Closes the connection, and ends the server that was started for this environment."""
        self._table.close()


class RecogniseVectorEnv(VectorEnv["NDArray[np.float32]", "NDArray[np.integer[Any]]", "NDArray[Any]"]):
    """num_envs environments whose touches of a step are one request to one source. Arguments as of RecogniseEnv.

    Environment k draws from a generator of its own, of seed + k or of the k-th seed, and so has the episodes that RecogniseEnv
    has with that seed. An environment that ended is reset by the next step, whatever its action (AutoresetMode.NEXT_STEP).
    """

    metadata: ClassVar[dict[str, Any]] = {  # type: ignore[misc]  # an attribute of each in Gymnasium
        "render_modes": [], "autoreset_mode": AutoresetMode.NEXT_STEP}
    single_observation_space: spaces.Box
    single_action_space: spaces.Discrete[np.int64]

    def __init__(self, num_envs: int = 1, targets: Targets | Client | None = None, objects: Sequence[str] = _OBJECTS,
                 touches: Touches | None = None, *, model: ModelLike = None, repeats: int = 16, max_touches: int = 12,
                 touch_cost: float = 0.05, source_seed: int = 0, render_mode: None = None):
        self.num_envs = checks.whole_number("num_envs", num_envs, 1, 50_000)
        self._table = _Table(targets, objects, touches, model, repeats, max_touches, touch_cost, source_seed)
        self.single_observation_space, self.single_action_space = self._table.observation_space, self._table.action_space
        self.observation_space = batch_space(self.single_observation_space, self.num_envs)
        self.action_space = batch_space(self.single_action_space, self.num_envs)
        self.render_mode = render_mode
        self._generators = [np.random.default_rng(bits) for bits in np.random.SeedSequence().spawn(self.num_envs)]
        self._object = np.zeros(self.num_envs, int)
        self._made = np.zeros(self.num_envs, int)
        self._ended: NDArray[np.bool_] | None = None  # None: reset() was not called
        self._seen = np.zeros((self.num_envs, *self.single_observation_space.shape), np.float32)

    @property
    def objects(self) -> tuple[str, ...]:
        """The names that answers stand for, in order."""
        return tuple(self._table.objects)

    def reset(self, *, seed: int | Sequence[int | None] | None = None,
              options: dict[str, Any] | None = None) -> tuple[NDArray[np.float32], dict[str, Any]]:
        """Begins an episode in every environment; observations are (num_envs, touches, 1 + 2 * fingers). `seed`: one number, or one
        per environment."""
        self._table.check_open()
        seeds: list[int | None] = [None] * self.num_envs
        if isinstance(seed, (int, np.integer)):
            seeds = [int(seed) + k for k in range(self.num_envs)]
        elif seed is not None:
            seeds = list(seed)
        if len(seeds) != self.num_envs:
            raise InvalidRequest(f"seed has {len(seeds)} entries for {self.num_envs} environments; give one each, or one number.")
        for k, each in enumerate(seeds):
            if each is not None:
                self._generators[k], _ = gymnasium.utils.seeding.np_random(each)
        self._begin(np.arange(self.num_envs), options)
        self._ended = np.zeros(self.num_envs, bool)
        return self._seen.copy(), {"touches": self._made.copy(), "_touches": np.ones(self.num_envs, bool)}

    def step(self, actions: NDArray[np.integer[Any]]) -> tuple[NDArray[np.float32], NDArray[np.float64], NDArray[np.bool_],
                                                               NDArray[np.bool_], dict[str, Any]]:
        """One step of every environment, for (num_envs,) whole numbers: one request to the source. InvalidRequest as of RecogniseEnv."""
        self._table.check_open()
        if self._ended is None:
            raise InvalidRequest("No episode has begun; call reset().")
        actions = np.asarray(actions)
        if actions.shape != (self.num_envs,) or actions.dtype.kind not in "iu" or not (
                (0 <= actions) & (actions < self._table.actions)).all():
            raise InvalidRequest(f"actions must be {self.num_envs} whole numbers from 0 to {self._table.actions - 1}.")
        table, begun = self._table, self._ended.copy()
        self._begin(np.flatnonzero(begun), None)
        touching = np.flatnonzero(~begun & (actions < table.touches))
        if len(touching):
            repeats = np.array([self._generators[k].integers(table.repeats) for k in touching])
            self._seen[touching, actions[touching]] = table.touch(self._object[touching], actions[touching], repeats)
            self._made[touching] += 1
        answered = ~begun & (actions >= table.touches)
        right = answered & (actions - table.touches == self._object)
        reward = np.where(answered, np.where(right, 1.0, -1.0), 0.0)
        reward[touching] = -table.touch_cost
        truncated = ~begun & ~answered & (self._made >= table.max_touches)
        self._ended = answered | truncated
        info = {"touches": self._made.copy(), "_touches": np.ones(self.num_envs, bool)}
        if answered.any():
            names = np.array(table.objects, object)[self._object]
            names[~answered] = None
            info |= {"object": names, "_object": answered,
                     "right": right, "_right": answered}
        return self._seen.copy(), reward, answered, truncated, info

    def close_extras(self, **_: Any) -> None:
        """Closes what the environments share; close() calls it."""
        self._table.close()

    def _begin(self, places: NDArray[np.integer[Any]], options: dict[str, Any] | None) -> None:
        for k in places:
            self._object[k] = _drawn(self._table, self._generators[k], options)
        self._made[places] = 0
        self._seen[places] = 0


def _drawn(table: _Table, rng: np.random.Generator, options: dict[str, Any] | None) -> int:
    """The position of an episode's object."""
    options = options or {}
    checks.known_keys("options", options, ("object",))
    if "object" not in options:
        return int(rng.integers(len(table.objects)))
    if options["object"] not in table.objects:
        raise InvalidRequest(f"options names the object {options['object']!r}; there are {', '.join(table.objects)}.")
    return table.objects.index(options["object"])


gymnasium.register("touchstone/Recognise-v0", entry_point="touchstone.gym:RecogniseEnv",
                   vector_entry_point="touchstone.gym:RecogniseVectorEnv")
