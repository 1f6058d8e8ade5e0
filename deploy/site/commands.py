"""Pages of the command line: what every program says with --help, as tables."""
import concurrent.futures
import os
import pathlib
import re
import subprocess

from markdown_text import cell, escaped

BIN = pathlib.Path(os.environ["TOUCHSTONE_BIN"])
MAX_UNBROKEN = 30
PROGRAMS = ["touchstone-server", "touchstone-gateway", "touchstone-probe", "touchstone-rig-emulator"]


def output_of(*words: str) -> str:
    done = subprocess.run([BIN / words[0], *words[1:]], capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise SystemExit(f"{' '.join(words)} ended with exit status {done.returncode}: {done.stderr.strip()}")
    return done.stdout


def pages(made: dict[str, str]) -> list:
    """Adds a page for every command of `touchstone` and for every other program; returns their navigation."""
    called = [line.split() for line in output_of("touchstone", "man", "--list").splitlines()]
    with concurrent.futures.ThreadPoolExecutor(os.cpu_count()) as pool:
        helps = list(pool.map(lambda words: output_of("touchstone", "help", *words[1:]), called))
        others = list(pool.map(lambda program: output_of(program, "--help"), PROGRAMS))
    navigation: list = []
    for words, text in zip(called, helps):
        path = f"commands/{'-'.join(words[1:]) or 'index'}.md"
        made[path] = page_of(" ".join(words), text)
        if len(words) < 3:
            navigation.append({" ".join(words[1:]) or "touchstone": path})
        else:  # a command of a group: the group's own page comes first
            (group, inside), = navigation[-1].items()
            navigation[-1] = {group: (inside if isinstance(inside, list) else [inside]) + [{words[2]: path}]}
    for program, text in zip(PROGRAMS, others):
        path = f"commands/{program}.md"
        made[path] = page_of(program, text)
        navigation.append({program: path})
    return navigation


def page_of(name: str, text: str) -> str:
    """`text` is help: paragraphs, then sections of entries, each with its name on the left and its text on the right."""
    lines = [f"# {name}", ""]
    for title, body in sections(text):
        if title == "":
            lines += [escaped(body), ""]
        elif title == "Usage":
            lines += ['```text title="Usage"', body, "```", ""]
        elif title == "Examples":
            lines += ["## Examples", "", "```sh", body, "```", ""]
        else:
            names = {"Commands": "Command", "Arguments": "Argument", "Positionals": "Argument"}
            lines += [f"## {title}", "", f"| {names.get(title, 'Option')} | |", "| --- | --- |"]
            for left, right in entries(body):
                # A long name may be broken between its words alone.
                words = left.split() if len(left) > MAX_UNBROKEN else [left]
                shown = " ".join(f"`{word}`" for word in words).replace("|", "\\|")
                if title == "Commands":
                    shown = f"[{shown}]({'' if name == 'touchstone' else name.rsplit(maxsplit=1)[-1] + '-'}{left}.md)"
                lines.append(f"| {shown} | {cell(right)} |")
            lines.append("")
    return "\n".join(lines)


def sections(text: str):
    """(title, text) of each part; "" for paragraphs. Usage is a line of its own, Examples keep their lines."""
    title, body = "", []
    for line in text.splitlines():
        usage = line.removeprefix("Usage: ")
        begins = re.fullmatch(r"([A-Z][A-Za-z ]*):", line)
        # After a section, what stands at the left again is a paragraph.
        paragraph = title not in ("", "Usage") and line and not line.startswith(" ")
        if usage != line or begins or paragraph or (title == "Usage" and body):
            if "".join(body).strip():
                yield title, joined(title, body)
            title, body = ("Usage", [usage]) if usage != line else (begins.group(1), []) if begins else ("", [line])
        else:
            body.append(line)
    if "".join(body).strip():
        yield title, joined(title, body)


def joined(title, body):
    if title == "Examples":
        # What stands behind a command is a remark, which a shell must not be given.
        return "\n".join(re.sub(r"(\S\s{2,})(?=[^#\s])(.*)", r"\1# \2", line.removeprefix("  ")) for line in body).strip("\n")
    return "\n".join(body).strip("\n")


def entries(body: str):
    """(name, text) of each entry of a section: a name after two blanks, its text behind it or further in below."""
    found: list[list[str]] = []
    for line in body.splitlines():
        if re.match(r"  \S", line):
            left, _, right = line.strip().partition("  ")
            found.append([left, right.strip()])
        elif line.strip() and found:
            found[-1][1] = f"{found[-1][1]} {line.strip()}".strip()
    return found
