"""What can be mutated, and into what: the rules that C++ and Python share."""

import dataclasses
import hashlib
import re

# An operator: what it may become. Which of several is drawn with the site.
OPERATORS = {
    "<": ("<=", ">"), "<=": ("<", ">"), ">": (">=", "<"), ">=": (">", "<"), "==": ("!=",), "!=": ("==",),
    "+": ("-",), "-": ("+",), "*": ("/",), "/": ("*",), "+=": ("-=",), "-=": ("+=",), "*=": ("/=",), "/=": ("*=",),
    "&&": ("||",), "||": ("&&",), "and": ("or",), "or": ("and",),
}
_NUMBER = re.compile(r"(0[xX][0-9a-fA-F']+|0[bB][01']+|[0-9][0-9']*\.?[0-9']*(?:[eE][-+]?[0-9]+)?|\.[0-9]+(?:[eE][-+]?[0-9]+)?)"
                     r"([uUlLfF]*)")


@dataclasses.dataclass
class Site:
    """An expression at the bytes [begin, end) of a file. Operators: those at [operator_begin, operator_end) change.
    Constants: the whole does."""

    begin: int
    end: int
    operator_begin: int
    operator_end: int
    line: int
    original: str  # the operator or the constant
    changes: tuple  # what it may become


@dataclasses.dataclass
class Mutant:
    path: str  # from the root of the tree
    site: Site
    change: str  # what it becomes

    def texts(self, source):
        """(original, mutated) text of the expression."""
        site, change = self.site, self.change.encode()
        left, right = source[site.begin:site.operator_begin], source[site.operator_end:site.end]
        if left.strip():
            # Another operator may bind its operands less tightly.
            left, right = b"(" + left + b")", b"(" + right + b")"
        return source[site.begin:site.end], left + change + right


def changed_constant(text):
    """What a number may become; () where it cannot be read. A whole number grows by one, another by half, 0 becomes 1."""
    found = _NUMBER.fullmatch(text)
    if not found:
        return ()
    digits, suffix = found.group(1).replace("'", ""), found.group(2)
    if digits[:2].lower() in ("0x", "0b"):
        return (f"{int(digits, 0) + 1}{suffix}",)
    if re.search(r"[.eE]", digits):
        return (f"{float(digits) * 1.5 or 1.0!r}{suffix}",)
    # A leading 0 is octal in C++.
    value = int(digits, 8) if digits[0] == "0" else int(digits)
    return (f"{value + 1}{suffix}",)


def rank(seed, *words):
    """Files and sites are drawn in the order of this hash: the same seed draws mostly the same ones from two commits."""
    return hashlib.sha256("\0".join(map(str, (seed, *words))).encode()).hexdigest()


def in_drawn_order(seed, path, source, sites):
    """Mutants of a file, the one that is drawn first. A site is known by its line's text, not by where the line stands."""
    lines = source.split(b"\n")
    begins = [0]
    for line in lines:
        begins.append(begins[-1] + len(line) + 1)
    seen, ranked = {}, []
    for site in sites:
        text = lines[site.line - 1].strip().decode(errors="replace")
        column = site.operator_begin - begins[site.line - 1] - (len(lines[site.line - 1]) - len(lines[site.line - 1].lstrip()))
        key = (text, column, site.original)
        seen[key] = seen.get(key, 0) + 1
        order = rank(seed, path, *key, seen[key])
        ranked.append((order, Mutant(path, site, site.changes[int(order, 16) % len(site.changes)])))
    return [mutant for _, mutant in sorted(ranked, key=lambda pair: pair[0])]
