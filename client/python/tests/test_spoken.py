"""Messages of Python calls name arguments, those of commands options."""

import pathlib
import re

import pytest

import touchstone
from touchstone.spoken import as_command, as_python

REPOSITORY = pathlib.Path(__file__).resolve().parents[3]


@pytest.mark.parametrize("said, spoken", [
    ("'mug' has no mesh; give it with --mesh mug=FILE or --mesh-dir FOLDER",
     """'mug' has no mesh; give it with meshes={"mug": FILE} or meshes=FOLDER"""),
    ("Name it as --mesh lat20=FILE,unit=m. Then", """Name it as meshes={"lat20": touchstone.Mesh(FILE, unit="m")}. Then"""),
    ("one finger's time (--noise 5000, in us)", "one finger's time (noise_us=5000)"),
    ("(`--save-model FILE --with-surface-map` keeps it)", "(with_surface_map=True keeps it)"),
    ("a token (--token-file, TOUCHSTONE_TOKEN)", "a token (token_file=FILE, TOUCHSTONE_TOKEN)"),
    ("a -- b and a--b", "a -- b and a--b"),
])
def test_an_option_becomes_the_argument(said, spoken):
    assert as_python(said) == spoken


def test_no_option_that_a_server_names_is_left():
    named = set()
    for folder in ("diagnosis", "dataset", "service/calls", "source"):
        for path in (REPOSITORY / "server" / folder).rglob("*.cpp"):
            for line in path.read_text(encoding="utf-8").splitlines():
                if not path.name.endswith("_test.cpp") and not line.lstrip().startswith("//"):
                    named.update(re.findall(r"(?<![\w-])--[a-z][a-z-]*", " ".join(re.findall(r'"((?:[^"\\]|\\.)*)"', line))))
    assert "--mesh" in named
    assert not [option for option in named if "--" in as_python(f"give {option} VALUE")]


def test_a_message_of_a_call_names_no_option(server, tmp_path):
    plan = touchstone.connect(server.target).plan(touchstone.faces(1, 1), "lat20")
    touchstone.write_measurements(tmp_path / "set.csv", [touchstone.Row(k, "mug", plan[k], (1.0, 2.0, 3.0)) for k in range(len(plan))])
    with pytest.raises(touchstone.NotFound, match=r"""'mug' has no mesh; give it with meshes=\{"mug": FILE\} or meshes=FOLDER"""):
        touchstone.connect(server.target).compare(tmp_path / "set.csv")


def test_a_message_of_a_command_names_its_options():
    assert as_command("a exists; replace it with force=True, or choose another name.") == "a exists; replace it with --force, or choose another name."
