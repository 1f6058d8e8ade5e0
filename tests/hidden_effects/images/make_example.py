#!/usr/bin/env python3
"""Writes an image set with hidden effects, its meshes and the nominal model: for the demo and for README's picture.

    build/venv/bin/python tests/hidden_effects/images/make_example.py FOLDER     makes FOLDER/photographs, FOLDER/meshes, ...

The pictures are rendered by this benchmark's oracle, which shares no code with the product. They are no photographs.
"""
import argparse
import pathlib

import sets

HIDDEN = {"exposure": 0.25, "radial_distortion": (-0.15, 0.0)}  # stops; k1, k2


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=pathlib.Path, help="is made if it is not there")
    folder = parser.parse_args().folder
    scene = sets.make_scene(20, pictures=7, repeats=2)
    truth = sets.Truth("example", scene.seed, effects=HIDDEN)
    physics = sets.make_physics(HIDDEN)
    sets.write_set(sets.make_files(scene, truth, lambda number: physics), folder / "photographs")
    sets.write_meshes(folder / "meshes")
    sets.write_model(folder / "nominal.yaml")


if __name__ == "__main__":
    main()
