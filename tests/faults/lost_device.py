"""The graphics device of a server is reset, and goes and comes back, while a client draws a dataset of pictures: every picture
that arrives has the bytes that it should have, the client's dataset is whole, and touches without pictures go on.

The driver is a real one, the loss is not: lost_device.cpp tells of it in the driver's name."""

from __future__ import annotations

import pathlib
import random
import struct
import subprocess
import time

from programs import CLIENT, Preloaded, Result, Server, scratch, stream, wait_until


class Device(Preloaded):
    """Of a server that is started with its environment."""

    def __init__(self, folder: str):
        super().__init__("touchstone-lost-device", "TOUCHSTONE_LOST_DEVICE", folder)

    def reset(self) -> None:
        self.state[:4] = struct.pack("<i", 1)

    def told(self) -> bool:
        return self.state[:4] == bytes(4)

    def gone(self, gone: bool) -> None:
        self.state[4:] = struct.pack("<i", gone)


SHARDS = 6


def _draw(server: Server, pictures: int, out: pathlib.Path) -> subprocess.Popen:
    words = ["stream", "--server", server.target, "--objects", "lat00,lat20", "--samples", str(pictures),
             "--shard-size", str(pictures // SHARDS), "--image",
             "128x128"]
    return subprocess.Popen([CLIENT, *words, "--out", out, "--quiet"], stderr=subprocess.PIPE, text=True)


def run(pictures: int = 30_000, resets: int = 50, absences: int = 10, seed: int = 1) -> Result:
    """pictures: of the dataset, a multiple of SHARDS. resets: while it is drawn, or a few more. absences: how often the device
    stays away for a moment."""
    result, rng, told, away = Result(), random.Random(seed), 0, 0
    with scratch() as folder:
        device, whole, made = Device(folder), pathlib.Path(folder) / "whole", pathlib.Path(folder) / "made"
        with Server("--renderer", "egl", environment=device.environment) as server, server.channel() as channel:
            client = _draw(server, pictures, whole)
            _, words = client.communicate(timeout=600)
            result.expect(client.returncode == 0, f"without any loss: the client ended with {client.returncode}: {words}")
            client = _draw(server, pictures, made)
            while client.poll() is None and (told < resets or away < absences):
                time.sleep(rng.uniform(0.0, 0.05))
                stays = away < absences and rng.random() < absences / resets
                device.gone(stays)
                device.reset()
                wait_until(lambda: device.told() or client.poll() is not None)
                if client.poll() is not None:
                    break
                told += device.told()
                if stays:
                    rows = sum(response.batch.rows for response in stream(channel, 20_000))
                    result.expect(rows == 20_000, f"without a device, a stream without pictures gave {rows} of 20,000 samples")
                    time.sleep(rng.uniform(0.0, 0.3))
                    device.gone(False)
                    away += 1
            device.gone(False)
            _, words = client.communicate(timeout=600)
            result.expect(client.returncode == 0, f"the client ended with {client.returncode}: {words}")
            result.expect(server.alive(), "the server ended")
        shards = {path.name: path.read_bytes() for path in whole.glob("shard-*.tar")}
        result.expect({path.name: path.read_bytes() for path in made.glob("shard-*.tar")} == shards,
                      "the dataset has other bytes than without losses")
        result.expect(len(shards) == SHARDS, f"{len(shards)} shards of {SHARDS}")
    result.expect(told >= resets // 2 and away >= min(absences, 1), f"only {told} resets and {away} absences while {pictures:,} pictures were drawn")
    kept = "the dataset has the bytes that it has without" if not result.failures else "not all was kept"
    result.seen.append(f"{told} resets, after {away} of which the device stayed away for a moment, while {pictures:,} pictures were drawn: {kept} "
                       "(a real driver, whose losses are told by a preloaded library)")
    return result
