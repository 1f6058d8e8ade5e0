"""The switches of tests/mutation for Python; what mutant.h is for C++. Copied beside the mutated modules as _mutant.py."""

import os

_reached = set()


def on(number):
    if number not in _reached:
        _reached.add(number)
        path = os.environ.get("TOUCHSTONE_MUTANT_REACHED")
        if path:
            file = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o666)
            try:
                os.write(file, b"%d\n" % number)
            finally:
                os.close(file)
    return os.environ.get("TOUCHSTONE_MUTANT") == str(number)
