"""One experiment a file: EXPERIMENT says what it is, its run() does it."""
