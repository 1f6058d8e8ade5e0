"""Is a better model worth it for a recogniser? On a measured set and a recogniser of the user's; see worth()."""

from .experiment import worth
from .intervals import Exchange
from .recogniser import FileError
from .result import Step, Worth

__all__ = ["Exchange", "FileError", "Step", "Worth", "worth"]
