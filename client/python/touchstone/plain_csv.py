"""The text of a CSV file as spreadsheets and this package write it, for every reader of this package.

The rules are those of server/session/csv: UTF-8 or UTF-16, a first line "sep=;", commas, semicolons or tabs between the fields, a
decimal comma where commas do not separate, blank lines that are no rows, blanks round a field that are not part of it.
"""

from __future__ import annotations

import csv
import os
import re

from .errors import InvalidRequest
from .printable import printable

_SEPARATORS = ",;\t|"
_NAMES = ("object", "file")  # columns that hold no numbers
_POINT = re.compile(r"[+-]?(\d+\.\d*|\.\d+)([eE].*)?")
_COMMA = re.compile(r"[+-]?(\d*),(\d*)([eE].*)?")
_THOUSANDS = re.compile(r"[+-]?\d*(,\d*){2,}")


def read_csv(path: str | os.PathLike[str]) -> tuple[list[str], list[tuple[int, list[str]]]]:
    """(header, [(line, fields), ...]) of a file; every row has as many fields as the header.

    Raises:
      InvalidRequest: the file cannot be read, is no text, has no header, or a row has another number of fields.
    """
    try:
        with open(path, "rb") as file:
            return parse_csv(file.read(), os.fspath(path))
    except OSError as error:
        raise InvalidRequest(f"{os.fspath(path)}: {error.strerror}.") from None


def parse_csv(data: bytes, origin: str) -> tuple[list[str], list[tuple[int, list[str]]]]:
    """The same of a file's bytes; `origin` begins every error."""
    lines = _text(data, origin).replace("\r\n", "\n").replace("\r", "\n").split("\n")
    first, separator = 0, ""
    said = re.fullmatch(r'"?sep=(.)"?[,;\t]*', lines[0].strip("\ufeff "), re.IGNORECASE)
    if said:
        first, separator = 1, said[1]
    if first >= len(lines) or not lines[first].strip():
        raise InvalidRequest(f"{origin}:{first + 1}: a header line was expected (touch,object,...).")
    if separator not in lines[first] or not separator:
        separator = next((mark for mark in _SEPARATORS if mark in lines[first]), ",")
    header = _fields(lines[first], separator, f"{origin}:{first + 1}")
    rows = []
    for number, line in enumerate(lines[first + 1:], first + 2):
        if not line.strip():
            continue
        fields = _fields(line, separator, f"{origin}:{number}")
        if len(fields) != len(header):
            raise InvalidRequest(f"{origin}:{number}: {len(fields)} fields, but the header has {len(header)}.")
        rows.append((number, fields))
    return header, _with_points(header, rows, origin)


def _with_points(header: list[str], rows: list[tuple[int, list[str]]], origin: str) -> list[tuple[int, list[str]]]:
    """The rows with decimal points. A file whose commas may be decimal ones or part thousands is refused."""
    numbers = [at for at, name in enumerate(header) if name not in _NAMES]
    point = comma = either = ""
    for line, fields in rows:
        for at in numbers:
            field, place = fields[at], f"{origin}:{line}: {header[at]} is '{printable(fields[at])}', which has a comma"
            found = _COMMA.fullmatch(field)
            if _POINT.fullmatch(field):
                point = point or f"'{field}' (line {line}, column {header[at]})"
            elif _THOUSANDS.fullmatch(field) or (found and _may_part_thousands(*found.groups())):
                either = either or place
            elif found and found[1] + found[2]:
                comma = comma or place
    if (comma or either) and point:
        raise InvalidRequest(f"{comma or either}, but {point} a point; numbers with decimal points and without commas were expected, or all with "
                             "decimal commas.")
    if either and not comma:
        raise InvalidRequest(f"{either} that may be a decimal one or part thousands, as all commas of the file; numbers with decimal points and "
                             "without commas were expected.")
    if not comma:
        return rows
    return [(line, [field if header[at] in _NAMES else field.replace(",", ".") for at, field in enumerate(fields)]) for line, fields in rows]


def _may_part_thousands(whole: str, fraction: str, exponent: str | None) -> bool:
    return len(fraction) == 3 and 1 <= len(whole) <= 3 and not whole.startswith("0") and not exponent


def _text(data: bytes, origin: str) -> str:
    encoding = "utf-16" if data[:2] in (b"\xff\xfe", b"\xfe\xff") else "utf-8-sig"
    try:
        return data.decode(encoding)
    except UnicodeDecodeError:
        raise InvalidRequest(f"{origin} is not {encoding.upper()[:6].rstrip('-')} text.") from None


def _fields(line: str, separator: str, place: str) -> list[str]:
    try:
        [fields] = csv.reader([line], delimiter=separator, skipinitialspace=True, strict=True)
    except (csv.Error, ValueError) as error:
        raise InvalidRequest(f"{place}: {printable(str(error))}.") from None
    return [field.strip().replace("\u2212", "-") for field in fields]
