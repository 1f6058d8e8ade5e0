"""What a server says names the options of the command line, and what this package says its arguments: each in the other's words."""

from __future__ import annotations

import re

# An option with its value, as Python takes it. What is not here is the argument of the option's name.
_AS_ARGUMENTS = (
    (r"--mesh ([^\s=`]+)=FILE((?:,\w+=\w+(?:\.\d+)?)+)", lambda found: f'meshes={{"{found[1]}": touchstone.Mesh(FILE, {_options(found[2])})}}'),
    (r"--mesh ([^\s=`]+)=FILE", lambda found: f'meshes={{"{found[1]}": FILE}}'),
    (r"--mesh-dir (?:FOLDER|DIR)", "meshes=FOLDER"),
    (r"--noise (\d+), in us", r"noise_us=\1"),
    (r"`touchstone diagnose SET --json FILE`|`touchstone diagnose --json`", "client.diagnose(), or the file that its save() wrote,"),
    (r"touchstone stream --uncertainty REPORT", "uncertainty=REPORT"),
    (r"`--save-model FILE --with-surface-map`", "with_surface_map=True"),
    (r"--token-file", "token_file=FILE"),
    (r"--tls-cert and --tls-key", "cert=FILE and key=FILE"),
    (r"--([a-z][a-z-]*)", lambda found: found[1].replace("-", "_")),
)
# The arguments that a command of this package hands on, as options.
_AS_OPTIONS = (("force=True", "--force"), ("mapping=FILE", "--map FILE"))


def _options(text: str) -> str:
    """",unit=m,scale=2" as arguments of Mesh."""
    pairs = (one.partition("=")[::2] for one in text.strip(",").split(","))
    return ", ".join(f"{name}={value}" if name == "scale" else f'{name}="{value}"' for name, value in pairs)


def as_python(text: str) -> str:
    """What a server says of a call, with the arguments of this package in the place of options of the command line."""
    if "--" not in text:
        return text
    for option, argument in _AS_ARGUMENTS:
        # Only whole options: "a--b" is no option.
        text = re.sub(rf"(?<![\w-]){option}", argument, text) if option.startswith("--") else re.sub(option, argument, text)
    return text


def as_command(text: str) -> str:
    """What this package says, with options of the command line in the place of its arguments."""
    for argument, option in _AS_OPTIONS:
        text = text.replace(argument, option)
    return text
