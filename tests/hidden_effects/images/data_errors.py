"""Mistakes in a finished set: of its files, not of the rig. `kinds`: what a report may rightly call it."""
import numpy as np

import photograph
import sets

NAMES = ("mirrored", "rotated", "channel_order", "wrong_object", "focal_factor", "row_shift", "up_axis", "units_length",
         "up_reversed", "exchanged", "thumb")
# A mistake that makes the same set is as right an answer: a picture on its head is a camera whose up is reversed.
KINDS = {
    "mirrored": ("mirrored",),
    "rotated": ("rotated", "up_axis"),
    "channel_order": ("channel_order",),
    "wrong_object": ("wrong_object", "object_names"),
    "focal_factor": ("focal_factor",),
    "row_shift": ("row_shift",),
    "up_axis": ("up_axis", "rotated"),
    "units_length": ("units_length",),
    "up_reversed": ("up_axis",),
    "exchanged": ("exchanged",),
    "thumb": ("odd_picture",),
}


def coloured(files, random):
    """The same pictures from a colour camera under warm light: red, green, blue."""
    gains = np.array([1.0, random.uniform(0.85, 0.95), random.uniform(0.7, 0.85)])
    files.pictures = [np.clip(np.floor(p[:, :, None] * gains + 0.5), 0, 255).astype(np.uint8) for p in files.pictures]


def make(name, files, random):
    """Changes `files`; the truth of what was photographed stays."""
    rows, pictures = files.rows, files.pictures
    if name == "mirrored":
        sideways = random.random() < 0.7
        files.pictures = [p[:, ::-1] if sideways else p[::-1] for p in pictures]
    elif name == "rotated":
        turns = int(random.integers(1, 4))
        files.pictures = [np.rot90(p, turns) for p in pictures]
    elif name == "channel_order":
        coloured(files, random)
        for k in range(len(rows) // 2, len(rows)):
            files.pictures[k] = files.pictures[k][:, :, ::-1]
    elif name == "wrong_object":
        names = [solid.name for solid in sets.objects()]
        one, other = random.choice(len(names), 2, replace=False)
        swapped = {names[one]: names[other], names[other]: names[one]}
        for row in rows:
            row["object"] = swapped.get(row["object"], row["object"])
    elif name == "focal_factor":
        factor = float(random.choice([0.5, 2.0, 1.6, 0.625]))
        c = files.camera
        files.camera = photograph.Camera(c.width, c.height, c.fx * factor, c.fy * factor, c.cx, c.cy)
        files.truth.notes["factor"] = factor
    elif name == "row_shift":
        shift = int(random.choice([-1, 1]))
        files.pictures = [pictures[(k + shift) % len(pictures)] for k in range(len(pictures))]
    elif name == "up_axis":
        # Written by a program whose y points up.
        for row in rows:
            for part in ("eye", "at", "up"):
                x, y, z = row[part]
                row[part] = np.array([x, z, -y])
    elif name == "units_length":
        factor = float(random.choice([0.001, 0.1, 1 / 25.4]))
        for row in rows:
            row["eye"], row["at"] = row["eye"] * factor, row["at"] * factor
        files.truth.notes["factor"] = factor
    elif name == "up_reversed":
        for row in rows:
            row["up"] = -np.asarray(row["up"])
    elif name == "exchanged":
        one, other = (int(k) for k in random.choice(len(rows), 2, replace=False))
        pictures[one], pictures[other] = pictures[other], pictures[one]
        files.truth.notes["images"] = (one, other)
    elif name == "thumb":
        # Skin, out of focus, over a corner of one picture.
        number = int(random.integers(len(rows)))
        height, width = pictures[number].shape
        row, column = np.mgrid[:height, :width]
        inside = ((column - 0.9 * width) / random.uniform(40, 70)) ** 2 + ((row - 0.85 * height) / random.uniform(50, 80)) ** 2
        share = 1 / (1 + np.exp(12 * (inside - 1)))
        skin = random.uniform(90, 180) + 2 * random.standard_normal((height, width))
        pictures[number] = np.clip(np.floor((1 - share) * pictures[number] + share * skin + 0.5), 0, 255).astype(np.uint8)
        files.truth.notes["image"] = number
    else:
        raise ValueError(name)
    files.truth.data_error = name
    return files
