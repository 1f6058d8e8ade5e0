"""What one run of the experiments is asked for."""

from __future__ import annotations

import dataclasses
import pathlib

SUPERSHAPES = ("lat00", "lat05", "lat10", "lat15", "lat20")


@dataclasses.dataclass(frozen=True)
class Settings:
    """Attributes:
      out: folder of report, figures and what was measured.
      quick: small sets, few seeds: minutes instead of hours.
      seeds: repetitions of everything that is random; intervals are over them.
      seed: the first of them.
      server: HOST:PORT of the simulator; "": one of its own.
      rig: HOST:PORT of a gateway; "": an emulated rig of its own.
      rig_is_real: the gateway's arm is one of metal; nothing else may be called measured without "emulated".
      backbone: ONNX file of an image network without its last layer or with it; None: images are left out.
      everyday: folder of the ten everyday meshes; None: other objects take their place.
    """

    out: pathlib.Path
    quick: bool = False
    seeds: int = 10
    seed: int = 1
    server: str = ""
    rig: str = ""
    rig_is_real: bool = False
    backbone: pathlib.Path | None = None
    everyday: pathlib.Path | None = None

    @property
    def runs(self) -> range:
        """The seeds themselves."""
        return range(self.seed, self.seed + self.seeds)

    def pick(self, quick, full):
        """The first for a quick run, the second for a whole one."""
        return quick if self.quick else full

    @property
    def measured_kind(self) -> str:
        """What reports call the data of the gateway."""
        return "measured" if self.rig_is_real else "emulated"
