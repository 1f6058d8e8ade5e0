"""Streams datasets of touches and pictures by two programs, and says whether their bytes are the same.

    tests/arm64/same_bytes.py PROGRAM OTHER_PROGRAM [ARGUMENT ...]

One dataset under each effect of the catalogue by itself, one under all of them; the exit status is 1 where any differs. Noise
that needs another kind beside it acts in the last one.
"""

from __future__ import annotations

import hashlib
import json
import pathlib
import subprocess
import sys
import tempfile

ENTRIES = {"scalar": 1, "finger": 3, "vector2": 2, "vector3": 3}
SHARES = (1.0, -0.4, 0.7)  # of a typical value, so that entries differ
STREAM = ("--objects", "lat00,lat20", "--samples", "120", "--seed", "3", "--image", "64x64", "--renderer", "cpu", "--quiet")


def effect_line(effect: dict) -> str:
    """The effect with typical values, as a line of a model file."""
    assigned = []
    for parameter in effect["parameters"]:
        values = [parameter["typical"] * share for share in SHARES[:ENTRIES[parameter["arity"]]]]
        if parameter["sum_zero"]:
            values = [value - sum(values) / len(values) for value in values]
        values = [min(max(value, parameter["min"]), parameter["max"]) for value in values]
        assigned.append(f"{parameter['name']}: {values[0] if len(values) == 1 else values}")
    return f"  - {effect['name']}: {{{', '.join(assigned)}}}"


def bytes_of(program: list[str], model: pathlib.Path, folder: pathlib.Path) -> str:
    """SHA-256 of the dataset's only shard."""
    subprocess.run([*program, "stream", "--model", model, "--out", folder, *STREAM], check=True)
    (shard,) = folder.glob("*.tar")
    return hashlib.sha256(shard.read_bytes()).hexdigest()


def main() -> None:
    programs = [sys.argv[1:2], sys.argv[2:]]
    listed = subprocess.run([*programs[0], "effects", "--json"], stdout=subprocess.PIPE, check=True).stdout
    lines = {effect["name"]: effect_line(effect) for effect in json.loads(listed)["effects"] if effect["parameters"]}
    models = {name: [line] for name, line in lines.items()} | {"all effects": list(lines.values())}
    differing = []
    with tempfile.TemporaryDirectory() as scratch:
        for number, (name, effects) in enumerate(models.items()):
            model = pathlib.Path(scratch) / f"{number}.yaml"
            model.write_text("\n".join(["touchstone: model/1", "name: same_bytes", "effects:", *effects, ""]), encoding="utf-8")
            one, other = (bytes_of(program, model, pathlib.Path(scratch) / f"{number}-{k}") for k, program in enumerate(programs))
            if one != other:
                differing.append(name)
                print(f"{name}: {one} and {other}")
    print(f"{len(models)} models, 120 touches and pictures each: {len(models) - len(differing)} passed, {len(differing)} differ")
    sys.exit(bool(differing))


if __name__ == "__main__":
    main()
