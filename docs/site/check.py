#!/usr/bin/env python3
"""What the generator does not see: check.py lines FILE.md…   |   check.py links FOLDER

lines: no line of prose is longer than 100 characters; rows of tables, lone links and blocks of code may be.
links: each link of the built site leads to a file in it, and each anchor to an element of that file.
"""

import pathlib
import sys
from html.parser import HTMLParser
from urllib.parse import unquote, urlsplit

WIDTH = 100


def long_lines(files):
    for file in files:
        code = False
        for number, line in enumerate(pathlib.Path(file).read_text(encoding="utf-8").splitlines(), 1):
            code ^= line.lstrip().startswith("```")
            # A table cannot be wrapped, nor can what has no blank.
            whole = line.lstrip().startswith("|") or " " not in line.strip(" -*>")
            if len(line) > WIDTH and not whole and not code:
                yield f"{file}:{number}: {len(line)} characters, at most {WIDTH}"


class Page(HTMLParser):
    def __init__(self, text):
        super().__init__()
        self.links, self.ids = [], set()
        self.feed(text)

    def handle_starttag(self, tag, attributes):
        for name, value in attributes:
            if name == "id" or (tag == "a" and name == "name"):
                self.ids.add(value)
            elif name in ("href", "src") and value:
                self.links.append(value)


def dead_links(folder):
    top = pathlib.Path(folder).resolve()
    # An anchor may be in a page that is no page of the book, such as the search.
    pages = {file: Page(file.read_text(encoding="utf-8")) for file in top.rglob("*.html")}
    if not any(page.links for page in pages.values()):
        yield f"{folder}: no link at all"
    for file, page in sorted(pages.items()):
        for link in page.links:
            parts = urlsplit(link)
            if parts.scheme or parts.netloc:
                continue
            to = (file.parent / unquote(parts.path)).resolve() if parts.path else file
            anchor = unquote(parts.fragment)
            if not to.is_file() or top not in to.parents:
                yield f"{file.relative_to(top)}: {link} does not exist"
            elif anchor and to in pages and anchor not in pages[to].ids:
                yield f"{file.relative_to(top)}: {link}: no such anchor"


def main(what, *rest):
    found = list({"lines": long_lines, "links": lambda it: dead_links(*it)}[what](rest))
    print(*found, f"{what}: {len(found)} found", sep="\n")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
