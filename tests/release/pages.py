#!/usr/bin/env python3
"""Pages and examples as an archive of a release has them: pages.py VERSION TARGET FOLDER, from the top of the project

Whoever has the archive has no source: `cargo run --release --` becomes the command, a link to what is not in the archive becomes the name of
the file in the source archive, and a line of the list of pages whose page is not there goes. Fails where a link still leads nowhere.
"""

import os
import re
import shutil
import subprocess
import sys

# What is of use without the source. Left out are pages for whoever changes the program, and examples that cargo builds.
SHIPPED = ("docs/", "examples/", "core/include/", "core/c99/", "tests/firmware/samples/", "host-sim/report/web/report.png", "CHANGELOG.md", "LICENSE")
LEFT_OUT = ("docs/how-to/add_a_", "docs/how-to/release.md", "examples/antenna_", "examples/learning_c")
LINK = re.compile(r"(!?)\[([^\]]*)\]\(([^)\s]+)\)")
FENCE = re.compile(r"^\s*```")


def shipped(path):
    return path.startswith(SHIPPED) and not path.startswith(LEFT_OUT)


def target_of(page, link):
    """The file of the project that a link leads to, or none if it leads elsewhere."""
    if "://" in link or link.startswith(("#", "mailto:")):
        return None
    return os.path.normpath(os.path.join(os.path.dirname(page), link.split("#")[0]))


def for_archive(page, text, there):
    def link(found):
        picture, words, to = found.groups()
        path = target_of(page, to)
        if path is None or path in there or any(file.startswith(path + "/") for file in there):
            return found.group(0)
        return "" if picture else f"{words} (`{path}` of the source)"

    lines = []
    fenced = False
    for line in text.splitlines():
        fenced ^= bool(FENCE.match(line))
        line = line.replace("cargo run --release -- ", "flexspline ")
        if not fenced:
            leads = [target_of(page, found.group(3)) for found in LINK.finditer(line)]
            if page == "docs/README.md" and leads and all(path is not None and path not in there for path in leads):
                continue
            line = LINK.sub(link, line)
        lines.append(line)
    return "\n".join(lines) + "\n"


def dead_links(folder):
    for where, _, names in os.walk(folder):
        for name in names:
            if not name.endswith(".md"):
                continue
            page = os.path.relpath(os.path.join(where, name), folder)
            with open(os.path.join(where, name), encoding="utf-8") as file:
                for found in LINK.finditer(file.read()):
                    path = target_of(page, found.group(3))
                    if path is not None and not os.path.exists(os.path.join(folder, path)):
                        yield f"{page}: {found.group(3)}"


def main(version, target, folder):
    tracked = subprocess.run(["git", "ls-files"], capture_output=True, text=True, check=True).stdout.split("\n")
    files = [path for path in tracked if shipped(path)]
    there = {*files, "README.md"}
    for path in files:
        to = os.path.join(folder, path)
        os.makedirs(os.path.dirname(to), exist_ok=True)
        if path.endswith(".md"):
            with open(path, encoding="utf-8") as page, open(to, "w", encoding="utf-8") as made:
                made.write(for_archive(path, page.read(), there))
        else:
            shutil.copy(path, to)
    with open("tests/release/README.in", encoding="utf-8") as page, open(os.path.join(folder, "README.md"), "w", encoding="utf-8") as made:
        made.write(page.read().replace("@VERSION@", version).replace("@TARGET@", target))
    dead = list(dead_links(folder))
    for link in dead:
        print(f"{folder}: dead link in {link}", file=sys.stderr)
    return 1 if dead else 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
