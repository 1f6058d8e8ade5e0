"""Pages of the protocol: services, messages and enums with the comments of their .proto files."""
import pathlib
import re
import subprocess
import tempfile

from google.protobuf import descriptor_pb2

import repository
from markdown_text import cell, escaped

FOLDER = "touchstone/v1"
_FIELD = descriptor_pb2.FieldDescriptorProto
SCALARS = {number: name.removeprefix("TYPE_").lower() for name, number in _FIELD.Type.items()}


def pages(made: dict[str, str]) -> list:
    """Adds a page for every .proto file; returns their navigation."""
    files = descriptors()
    homes: dict[str, str] = {}  # full name of a type -> page
    for file in files:
        for kind in ("message_type", "enum_type"):
            for one in getattr(file, kind):
                _note(one, f".{file.package}", page_of(file.name), homes)
    navigation = []
    for file in sorted(files, key=lambda file: (not file.service, file.name)):
        made[page_of(file.name)] = _Page(file, homes).text()
        navigation.append({pathlib.Path(file.name).name: page_of(file.name)})
    return navigation


def page_of(file: str) -> str:
    return f"protocol/{pathlib.Path(file).stem}.md"


def _note(one, above, page, homes):
    homes[f"{above}.{one.name}"] = page
    if isinstance(one, descriptor_pb2.DescriptorProto):
        for inner in [*one.nested_type, *one.enum_type]:
            _note(inner, f"{above}.{one.name}", page, homes)


def descriptors():
    sources = sorted((repository.ROOT / "proto" / FOLDER).glob("*.proto"))
    with tempfile.TemporaryDirectory() as folder:
        written = pathlib.Path(folder, "set")
        subprocess.run(["protoc", f"--proto_path={repository.ROOT / 'proto'}", "--include_source_info",
                        f"--descriptor_set_out={written}", *sources], check=True)
        return list(descriptor_pb2.FileDescriptorSet.FromString(written.read_bytes()).file)


class _Page:
    """Markdown of one file. Comments are found by the path of what they belong to, as protoc numbers it."""

    def __init__(self, file, homes):
        self._file, self._homes = file, homes
        self._comments = {tuple(place.path): place for place in file.source_code_info.location}
        self._lines = []

    def text(self):
        file = self._file
        self._lines = [f"# {pathlib.Path(file.name).name}", "", escaped(self._head()), ""]
        for i, service in enumerate(file.service):
            self._service(service, (6, i))
        for i, message in enumerate(file.message_type):
            self._message(message, (4, i), f".{file.package}")
        for i, enum in enumerate(file.enum_type):
            self._enum(enum, (5, i), f".{file.package}")
        return "\n".join(self._lines)

    def _head(self):
        """The comment at the head of the file, in front of `syntax`."""
        place = self._comments.get((12,))
        return _paragraphs(place.leading_comments) if place else ""

    def _comment(self, path):
        place = self._comments.get(path)
        return _paragraphs(f"{place.leading_comments}\n{place.trailing_comments}") if place else ""

    def _service(self, service, path):
        self._lines += [f"## service {service.name} {{#{service.name}}}", "", escaped(self._comment(path)), "",
                        "| Call | Request | Answer | |", "| --- | --- | --- | --- |"]
        for i, method in enumerate(service.method):
            stream = ["stream " if streams else "" for streams in (method.client_streaming, method.server_streaming)]
            self._lines.append(f"| `{method.name}` | {stream[0]}{self._link(method.input_type)} | {stream[1]}{self._link(method.output_type)} | "
                               f"{cell(self._comment((*path, 2, i)))} |")
        self._lines.append("")

    def _message(self, message, path, above):
        name = f"{above}.{message.name}"
        if message.options.map_entry:
            return
        self._heading(name, path)
        if message.field:
            self._lines += ["| Field | Type | No. | |", "| --- | --- | --- | --- |"]
        maps = {f"{name}.{inner.name}": inner for inner in message.nested_type if inner.options.map_entry}
        for i, field in enumerate(message.field):
            comment = cell(self._comment((*path, 2, i)))
            if field.HasField("oneof_index") and not field.proto3_optional:
                comment = f"*One of `{message.oneof_decl[field.oneof_index].name}`.* {comment}"
            self._lines.append(f"| `{field.name}` | {self._type(field, maps)} | {field.number} | {comment} |")
        self._lines.append("")
        for i, inner in enumerate(message.nested_type):
            self._message(inner, (*path, 3, i), name)
        for i, inner in enumerate(message.enum_type):
            self._enum(inner, (*path, 4, i), name)

    def _enum(self, enum, path, above):
        self._heading(f"{above}.{enum.name}", path)
        self._lines += ["| Value | No. | |", "| --- | --- | --- |"]
        for i, value in enumerate(enum.value):
            self._lines.append(f"| `{value.name}` | {value.number} | {cell(self._comment((*path, 2, i)))} |")
        self._lines.append("")

    def _heading(self, name, path):
        short = name.removeprefix(f".{self._file.package}.")
        self._lines += [f"## {short} {{#{short}}}", "", escaped(self._comment(path)), ""]

    def _type(self, field, maps):
        if field.type_name in maps:
            key, value = maps[field.type_name].field
            return f"map of {self._type(key, {})} to {self._type(value, {})}"
        many = {_FIELD.LABEL_REPEATED: "repeated "}.get(field.label, "optional " if field.proto3_optional else "")
        return many + (self._link(field.type_name) if field.type_name else SCALARS[field.type])

    def _link(self, name):
        """A type's name that leads to it; other packages' types are named whole."""
        if name not in self._homes:
            return f"`{name.lstrip('.')}`"
        short = name.removeprefix(f".{self._file.package}.")
        return f"[{short}]({pathlib.Path(self._homes[name]).name}#{short})"


def _paragraphs(comment: str) -> str:
    """A comment's lines joined, but where they are indented as a formula is."""
    lines = [re.sub(r"^ ", "", line) for line in comment.strip("\n").splitlines()]
    return "\n".join(lines).strip()
