"""Two servers on the same folders are given the same names at once, with other contents: one wins, at both."""

from __future__ import annotations

import concurrent.futures

import grpc

from programs import Result, Server, create_model, create_session, export_session, list_models, measurements, model_yaml, scratch


def _outcome(call, *arguments):
    try:
        return call(*arguments) is not None
    except grpc.RpcError as error:
        assert error.code() == grpc.StatusCode.ALREADY_EXISTS, f"{error.code()}: {error.details()}"
        return False


def run(names: int = 200) -> Result:
    """names: how many names of each kind are fought for."""
    result = Result()
    with scratch() as folder:
        options = ("--models-dir", f"{folder}/models", "--sessions-dir", f"{folder}/sessions")
        with Server(*options) as one, Server(*options) as two, concurrent.futures.ThreadPoolExecutor(2) as pool:
            channels = [one.channel(), two.channel()]
            for k in range(names):
                yamls = [model_yaml(f"model-{k}", radius) for radius in (1.5, 2.5)]
                acknowledged = list(pool.map(_outcome, [create_model] * 2, channels, yamls))
                result.expect(sum(acknowledged) == 1, f"model-{k}: acknowledged {sum(acknowledged)} times")
                kept = f"radius_mm: {(1.5, 2.5)[acknowledged.index(True)]}" if any(acknowledged) else "nothing"
                for channel in channels:
                    yaml = next((model.yaml for model in list_models(channel) if model.name == f"model-{k}"), "")
                    result.expect(kept in yaml, f"model-{k}: {kept} was acknowledged, and kept is {yaml!r}")

                files = [measurements(40, first) for first in (1.0, 2.0)]
                acknowledged = list(pool.map(_outcome, [create_session] * 2, channels, [f"session-{k}"] * 2, files))
                result.expect(sum(acknowledged) == 1, f"session-{k}: acknowledged {sum(acknowledged)} times")
                if any(acknowledged):
                    for channel in channels:
                        result.expect(export_session(channel, f"session-{k}") == files[acknowledged.index(True)],
                                      f"session-{k}: other bytes are kept than were acknowledged")
    result.seen.append(f"{2 * names} names were each given to two servers at once: one of the two was acknowledged and kept")
    return result
