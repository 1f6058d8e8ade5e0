"""Version of the package; it moves with the server's."""

__version__ = "0.1.0"
