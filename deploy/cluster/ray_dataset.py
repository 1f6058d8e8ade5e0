#!/usr/bin/env python3
"""A dataset as files by a Ray cluster: each task writes its part of the shards into a folder that every node sees.

    ray_dataset.py --jobs 100 -- --samples 1000000 --image 224x224 --renderer cpu --out /shared/training

What follows -- is for `touchstone stream`, which must be in PATH on every node. A task whose node dies is begun again by
Ray and resumes; one whose source cannot be reached is tried again; any other error ends the run with its message.
"""
import argparse
import subprocess
import sys

import ray

UNREACHABLE = 3  # exit code of touchstone


class SourceUnreachable(Exception):
    """May pass: Ray tries the task again."""


class Failed(Exception):
    """Would come again: bad input, or refused."""


@ray.remote(num_cpus=1, max_retries=5, retry_exceptions=[SourceUnreachable])
def write_shards(program, job, jobs, arguments):
    cores = ray.get_runtime_context().get_assigned_resources().get("CPU", 1)
    command = [program, "stream", *arguments, "--shards", f"{job}/{jobs}", "--quiet"]
    if "--server" not in arguments and "--threads" not in arguments:
        command += ["--threads", str(max(1, int(cores)))]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode == UNREACHABLE:
        raise SourceUnreachable(done.stderr)
    if done.returncode < 0:
        raise SourceUnreachable(f"job {job}: ended by signal {-done.returncode}")
    if done.returncode != 0:
        raise Failed(f"job {job}: {done.stderr}")
    return job


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--jobs", type=int, required=True, help="parts, more than one; a task each")
    parser.add_argument("--cpus", type=float, default=1, help="cores of a task")
    parser.add_argument("--program", default="touchstone", help="the command line")
    parser.add_argument("arguments", nargs="+", help="of touchstone stream")
    options = parser.parse_args()
    ray.init(log_to_driver=False)
    task = write_shards.options(num_cpus=options.cpus)
    running = [task.remote(options.program, job, options.jobs, options.arguments) for job in range(options.jobs)]
    failed = []
    while running:
        (done,), running = ray.wait(running)
        try:
            ray.get(done)
        except Exception as error:  # noqa: BLE001 - a task's own, of a class that Ray makes
            failed.append(getattr(error, "cause", error))
    for reason in failed:
        print(f"ray_dataset.py: {reason}", file=sys.stderr)
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
