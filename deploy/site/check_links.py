#!/usr/bin/env python3
"""Checks made pages: every link leads to a file and a place in it, and nothing is loaded from a network.

    deploy/site/check_links.py FOLDER
    deploy/site/check_links.py --self-test
"""
import functools
import html.parser
import pathlib
import sys
import tempfile
import urllib.parse


class _Page(html.parser.HTMLParser):
    """Names of places, and (line, target, whether it is loaded with the page) of links."""

    def __init__(self, text):
        super().__init__()
        self.names, self.links = set(), []
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        for key, value in attrs:
            if key == "id" or (tag == "a" and key == "name"):
                self.names.add(value)
            elif value and key in ("href", "src"):
                # <link rel="canonical"> and the like are said, not loaded; all other <link> and every src are.
                loaded = key == "src" or (tag == "link" and dict(attrs).get("rel") in ("stylesheet", "icon", "preload", "preconnect"))
                self.links.append((self.getpos()[0], value, loaded))


@functools.cache
def read(path):
    return _Page(path.read_text(encoding="utf-8"))


def check(folder):
    """'page:line: what is wrong' of every bad link, and how many links there are."""
    wrong, count = [], 0
    for path in sorted(folder.rglob("*.html")):
        for line, target, loaded in read(path).links:
            place, url = f"{path.relative_to(folder)}:{line}", urllib.parse.urlsplit(target)
            count += 1
            if url.scheme or url.netloc:
                if loaded and url.scheme != "data":
                    wrong.append(f"{place}: loaded from a network: {target}")
                continue
            aim = (path.parent / urllib.parse.unquote(url.path)).resolve() if url.path else path
            # The page of what is not found is shown at any address: its links are from the top.
            if path.name == "404.html" or target.startswith("/"):
                aim = (folder / urllib.parse.unquote(url.path).lstrip("/")).resolve()
            if not aim.is_file():
                wrong.append(f"{place}: leads nowhere: {target}")
            elif url.fragment and aim.suffix == ".html" and urllib.parse.unquote(url.fragment) not in read(aim).names:
                wrong.append(f"{place}: no such place: {target}")
    return wrong, count


def self_test():
    pages = {"index.html": '<a href="a/b.html#here">', "a/b.html": '<h2 id="here"></h2><img src="../p.png"><a href="https://x.org">', "p.png": ""}
    mistakes = {'<a href="a/c.html">': "leads nowhere", '<a href="a/b.html#there">': "no such place",
                '<script src="https://x.org/x.js">': "loaded from a network"}
    for mistake, said in [("", ""), *mistakes.items()]:
        with tempfile.TemporaryDirectory() as folder:
            for name, text in pages.items():
                pathlib.Path(folder, name).parent.mkdir(exist_ok=True)
                pathlib.Path(folder, name).write_text(text + (mistake if name == "index.html" else ""), encoding="utf-8")
            read.cache_clear()
            wrong, count = check(pathlib.Path(folder).resolve())
            if len(wrong) != bool(mistake) or said not in "".join(wrong) or count < 3:
                print(f"check_links: with '{mistake}' it says {wrong} of {count} links")
                return 1
    print(f"check_links: {len(mistakes)} mistakes found, no violation without them")
    return 0


def main():
    if sys.argv[1:] == ["--self-test"]:
        return self_test()
    if len(sys.argv) != 2 or not pathlib.Path(sys.argv[1]).is_dir():
        print("check_links: the folder of the pages was expected, or --self-test", file=sys.stderr)
        return 2
    folder = pathlib.Path(sys.argv[1]).resolve()
    wrong, count = check(folder)
    print("\n".join(wrong) if wrong else f"{len(list(folder.rglob('*.html')))} pages, {count} links, no violation: {folder}/index.html")
    return bool(wrong)


if __name__ == "__main__":
    sys.exit(main())
