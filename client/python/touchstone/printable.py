"""Text of sources, files and people, made fit for a terminal or a log: as `Printable` of server/base/text/printable.h."""

from __future__ import annotations

import unicodedata

# Control characters, invisible ones and those that turn the direction of what follows, line and paragraph separators, halves of pairs.
_UNPRINTABLE = frozenset({"Cc", "Cf", "Zl", "Zp", "Cs"})


def printable(text: str) -> str:
    r"""The text with such characters as \xHH, a byte of UTF-8 each; line ends stay."""
    return "".join(c if c == "\n" or unicodedata.category(c) not in _UNPRINTABLE
                   else "".join(f"\\x{byte:02x}" for byte in c.encode("utf-8", "surrogatepass")) for c in text)
