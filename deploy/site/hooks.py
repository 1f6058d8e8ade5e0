"""What MkDocs calls: adds the repository's own Markdown files, read where they stand, and the pages that are made."""
import pathlib
import sys

from mkdocs.structure.files import File

sys.path.insert(0, str(pathlib.Path(__file__).parent))
import commands
import effects
import protocol
import python_reference
import repository

MADE: dict[str, str] = {}  # path of a page -> its Markdown


def on_config(config):
    """Makes the pages and puts them into the navigation where it says '...NAME'."""
    MADE.clear()
    sections = {"commands": commands.pages(MADE), "python": python_reference.pages(MADE), "protocol": protocol.pages(MADE),
                "decisions": repository.decisions()}
    effects.pages(MADE)

    def filled(entries):
        for entry in entries:
            (title, target), = entry.items()
            if isinstance(target, list):
                yield {title: list(filled(target))}
            elif target == "...commands":
                yield {title: sections["commands"]}
            elif target.startswith("..."):
                yield {title: sections[target.removeprefix("...")]}
            else:
                yield entry

    config.nav = list(filled(config.nav))
    return config


def on_files(files, config):
    pages = repository.markdown_files()
    sources, pictures = repository.linked_files(pages)
    for path in pages + pictures:
        files.append(File(path, str(repository.ROOT), config.site_dir, use_directory_urls=False))
    for path in sources:
        files.append(File.generated(config, repository.source_page(path), content=repository.source_text(path)))
    for path, text in MADE.items():
        files.append(File.generated(config, path, content=text))
    return files


def on_page_markdown(markdown, page, **_):
    if page.file.src_uri == "README.md":
        page.meta["hide"] = ["navigation"]  # it has one entry
    elif page.file.src_uri.endswith("RESULTS.md"):
        page.meta["hide"] = ["toc"]  # its tables are wide
    return repository.with_links_to_pages(markdown, page.file.src_uri)
