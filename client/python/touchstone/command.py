"""Commands of `touchstone` that are Python modules: their options, their help, how they end. The program hands a command on
to its module (client/cli/python_command.cpp), and `python -m MODULE` runs the same.

    def main(words: list[str]) -> None:
        parser = CommandParser("worth", "What a photograph is worth, in touches.", "touchstone worth set.csv --model m.yaml")
        ...
    if __name__ == "__main__":
        command.run(main)
"""

from __future__ import annotations

import argparse
import difflib
import re
import shutil
import signal
import sys
import textwrap
from collections.abc import Callable
from typing import Any, NoReturn

from .errors import InvalidRequest, NotFound, SourceUnreachable, TouchstoneError
from .printable import printable
from .spoken import as_command

# As client/cli/common/exit_code.h.
BAD_INPUT, UNREACHABLE, REFUSED, INTERRUPTED = 2, 3, 4, 130


def _columns() -> int:
    """Of standard output, or what COLUMNS says; at least 60; 110 where it is no terminal."""
    return max(60, shutil.get_terminal_size((110, 24)).columns)


def _fitted(example: str, columns: int) -> str:
    """An example, as the other commands show it: one that is too wide goes on after a backslash, its remark under it."""
    if len(example) + 2 <= columns or not sys.stdout.isatty():
        return f"  {example}\n"
    command, _, remark = example.partition("   ")
    lines = textwrap.wrap(command, columns - 4, subsequent_indent="    ", break_long_words=False, break_on_hyphens=False)
    return "  " + " \\\n  ".join(lines) + "\n" + (f"      # {remark.strip()}\n" if remark else "")


class _ExamplesFirst(argparse.HelpFormatter):
    """The layout of the help of every command: what it is, examples, usage, arguments, options."""

    def __init__(self, prog: str):
        # As wide as the texts of the other commands: from 60 to 110 columns. Texts begin at one column in every help.
        width = _columns()
        column = 6 if width < 70 else 26 if width < 100 else 32
        super().__init__(prog, max_help_position=column, width=min(110, width))
        self._action_max_length = column - 2

    def _format_action_invocation(self, action: argparse.Action) -> str:
        if not action.option_strings:
            return super()._format_action_invocation(action)
        if action.nargs == 0:
            return ",".join(action.option_strings)
        required = " (required)" if action.required else ""
        return f"{','.join(action.option_strings)} {self._format_args(action, action.dest.upper())}{required}"

    def add_usage(self, usage: str | None, actions: Any, groups: Any, prefix: str | None = None) -> None:
        names = [f"{action.metavar or action.dest.upper()}{'...' if action.nargs in ('*', '+') else ''}"
                 for action in actions if not action.option_strings]
        super().add_usage(" ".join([self._prog, "[OPTIONS]", *names]), actions, groups, "Usage: ")


class CommandParser(argparse.ArgumentParser):
    """A parser whose help and errors are those of the other commands; `examples`: one per line."""

    def __init__(self, name: str, description: str, examples: str):
        super().__init__(prog=f"touchstone {name}", description=description, formatter_class=_ExamplesFirst, allow_abbrev=False,
                         add_help=False)
        self._examples = examples.split("\n")
        self._positionals.title, self._optionals.title = "Arguments", "Options"
        self._output = self.add_argument_group("Output")
        self._output.add_argument("-h", "--help", action="help", help="This text")

    def add_output_options(self, *, force: bool = False) -> None:
        """--json and --quiet, and --force for a command that writes a file."""
        if force:
            self._output.add_argument("--force", action="store_true", help="Replace output files that exist")
        self._output.add_argument("--json", action="store_true", help="Machine-readable output; the names of numbers end in their unit")
        self._output.add_argument("-q", "--quiet", action="store_true", help="Nothing but errors on stderr")

    def format_help(self) -> str:
        described = self._get_formatter()
        described.add_text(self.description)
        rest = self._get_formatter()
        rest.add_usage(None, self._actions, self._mutually_exclusive_groups)
        for group in self._action_groups:
            rest.start_section(group.title)
            rest.add_arguments(group._group_actions)
            rest.end_section()
        shown = "".join(_fitted(line, _columns()) for line in self._examples)
        return f"{described.format_help()}\nExamples:\n{shown}\n{rest.format_help()}"

    def parse(self, words: list[str]) -> argparse.Namespace:
        options, left = self.parse_known_args(words)
        if left:
            unknown = [word for word in left if word.startswith("-")]
            if not unknown:
                self.error(f"'{left[0]}' is one argument too many")
            known = [name for action in self._actions for name in action.option_strings]
            self.error(f"unknown option '{unknown[0].partition('=')[0]}'{did_you_mean(unknown[0].partition('=')[0], known)}")
        return options

    def error(self, message: str) -> NoReturn:
        # argparse's own words, as those of the other commands.
        message = message.removeprefix("argument ")
        missing = message.removeprefix("the following arguments are required: ")
        _complain(f"{message if missing == message else missing + ' is required'} (see {self.prog} --help)")
        sys.exit(BAD_INPUT)


def whole_number(text: str) -> int:
    """A count or a seed as the other commands read it (server/base/text/whole_number.h): "1000", "1_000_000", "1e6"; from 0 to 2^64 - 1."""
    match = re.fullmatch(r"(\d+(?:_\d+)*)(?:\.(\d+))?(?:[eE]\+?(\d+))?", text, re.ASCII)
    fraction = (match[2] or "").rstrip("0") if match else ""
    exponent = int(match[3] or 0) - len(fraction) if match else -1
    if match is None or exponent < 0:
        raise argparse.ArgumentTypeError(f"'{text}' is no whole number from 0 on; one like 1000, 1_000 or 1e3 was expected")
    value: int = int(match[1] + fraction) * 10 ** min(exponent, 20)
    if value >= 2**64:
        raise argparse.ArgumentTypeError(f"'{text}' is too large; at most {2**64 - 1}")
    return value


def did_you_mean(word: str, known: list[str]) -> str:
    """", did you mean 'parquet'?", or what is known where nothing is near."""
    near = difflib.get_close_matches(word, known, 1, 0.6)
    return f", did you mean '{near[0]}'?" if near else f"; known: {', '.join(known)}"


def log(quiet: bool, line: str) -> None:
    """A line for people, on stderr."""
    if not quiet:
        print(printable(line), file=sys.stderr)


def _complain(message: str) -> None:
    sys.stdout.flush()
    print(f"touchstone: error: {printable(as_command(message))}", file=sys.stderr)


def run(main: Callable[[list[str]], object]) -> NoReturn:
    """Calls `main` with the words behind the program, and ends the process as every command ends: 0 done, 2 usage or bad input,
    3 source unreachable, 4 refused or failed, 130 interrupted."""
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        main(sys.argv[1:])
        sys.stdout.flush()
    except KeyboardInterrupt:
        sys.exit(INTERRUPTED)
    except BrokenPipeError:
        # Who read the output has enough of it; nothing is to be flushed at the end.
        sys.stderr.close()
        sys.exit(REFUSED)
    except TouchstoneError as error:
        _complain(str(error))
        sys.exit(BAD_INPUT if isinstance(error, (InvalidRequest, NotFound)) else
                 UNREACHABLE if isinstance(error, SourceUnreachable) else REFUSED)
    except OSError as error:
        _complain(f"{error.filename}: {error.strerror}" if error.filename else str(error))
        sys.exit(BAD_INPUT if isinstance(error, (FileNotFoundError, FileExistsError, IsADirectoryError, NotADirectoryError))
                 else REFUSED)
    sys.exit(0)
