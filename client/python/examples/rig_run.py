#!/usr/bin/env python3
"""A plan's touches on a rig, as `touchstone rig run plan.csv -o set.csv`: run again, it resumes where it stopped.

    python3 rig_run.py 127.0.0.1:50052 plan.csv monday set.csv
"""

import sys

import touchstone

target, plan, name, output = sys.argv[1:]
client = touchstone.connect(target)
with client.session(name) as session:
    done, left = session.made_before(touchstone.read_plan(plan))
    print(f"{len(done)} touches come from the session, {len(left)} are made now")
    for (thing, face), rows in client.rig.groups(left).items():
        client.rig.prepare(thing, face)  # asks you to put it down, where the rig cannot
        done += [session.touch(row) for row in rows]
touchstone.write_measurements(output, done, force=True)
