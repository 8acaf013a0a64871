"""The site: the Markdown of the project as one book with search.

    python3 -m venv target/site/venv
    target/site/venv/bin/pip install -r docs/site/requirements.txt
    target/site/venv/bin/sphinx-build -W --keep-going -q -j 2 -c docs/site . target/site/html

Open target/site/html/index.html; it needs no server and no network. `tests/run site` does all of it.
"""

import html
import pathlib
import re

from docutils import nodes
from latex2mathml.converter import convert

TOP = pathlib.Path(__file__).resolve().parents[2]
version = re.search(r'^version = "(.*)"', (TOP / "Cargo.toml").read_text(), re.M).group(1)

project = "flexspline"
html_title = f"flexspline {version}"
html_theme = "furo"
html_show_sphinx = False
html_show_copyright = False
html_copy_source = False
html_show_sourcelink = False
pygments_style = "friendly"
extensions = ["myst_parser"]
root_doc = "README"
include_patterns = [
    "*.md",
    "docs/**.md",
    "examples/**.md",
    "core/MUTANTS.md",
    "tests/**.md",
    "host-sim/fly/plant/README.md",
    "host-sim/report/web/README.md",
]
exclude_patterns = ["target", "out", "**/target", ".git", "**/node_modules", "**/corpus", "**/vendor"]
myst_enable_extensions = ["dollarmath"]
myst_fence_as_directive = ["math"]
myst_heading_anchors = 4
# Blocks of measured logs, drawings and results are no language.
suppress_warnings = ["misc.highlighting_failure"]

# The order of the book: heading, then folders and pages. Pages of a folder come by name.
BOOK = {
    "Start": ["docs/README", "docs/tutorial/*"],
    "How to": ["docs/how-to/*"],
    "Examples": ["examples/*/README", "examples/real_data"],
    "Reference": ["docs/reference/*", "docs/requirements", "docs/swe_134"],
    "Explanation": ["docs/explanation/*"],
    "Evidence": ["docs/evidence/README", "docs/evidence/*"],
    "The project": [
        "ARCHITECTURE",
        "CONTRIBUTING",
        "CHANGELOG",
        "tests/exam/README",
        "tests/c99/*",
        "tests/firmware/samples/README",
        "core/MUTANTS",
        "host-sim/fly/plant/README",
        "host-sim/report/web/README",
    ],
}


def as_myst(app, name, source):
    """GitHub's inline equations as MyST has them; the book's list of pages below the first one."""
    text = re.sub(r"\$`([^`]*)`\$", lambda found: f"${found.group(1)}$", source[0])
    if name == root_doc:
        for caption, pages in BOOK.items():
            rows = "\n".join(f"/{page}" for page in pages)
            text += f"\n```{{toctree}}\n:caption: {caption}\n:hidden:\n:glob:\n\n{rows}\n```\n"
    source[0] = text


def folders_as_text(app, page):
    """A link to a folder of the source leads nowhere on a site: its words stay."""
    for link in page.findall(nodes.Element):
        to = link.get("reftarget", "")
        if to and "://" not in to and (TOP / pathlib.Path(app.env.docname).parent / to).is_dir():
            link.replace_self(nodes.inline("", "", *link.children))


def mathml(display):
    def draw(self, node):
        self.body.append(convert(node.astext(), display=display))
        raise nodes.SkipNode

    return draw


def redirect(app, error):
    if error is None and app.builder.format == "html":
        page = f'<meta http-equiv="refresh" content="0; url={html.escape(root_doc)}.html">\n'
        pathlib.Path(app.outdir, "index.html").write_text(page)


def setup(app):
    app.connect("source-read", as_myst)
    app.connect("doctree-read", lambda app, page: folders_as_text(app, page), priority=1)
    app.connect("build-finished", redirect)
    app.add_html_math_renderer("mathml", (mathml("inline"), None), (mathml("block"), None))
    return {"parallel_read_safe": True, "parallel_write_safe": True}


html_math_renderer = "mathml"
