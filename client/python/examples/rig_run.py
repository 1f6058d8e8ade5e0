#!/usr/bin/env python3
"""A plan's touches on a rig, as `touchstone rig run plan.csv -o set.csv`: run again, it resumes where it stopped.

    python3 rig_run.py 127.0.0.1:50052 plan.csv monday set.csv
"""

import sys

import touchstone

target, plan, name, output = sys.argv[1:]
client = touchstone.connect(target)
done = []
with client.session(name) as session:
    for (thing, face), rows in client.rig.groups(touchstone.read_plan(plan)).items():
        client.rig.prepare(thing, face)  # asks you to put it down, where the rig cannot
        done += [session.touch(row) for row in rows]
touchstone.write_measurements(output, done, force=True)
