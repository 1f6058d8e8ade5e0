"""Mutation sites of C++ files, found with libclang (Debian: python3-clang-14), and whether a mutant compiles."""

import os
import re

import sites
from clang import cindex
from clang.cindex import CursorKind as Kind

INCLUDE = b'#include "tests/mutation/mutant.h"\n#line 1\n'
_OPERATIONS = (Kind.BINARY_OPERATOR, Kind.COMPOUND_ASSIGNMENT_OPERATOR, Kind.CALL_EXPR)
_CONSTANTS = (Kind.INTEGER_LITERAL, Kind.FLOATING_LITERAL)
# Where values must be known to the compiler, or are not computed; and default arguments.
_LEFT_OUT = (Kind.ENUM_DECL, Kind.STATIC_ASSERT, Kind.PARM_DECL, Kind.TEMPLATE_NON_TYPE_PARAMETER,
             Kind.TEMPLATE_TYPE_PARAMETER, Kind.CXX_UNARY_EXPR, Kind.TYPE_ALIAS_DECL, Kind.TYPEDEF_DECL)
_DECLARATIONS = (Kind.VAR_DECL, Kind.FUNCTION_DECL, Kind.CXX_METHOD, Kind.CONSTRUCTOR, Kind.FUNCTION_TEMPLATE,
                 Kind.CONVERSION_FUNCTION)


def compiler_flags(command):
    """The flags for libclang of a command of compile_commands.json, without compiler, output and source."""
    flags, words = [], iter(command)
    for word in words:
        if word in ("-o", "-MF", "-MT"):
            next(words)
        elif re.match(r"-(I|D|U|std=|isystem|m|f|include)", word):
            flags.append(word)
            if word in ("-I", "-isystem", "-include"):
                flags.append(next(words))
    return flags


class File:
    """A C++ file, read as part of `unit`: the file itself, or for a header a source file that includes it."""

    def __init__(self, path, unit, flags):
        self.path, self._unit = os.path.abspath(path), os.path.abspath(unit)
        with open(path, "rb") as file:
            self.source = file.read()
        options = cindex.TranslationUnit.PARSE_PRECOMPILED_PREAMBLE | 0x100  # with the preamble made by the first parse
        self._parsed = cindex.Index.create().parse(self._unit, args=["-xc++", *flags], options=options,
                                                   unsaved_files=[(self.path, INCLUDE + self.source)])
        self.errors = self._errors()
        self._sites = {}  # found now: what compiles() reads takes the place of what was read
        for cursor in self._parsed.cursor.get_children():
            if cursor.location.file and cursor.location.file.name == self.path:
                self._walk(cursor)

    def _errors(self):
        return [str(found) for found in self._parsed.diagnostics if found.severity >= cindex.Diagnostic.Error]

    def compiles(self, number, mutant):
        self._parsed.reparse(unsaved_files=[(self.path, mutated(self.source, number, mutant))])
        return not self._errors()

    def sites(self):
        return [self._sites[place] for place in sorted(self._sites)]

    def _text(self, begin, end):
        """Of the file as it was parsed, with INCLUDE."""
        return self.source[max(begin - len(INCLUDE), 0):max(end - len(INCLUDE), 0)]

    def _walk(self, cursor):
        if self._left_out(cursor):
            return
        site = None
        if cursor.kind in _OPERATIONS:
            site = self._operation(cursor)
        elif cursor.kind in _CONSTANTS:
            site = self._constant(cursor)
        if site:
            self._sites.setdefault((site.operator_begin, site.operator_end), site)
        children = list(cursor.get_children())
        # A label's value, and what `if constexpr` asks.
        if cursor.kind == Kind.CASE_STMT or (cursor.kind == Kind.IF_STMT and b"constexpr" in self._text(
                cursor.extent.start.offset, cursor.extent.start.offset + 14)):
            children = children[1:]
        for child in children:
            self._walk(child)

    def _left_out(self, cursor):
        if cursor.kind in _LEFT_OUT:
            return True
        if cursor.kind not in _DECLARATIONS:
            return False
        # The specifiers stand before the name.
        return re.search(rb"\bconst(expr|init)\b", self._text(cursor.extent.start.offset, cursor.location.offset)) is not None

    def _operation(self, cursor):
        operands = list(cursor.get_arguments() if cursor.kind == Kind.CALL_EXPR else cursor.get_children())
        if len(operands) != 2 or (cursor.kind == Kind.CALL_EXPR and not cursor.spelling.startswith("operator")):
            return None
        begin, end = operands[0].extent.end.offset, operands[1].extent.start.offset
        between = self._text(begin, end)
        operator = between.strip().decode(errors="replace")
        changes = sites.OPERATORS.get(operator)
        if not changes:
            return None  # another operator, a comment beside it, or the inside of a macro
        at = begin + between.index(operator.encode())
        return self._site(cursor, at, at + len(operator), operator, changes)

    def _constant(self, cursor):
        begin, end = cursor.extent.start.offset, cursor.extent.end.offset
        text = self._text(begin, end).decode(errors="replace")
        changes = sites.changed_constant(text)
        if not changes or re.match(rb"[\w.]", self._text(end, end + 1)):
            return None
        return self._site(cursor, begin, end, text, changes)

    def _site(self, cursor, operator_begin, operator_end, original, changes):
        begin, end = cursor.extent.start.offset, cursor.extent.end.offset
        if not begin <= operator_begin < operator_end <= end or begin < len(INCLUDE):
            return None
        shift = len(INCLUDE)
        return sites.Site(begin - shift, end - shift, operator_begin - shift, operator_end - shift,
                          self.source.count(b"\n", 0, operator_begin - shift) + 1, original, changes)


def mutated(source, number, mutant):
    """The file with both ways of the expression; lines keep their numbers."""
    original, changed = mutant.texts(source)
    both = b"(::touchstone_mutant::On(%d) ? (%s) : (%s))" % (number, changed, original)
    return INCLUDE + source[:mutant.site.begin] + both + source[mutant.site.end:]
