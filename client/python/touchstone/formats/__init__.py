"""Datasets and measured sets in formats of other tools, and other tools' recordings as measured sets.

    touchstone export data --to lerobot -o data-lerobot
    touchstone import recording.mcap --map mapping.yaml -o set.csv

    from touchstone.formats import export
    export("data", "data-parquet", to="parquet")
    import_recording("recording.mcap", "set.csv", "mapping.yaml")

Needs the extra `touchstone-sim[formats]` (pyarrow, mcap, h5py, pillow, pyyaml, rosbags).
"""

from .exporting import FORMATS, Exported, export
from .importing import Imported, OpenQuestions, import_recording
from .recovery import Found, recover, verify

__all__ = ["FORMATS", "Exported", "Found", "Imported", "OpenQuestions", "export", "import_recording", "recover", "verify"]
