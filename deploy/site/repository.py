"""The repository's own files as pages: its Markdown, the pictures in it, and the sources that it links to."""
import functools
import json
import os
import pathlib
import posixpath
import re
from typing import Optional

ROOT = pathlib.Path(__file__).resolve().parent.parent.parent
LEFT_OUT = {"build", "node_modules", "dist"}  # folders of what is made
# What documents no part of the program.
NO_PAGES = {"client/workbench/tests/data/README.md"}
PICTURES = {".png", ".svg", ".jpg", ".gif"}
LANGUAGES = {".cpp": "cpp", ".h": "cpp", ".py": "python", ".yaml": "yaml", ".txt": "cmake", ".proto": "protobuf"}

# A link or picture in Markdown, and in HTML within it; group 2 is the target.
TARGET = re.compile(r'(\]\(|(?:href|src)=")([^)"\s#]+)')


@functools.cache
def markdown_files() -> list[str]:
    """Every Markdown file but those of hidden folders, relative to the repository."""
    found = []
    for folder, folders, names in os.walk(ROOT):
        folders[:] = sorted(name for name in folders if name not in LEFT_OUT and not name.startswith("."))
        found += [pathlib.Path(folder, name).relative_to(ROOT).as_posix() for name in sorted(names) if name.endswith(".md")]
    return [path for path in found if path not in NO_PAGES]


def decisions() -> list[dict[str, str]]:
    """The navigation of server/decisions/, by the pages' titles."""
    paths = [path for path in markdown_files() if path.startswith("server/decisions/")]
    return [{(ROOT / path).read_text(encoding="utf-8").split("\n", 1)[0].lstrip("# "): path} for path in paths]


def target_path(page: str, target: str) -> Optional[str]:
    """The file or folder of the repository that a page links to; None for another site, or for what is not there."""
    if "://" in target:
        return None
    path = posixpath.normpath(posixpath.join(posixpath.dirname(page), target))
    return path if (ROOT / path).exists() else None


def linked_files(pages: list[str]) -> tuple[list[str], list[str]]:
    """The sources (files, and folders without a README) and the pictures that pages link to."""
    linked = set()
    for page in pages:
        text = (ROOT / page).read_text(encoding="utf-8")
        linked |= {path for _, target in TARGET.findall(text) if (path := target_path(page, target))}
    files = sorted(path for path in linked if not path.endswith(".md") and not (ROOT / path / "README.md").exists())
    pictures = [path for path in files if pathlib.Path(path).suffix in PICTURES]
    return [path for path in files if path not in pictures], pictures


def source_page(path: str) -> str:
    """Where the page of a source file stands."""
    return f"source/{path}.md"


def source_text(path: str) -> str:
    """A source file, a notebook or the names in a folder, as a page that the search leaves out."""
    head = f"---\nsearch: {{exclude: true}}\n---\n# {path}\n\n"
    if (ROOT / path).is_dir():
        return head + "".join(f"- `{file.name}`\n" for file in sorted((ROOT / path).iterdir()))
    text = (ROOT / path).read_text(encoding="utf-8")
    if path.endswith(".ipynb"):
        return head + "\n\n".join(_cell(cell) for cell in json.loads(text)["cells"])
    language = LANGUAGES.get(pathlib.Path(path).suffix, "text")
    return f"{head}````{language}\n{text.rstrip()}\n````\n"


def _cell(cell):
    text = "".join(cell["source"])
    # What a notebook says of the files beside it holds where it stands.
    return re.sub(r"\[([^\]]+)\]\([^)]+\)", r"\1", text) if cell["cell_type"] == "markdown" else f"```python\n{text}\n```"


def with_links_to_pages(markdown: str, page: str) -> str:
    """Links to sources lead to their pages, those to a folder to its README, and those in HTML to what becomes of Markdown."""

    def corrected(match):
        opening, target = match.groups()
        path = target_path(page, target)
        if path is None:
            return match.group()
        if opening.startswith("href"):
            target = re.sub(r"\.md$", ".html", re.sub(r"README\.md$", "index.md", target))
        elif (ROOT / path / "README.md").exists():
            target = posixpath.join(target, "README.md")
        elif pathlib.Path(path).suffix not in PICTURES | {".md"}:
            target = posixpath.relpath(source_page(path), posixpath.dirname(page) or ".")
        return opening + target

    return TARGET.sub(corrected, markdown)
