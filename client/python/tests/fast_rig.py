"""Measurements of a rig that is 8 % faster than the model says."""

import touchstone

NOMINAL = "touchstone: model/1\nname: nominal_rig\neffects:\n  - gaussian_noise: {sigma_us: 2000}\n"
HIDDEN = NOMINAL.replace("nominal_rig", "fast_rig") + "  - speed_error: {relative: 0.08}\n"


def measure(client, path):
    """Writes 24 poses of lat20 in two rounds; returns the path."""
    touches = client.plan(touchstone.faces(samples_per_face=4, rounds=2), "lat20", count=48)
    batch = client.touch("lat20", touches, model=HIDDEN, seed=1)
    touchstone.write_measurements(path, [touchstone.Row(k, "lat20", touches[k:k + 1], tuple(batch["contact_time_us"][k]))
                                         for k in range(len(touches))])
    return path
