"""Experiments of recognition by touch and sight, as clients of Touchstone: `python -m touchstone.training all`."""
