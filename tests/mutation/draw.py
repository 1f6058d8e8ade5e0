"""Which mutants: files at random, in each file a site at random that compiles both ways."""

import concurrent.futures
import dataclasses

import sites

_TRIES = 12  # sites of a file that do not compile before another file is drawn


def _draw_in(tree, seed, path, unit):
    file = tree.cpp_file(path, unit) if unit else tree.python_file(path)
    if unit and file.errors:
        return None, f"{path}: not read: {file.errors[0]}"
    found = sites.in_drawn_order(seed, path, file.source, file.sites())
    for mutant in found[:_TRIES]:
        if file.compiles(0, mutant):
            return mutant, None
    return None, f"{path}: none of {len(found)} sites" if found else None


def draw(tree, seed, count, left_out=(), under=""):
    """(mutants, notes). At most one in a file; Python's share of them is its share of the lines. `left_out`: files; `under`:
    what the paths begin with."""
    cpp = {path: unit for path, unit in tree.product_files().items() if path.startswith(under)}
    python = [path for path in tree.python_files() if path.startswith(under)]
    python_count = round(count * tree.lines(python) / (tree.lines(python) + tree.lines(cpp)))
    mutants, notes = [], []
    with concurrent.futures.ProcessPoolExecutor(2) as pool:
        for files, wanted in ((cpp, count - python_count), (dict.fromkeys(python), python_count)):
            order = sorted(set(files) - set(left_out), key=lambda path: sites.rank(seed, path))
            drawn = []
            while order and len(drawn) < wanted:
                # No more than are needed, so that nothing depends on the number of processes.
                now, order = order[:wanted - len(drawn)], order[wanted - len(drawn):]
                for mutant, note in pool.map(_draw_in, *zip(*((tree, seed, path, files[path]) for path in now))):
                    drawn += [mutant] if mutant else []
                    notes += [note] if note else []
            mutants += drawn
    return mutants, notes


def as_json(mutant):
    return dataclasses.asdict(mutant)


def from_json(values):
    return sites.Mutant(values["path"], sites.Site(**{**values["site"], "changes": tuple(values["site"]["changes"])}), values["change"])
