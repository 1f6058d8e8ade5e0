"""A server is killed at random points while clients write models and sessions: what was acknowledged is there, whole."""

from __future__ import annotations

import random
import threading

import grpc

from programs import (
    Result,
    Server,
    create_model,
    create_session,
    export_session,
    list_models,
    list_sessions,
    measurements,
    model_yaml,
    scratch,
    wait_until,
)

WRITERS = 4
MAX_WRITES = 60  # that are acknowledged before a kill: those of a fifth of a second


class Written:
    """What was sent, and of that what was acknowledged: by name, for both kinds."""

    def __init__(self):
        self.lock = threading.Lock()
        self.sent: dict[str, bytes] = {}
        self.acknowledged: set[str] = set()


def write(server: Server, written: Written, round_: int, writer: int, rng: random.Random) -> None:
    """Writes until the server is gone; a model and a session in turn."""
    with server.channel() as channel:
        for k in range(10_000):
            name = f"{'model' if k % 2 else 'session'}-{round_}-{writer}-{k}"
            data = (model_yaml(name, rng.uniform(0, 5)).encode() if k % 2
                    else measurements(rng.choice((40, 400, 4000)), rng.uniform(0, 1e6)))
            with written.lock:
                written.sent[name] = data
            try:
                create_model(channel, data.decode()) if k % 2 else create_session(channel, name, data)
            except grpc.RpcError as error:
                if error.code() in (grpc.StatusCode.UNAVAILABLE, grpc.StatusCode.CANCELLED):
                    return
                raise
            with written.lock:
                written.acknowledged.add(name)


def check(server: Server, written: Written, result: Result, names: set[str] | None = None) -> set[str]:
    """What is stored is exactly what was sent, and holds all that was acknowledged. names: whose bytes to fetch, and the only
    ones that are looked at, since a server that just started reads every session that it lists; None: all. Gives those stored."""
    with server.channel() as channel:
        models = {model.name: model.yaml for model in list_models(channel) if model.name.startswith("model-")}
        if names is None:
            sessions = {session.name for session in list_sessions(channel)}
            wanted = written.acknowledged
        else:
            sessions = {name for name in names if name.startswith("session-")}
            wanted = written.acknowledged & names
        exported = {name: csv for name in sessions if (csv := _exported(channel, name)) is not None}
        there = set(models) | set(exported)
        lost = sorted(wanted - there)
        result.expect(not lost, f"acknowledged and lost: {lost[:5]}, {len(lost)} of {len(wanted)}")
        strange = sorted(there - set(written.sent))
        result.expect(not strange, f"stored and never sent: {strange[:5]}")
        for name in sorted(there & set(written.sent)):
            if name in exported:
                result.expect(exported[name] == written.sent[name], f"session {name} has other bytes than were sent")
            else:
                radius = written.sent[name].decode().split("radius_mm: ")[1].split("}")[0]
                result.expect(f"radius_mm: {radius[:6]}" in models[name], f"model {name} is not the one that was sent")
    return there


def _exported(channel: grpc.Channel, name: str) -> bytes | None:
    try:
        return export_session(channel, name)
    except grpc.RpcError as error:
        if error.code() != grpc.StatusCode.NOT_FOUND:
            raise
        return None


def run(kills: int = 500, seed: int = 1) -> Result:
    """kills: how often the server is killed."""
    result, rng, written = Result(), random.Random(seed), Written()
    with scratch() as folder:
        options = ("--models-dir", f"{folder}/models", "--sessions-dir", f"{folder}/sessions", "--log-level", "off")
        for round_ in range(kills):
            before = set(written.sent)
            with Server(*options) as server:
                writers = [threading.Thread(target=write, args=(server, written, round_, k, random.Random(rng.random())))
                           for k in range(WRITERS)]
                enough = len(written.acknowledged) + rng.randrange(1, MAX_WRITES)
                for writer in writers:
                    writer.start()
                wait_until(lambda: len(written.acknowledged) >= enough)  # noqa: B023 - not called after this round
                server.kill()
                for writer in writers:
                    writer.join()
            with Server(*options) as server:
                check(server, written, result, set(written.sent) - before)
            if result.failures:
                break
        with Server(*options) as server:
            there = check(server, written, result)
    result.seen.append(f"{kills} kills; {len(written.acknowledged)} of {len(written.sent)} writes were acknowledged, "
                       f"{len(there)} are stored, none is torn")
    result.expect(len(written.acknowledged) >= kills // 2, f"only {len(written.acknowledged)} writes were acknowledged in {kills} rounds")
    result.expect(len(there) < len(written.sent), "no kill ever interrupted a write")
    return result
