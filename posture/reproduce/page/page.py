"""The parts of a page, and the page written as one HTML file or as Markdown.

All text is Markdown (CommonMark): paragraphs, captions and table cells. HTML inside it is shown as text.
"""

from __future__ import annotations

import base64
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import jinja2
from markdown_it import MarkdownIt
from markupsafe import Markup

from posture.reproduce.claims.rules import Outcome

WIDE_CELL = 40
"""A column with a cell of more characters than this wraps its lines and keeps a minimum width."""


@dataclass(frozen=True)
class Table:
    """Rows of cells; the first cell of a row names it, and a cell that is an `Outcome` is coloured.

    align: a letter for each column, l (left) or r (right); empty: all left.
    """

    headings: Sequence[str]
    rows: Sequence[Sequence[str]]
    caption: str
    align: str = ""

    def __post_init__(self) -> None:
        object.__setattr__(self, "align", self.align or "l" * len(self.headings))

    @property
    def classes(self) -> list[str]:
        """CSS classes of each column."""
        wide = [any(len(row[i]) > WIDE_CELL for row in self.rows) for i in range(len(self.headings))]
        return [f"{align} wide" if is_wide else align for align, is_wide in zip(self.align, wide, strict=True)]


@dataclass(frozen=True)
class Figure:
    """A PNG file. alt: what it shows, for readers who cannot see it."""

    path: Path
    alt: str
    caption: str


@dataclass(frozen=True)
class Section:
    """A title, the anchor that links lead to, and paragraphs (Markdown text), tables and figures in order."""

    title: str
    anchor: str
    blocks: Sequence[str | Table | Figure]


def html(title: str, subtitle: str, sections: Sequence[Section]) -> str:
    """The page as a single HTML document, with style and figures inside it."""
    return _render("report.html.j2", title, subtitle, sections)


def markdown(title: str, subtitle: str, sections: Sequence[Section]) -> str:
    """The page as Markdown (GitHub's), with figures linked in the folder figures/ beside it."""
    return _render("summary.md.j2", title, subtitle, sections)


def _render(template: str, title: str, subtitle: str, sections: Sequence[Section]) -> str:
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(Path(__file__).with_name("templates")),
        autoescape=lambda name: name is not None and name.endswith(".html.j2"),
        trim_blocks=True,
        lstrip_blocks=True,
        undefined=jinja2.StrictUndefined,
    )
    text = MarkdownIt("commonmark", {"html": False})
    environment.filters.update(
        inline=lambda source: Markup(text.renderInline(source)),
        # A code block can be wider than the page: with a tabindex it is scrolled by keyboard, too.
        paragraphs=lambda source: Markup(text.render(source).replace("<pre>", '<pre tabindex="0">')),
        base64=lambda path: base64.b64encode(path.read_bytes()).decode(),
        cell=_markdown_cell,
    )
    environment.tests["outcome"] = lambda cell: isinstance(cell, Outcome)
    return environment.get_template(template).render(title=title, subtitle=subtitle, sections=sections)


def _markdown_cell(cell: str) -> str:
    """A cell of a Markdown table, in which a pipe has to be escaped even inside code."""
    text = cell.replace("|", r"\|")
    return f"**{text}**" if isinstance(cell, Outcome) else text
