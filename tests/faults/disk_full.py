"""The disk of models and sessions runs full: what was acknowledged stays, the rest is refused in words, and once there is
room again it goes on."""

from __future__ import annotations

import contextlib
import os
import subprocess

import grpc

from programs import Result, Server, create_model, create_session, export_session, list_models, list_sessions, measurements, model_yaml, scratch


@contextlib.contextmanager
def small_disk(folder: str, kibibytes: int):
    """A file system of that size in the folder; PermissionError where this user may not mount one."""
    mounted = subprocess.run(["mount", "-t", "tmpfs", "-o", f"size={kibibytes}k", "tmpfs", folder], capture_output=True, text=True, check=False)
    if mounted.returncode:
        raise PermissionError(f"mounting a small disk takes root: {mounted.stderr.strip()}")
    try:
        yield
    finally:
        subprocess.run(["umount", "-l", folder], check=True)


def run(kibibytes: int = 2048) -> Result:
    """kibibytes: size of the disk."""
    result = Result()
    with scratch() as folder, small_disk(folder, kibibytes):
        options = ("--models-dir", f"{folder}/models", "--sessions-dir", f"{folder}/sessions")
        with Server(*options) as server, server.channel() as channel:
            kept, refused = {}, []
            for k in range(4000):
                # Large ones first, then ever smaller ones, so that the last page of the disk is used too.
                name, data = f"s{k}", measurements(max(1, 2000 >> len(refused)), float(k))
                try:
                    create_session(channel, name, data)
                    kept[name] = data
                except grpc.RpcError as error:
                    refused.append(error)
                    if len(refused) > 14:
                        break
            for refusal in refused:
                result.expect(refusal.code() in (grpc.StatusCode.RESOURCE_EXHAUSTED, grpc.StatusCode.UNAVAILABLE)
                              and "space" in (refusal.details() or ""), f"a full disk is told as {refusal.code()}: {refusal.details()}")
            try:
                create_model(channel, model_yaml("late", 2))
                result.failures.append("a model was acknowledged on a full disk")
            except grpc.RpcError as error:
                result.expect("space" in (error.details() or ""), f"a full disk is told as {error.code()}: {error.details()}")
            result.expect(bool(kept) and len(refused) > 14, f"the disk never ran full: {len(kept)} sessions")
            _compare(channel, kept, result)
            # Room again: it goes on without being started anew.
            os.remove(f"{folder}/sessions/s0.csv")
            del kept["s0"]
            create_model(channel, model_yaml("later", 2))
            kept["again"] = measurements(40, 0.5)
            create_session(channel, "again", kept["again"])
        with Server(*options) as server, server.channel() as channel:
            _compare(channel, kept, result)
            result.expect(any(model.name == "later" for model in list_models(channel)), "the model written later is lost")
    result.seen.append(f"a disk of {kibibytes} KiB held {len(kept)} sessions; {len(refused)} more and a model were refused for want of "
                       "space; after room was made it went on, and a new start found everything")
    return result


def _compare(channel, kept, result):
    there = {session.name for session in list_sessions(channel)}
    result.expect(there == set(kept), f"stored {sorted(there ^ set(kept))[:5]} is not what was acknowledged")
    for name in there & set(kept):
        result.expect(export_session(channel, name) == kept[name], f"session {name} has other bytes than were sent")
