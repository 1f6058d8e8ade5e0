#!/usr/bin/env python3
"""Measures how fast touches and images of a running source arrive as NumPy batches.

    stream_rate.py --server 127.0.0.1:50051 --seconds 5 --json rates.json

Touches with their object are counted when their columns were converted and read once (a sum), images when they
were read once. The first batch is not counted, but the time until it arrives is reported.
"""

import argparse
import json
import sys
import threading
import time

import numpy as np

import touchstone


def measure(dataset, seconds, consume):
    """(samples per second, milliseconds until the first batch), over about `seconds`."""
    begin = time.perf_counter()
    batches = iter(dataset)
    consume(next(batches))
    first_ms = (time.perf_counter() - begin) * 1e3
    samples, begin, now = 0, time.perf_counter(), 0.0
    for batch in batches:
        consume(batch)
        samples += batch.rows
        now = time.perf_counter() - begin
        if now >= seconds:
            break
    batches.close()
    return samples / now, first_ms


def read_touches(batch):
    return batch["descriptor_us"][-1, 0] + batch["object"][-1]


def read_si(batch):
    return batch["descriptor_s"][-1, 0] + batch["object"][-1]


def read_images(batch):
    images = batch["image"]
    return images[:, ::16].max() if isinstance(images, np.ndarray) else len(images[-1])


def parallel(make, streams, seconds, consume):
    """The sum over streams that run at the same time, each in a thread with a connection of its own."""
    rates = [(0.0, 0.0)] * streams  # per second, and the first batch's ms
    def run(k):
        rates[k] = measure(make(k), seconds, consume)
    threads = [threading.Thread(target=run, args=(k,)) for k in range(streams)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    return sum(rate for rate, _ in rates), max(first for _, first in rates)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--server", default="127.0.0.1:50051", help="HOST:PORT")
    parser.add_argument("--object", default="lat20")
    parser.add_argument("--seconds", type=float, default=5.0, help="duration of each measurement")
    parser.add_argument("--batch-size", type=int, help="of touches; default: 4096 and 65536 are both measured")
    parser.add_argument("--images", type=int, default=224, metavar="PIXELS", help="side of an image; 0: no images")
    parser.add_argument("--json", help="file for the results")
    arguments = parser.parse_args()

    client = touchstone.connect(arguments.server)
    endless, results = 2**40, []

    def report(what, unit, rate, first_ms):
        results.append({"what": what, "unit": unit, "rate_per_s": rate, "first_batch_ms": first_ms})
        print(f"{what:48} {rate:14,.0f} {unit}/s   first batch after {first_ms:6.1f} ms", flush=True)

    for batch_size in [arguments.batch_size] if arguments.batch_size else [4096, 65536]:
        touches = lambda k=0, units="lab", batch_size=batch_size: client.dataset(
            arguments.object, samples=endless, seed=k, batch_size=batch_size, units=units)
        name = f"touches, batches of {batch_size}"
        report(name, "touches", *measure(touches(), arguments.seconds, read_touches))
        report(name + ", SI", "touches", *measure(touches(units="si"), arguments.seconds, read_si))
        report(name + ", two streams", "touches", *parallel(touches, 2, arguments.seconds, read_touches))
    if arguments.images:
        side = arguments.images
        for encoding in ("raw", "png", "jpeg"):
            dataset = client.dataset(arguments.object, samples=endless, columns=["image"],
                                     image=touchstone.image(side, side, encoding=encoding))
            report(f"grey {encoding} images {side}x{side}", "images", *measure(dataset, arguments.seconds, read_images))
    if arguments.json:
        with open(arguments.json, "w") as file:
            json.dump({"server": arguments.server, "version": client.describe().version, "results": results}, file,
                      indent=1)


if __name__ == "__main__":
    try:
        main()
    except touchstone.TouchstoneError as error:
        sys.exit(f"stream_rate: {error}")
