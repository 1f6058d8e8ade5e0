"""Version of the package and of the programs: CMake reads it here."""

__version__ = "0.2.0"
