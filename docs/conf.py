"""Sphinx configuration of the documentation site: `make docs`.

The pages are the repository's own Markdown files at their own paths, so that a relative link works on disk, on GitHub and on
the site. Nothing is loaded from another site: no fonts, no scripts.
"""

import re
import shutil
import subprocess
import sys
import textwrap
from os.path import normpath
from pathlib import Path, PurePosixPath
from urllib.parse import unquote

from docutils import nodes
from sphinx import addnodes
from sphinx.application import Sphinx
from sphinx.util import logging

import posture  # noqa: F401  the package `envs` of this repository is then imported, not another one

ROOT = Path(__file__).resolve().parents[1]

project = "posture"
copyright = "The posture authors, BSD-3-Clause"
extensions = ["myst_nb", "sphinx.ext.autodoc", "sphinx.ext.viewcode"]
root_doc = "README"
include_patterns = [
    "README.md",
    "CHANGELOG.md",
    "docs/*.md",
    "docs/api/*.md",
    "docs/notebooks/*.ipynb",
    "results/reproduction/summary.md",
    "results/lqr/table.md",
]
exclude_patterns = [".*", "build", "runs"]  # folders that are not searched

NAVIGATION = {
    "Start": [
        "Overview <self>",
        "docs/introduction",
        "docs/notebooks/switch",
        "docs/people",
        "docs/notebooks/people",
        "docs/commands",
        "docs/gallery",
    ],
    "Findings": ["docs/results", "results/reproduction/summary", "docs/reproduction", "results/lqr/table"],
    "Background": [
        "docs/task",
        "docs/bodies",
        "docs/many_bodies",
        "docs/human",
        "docs/physics",
        "docs/theory",
        "docs/learning",
    ],
    "Operation": ["docs/training", "docs/speed", "docs/scale", "docs/gymnasium", "docs/export", "docs/robustness"],
    "Development": ["docs/architecture", "docs/api/index", "CHANGELOG"],
}
"""The navigation: parts and their pages, in order."""
TITLES = {"results/lqr/table": "The model-based controller"}
"""Titles of pages that have none."""

highlight_language = "text"  # unless a block names another

html_theme = "furo"
html_title = "posture"
html_copy_source = False
html_show_sourcelink = False
html_theme_options = {"footer_icons": []}

myst_heading_anchors = 4  # as GitHub makes them
nb_execution_mode = "force"  # the outputs are those of this code
nb_execution_timeout = 300
nb_execution_raise_on_error = True
nb_merge_streams = True
nb_output_stderr = "remove"  # what Warp says where there is no GPU

IMPORTED = "circmean, circstd, bootstrap"  # of scipy, whose decorators hide that they are
autodoc_default_options = {"members": True, "member-order": "bysource", "exclude-members": f"model_config, {IMPORTED}"}
viewcode_follow_imported_members = False  # to builtins, which have no source
autodoc_typehints = "signature"
autodoc_preserve_defaults = True
python_maximum_signature_line_length = 90

logger = logging.getLogger(__name__)


def add_navigation(app: Sphinx, name: str, source: list[str]) -> None:
    """The first page holds the navigation, which GitHub would show as code; a page needs a title to be in it."""
    if name in TITLES:
        source[0] = f"# {TITLES[name]}\n\n{source[0]}"
    if name == root_doc:
        for part, pages in NAVIGATION.items():
            source[0] += "\n```{toctree}\n:hidden:\n:caption: " + "\n".join([part, "", *pages]) + "\n```\n"


def mark_anchors(app: Sphinx, name: str, source: list[str]) -> None:
    """`<a id="...">` on a line of its own is a target of links, too; MyST knows only headings, and its own notation."""
    source[0] = re.sub(r'^<a id="([\w-]+)"></a>$', r"(\1)=", source[0], flags=re.M)


def link_paper(app: Sphinx, name: str, source: list[str]) -> None:
    """Links to the paper lead to its HTML, since pandoc makes that, and not Sphinx (`make_paper`)."""
    source[0] = re.sub(r"\[([^]]+)\]\(((?:\.\./)*paper)\.md\)", r'<a href="\2.html">\1</a>', source[0])


def accept_anchors(app: Sphinx, document: nodes.document) -> None:
    """Let links from other pages lead to these anchors."""
    known = app.env.metadata[app.env.docname].setdefault("myst_slugs", {})
    for name, explicit in document.nametypes.items():
        if explicit and document.nameids.get(name):
            known.setdefault(name, (0, document.nameids[name], name))


def link_files(app: Sphinx, document: nodes.document) -> None:
    """Links to other files of the repository keep their paths; the files are copied with the site (`copy_files`)."""
    folder = PurePosixPath(app.env.docname).parent
    found = app.env.metadata[app.env.docname]["files"] = set()
    for node in list(document.findall(addnodes.download_reference)):
        target = unquote(node["reftarget"])
        found.add(normpath(target.lstrip("/") if target.startswith("/") else str(folder / target)))
        node.replace_self(nodes.reference("", "", *node.children, refuri=node["reftarget"], internal=True))
    for node in document.findall(nodes.raw):
        found.update(normpath(str(folder / source)) for source in re.findall(r'\ssrc="([^":]+)"', node.astext()))
    for path in found:
        if not (ROOT / path).is_file():
            logger.warning("no such file: %s", path, location=app.env.docname, type="posture")


def copy_files(app: Sphinx, error: Exception | None) -> None:
    """Copy the files that pages link to; the first page is the index, too."""
    if error is not None or app.builder.name != "html":
        return
    for path in {path for page in app.env.metadata.values() for path in page.get("files", ())}:
        (app.outdir / path).parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(ROOT / path, app.outdir / path)
    shutil.copyfile(app.outdir / f"{root_doc}.html", app.outdir / "index.html")


def make_paper(app: Sphinx, error: Exception | None) -> None:
    """Make the paper's HTML, with its references, beside the first page."""
    if error is None and app.builder.name == "html" and (Path(app.srcdir) / "paper.md").is_file():
        subprocess.run([sys.executable, ROOT / "docs" / "paper.py", app.outdir / "paper.html"], check=True)


def escape_docstring(app: Sphinx, what: str, name: str, obj: object, options: object, lines: list[str]) -> None:
    """Docstrings are plain text with `code` and **emphasis**, and not reStructuredText."""
    paragraphs = re.split(r"\n\s*\n", "\n".join(lines).rstrip())
    lines[:] = ["", *"\n\n".join(map(restructured, paragraphs)).splitlines(), ""]


def restructured(paragraph: str) -> str:
    """A paragraph with its other special characters escaped; one with indented lines (equations) as a literal block."""
    if re.search(r"^\s", paragraph, flags=re.M):
        return "::\n\n" + textwrap.indent(textwrap.dedent(paragraph), "    ")
    parts = re.split(r"(`[^`]*`|\*\*)", paragraph)
    parts[::2] = [re.sub(r"([\\*|_<>])", r"\\\1", part) for part in parts[::2]]
    return "".join(rf"\ `{part}`\ " if part.startswith("`") else part for part in parts)


def setup(app: Sphinx) -> None:
    """Connect the functions above to Sphinx."""
    app.connect("source-read", add_navigation)
    app.connect("source-read", mark_anchors)
    app.connect("source-read", link_paper)
    app.connect("doctree-read", accept_anchors)
    app.connect("doctree-read", link_files, priority=400)  # before Sphinx collects downloads
    app.connect("build-finished", copy_files)
    app.connect("build-finished", make_paper)
    app.connect("autodoc-process-docstring", escape_docstring)
