"""One page from a neutral structure: as a single HTML file that needs nothing beside it, and as Markdown.

Prose, captions and cells may hold `code`, **bold** and [links](#anchor); all else is taken literally. A link leads to
the anchor of a section, to a relative path, or to http(s). Titles and alternative texts are literal throughout.
"""

from __future__ import annotations

import base64
import re
import struct
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import StrEnum
from html import escape
from pathlib import Path
from urllib.parse import quote

STYLE = Path(__file__).with_name("page.css")
CELL_CHARACTERS = 40
"""A column with a cell longer than this wraps, and is kept wide enough to be read."""
MANY_COLUMNS = 10
"""A table with more than these is printed smaller."""


class Verdict(StrEnum):
    """How a claim fared. As the cell of a table it is coloured."""

    REPRODUCED = "reproduced"
    PARTLY = "partly"
    NOT = "not reproduced"
    NOT_MEASURED = "not measured"


@dataclass(frozen=True)
class Text:
    """Paragraphs, with an empty line between two."""

    text: str


@dataclass(frozen=True)
class Table:
    """Rows of cells. `align` is a letter a column: l (everywhere unless told), r or c. The first cell names its row."""

    headings: Sequence[str]
    rows: Sequence[Sequence[str]]
    caption: str
    align: str = ""

    def __post_init__(self) -> None:
        columns = len(self.headings)
        if uneven := [row for row in self.rows if len(row) != columns]:
            raise ValueError(f"a row has {len(uneven[0])} cells beside {columns} headings: {list(uneven[0])}")
        if self.align and not re.fullmatch(f"[lrc]{{{columns}}}", self.align):
            raise ValueError(f"align is one of l, r, c for each of {columns} columns, got {self.align!r}")


@dataclass(frozen=True)
class Figure:
    """A PNG file. `alt` says what it shows to those who cannot see it."""

    path: Path
    alt: str
    caption: str


@dataclass(frozen=True)
class Commands:
    """Lines for a shell."""

    lines: Sequence[str]


Block = Text | Table | Figure | Commands


@dataclass(frozen=True)
class Section:
    """Blocks under a title. `anchor` is what links lead to: a letter, then letters, digits, - and _."""

    title: str
    anchor: str
    blocks: Sequence[Block]


def html(title: str, subtitle: str, sections: Sequence[Section]) -> str:
    """The page as one HTML document: figures embedded, style inline, no script, and nothing fetched from anywhere."""
    _check_anchors(sections)
    contents = "\n".join(f'<li><a href="#{s.anchor}">{escape(s.title)}</a></li>' for s in sections)
    body = "\n".join(_html_section(section) for section in sections)
    page = f"""<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta http-equiv="Content-Security-Policy" content="default-src 'none'; img-src data:; style-src 'unsafe-inline'">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta name="color-scheme" content="light dark">
<meta name="description" content="{escape(_inline(subtitle, _plain))}">
<link rel="icon" href="data:,">
<title>{escape(title)}</title>
<style>
{STYLE.read_text(encoding="utf-8")}</style>
</head>
<body>
<header>
<h1>{escape(title)}</h1>
<p class="subtitle">{_inline(subtitle, _html_mark)}</p>
</header>
<nav aria-label="Contents">
<ul>
{contents}
</ul>
</nav>
<main>
{body}
</main>
</body>
</html>
"""
    targets = set(re.findall(r'href="#([^"]*)"', page))
    if lost := sorted(targets - {section.anchor for section in sections}):
        raise ValueError(f"links to {', '.join(lost)} lead nowhere; sections: {', '.join(s.anchor for s in sections)}")
    return page


def markdown(title: str, subtitle: str, sections: Sequence[Section], figures_at: str) -> str:
    """The page as Markdown (GitHub's), with figures linked as `figures_at`/<file name>, relative to the page."""
    _check_anchors(sections)
    parts = [f"# {_literal(title)}", _markdown_text(subtitle)]
    for section in sections:
        parts.append(f'<a id="{section.anchor}"></a>\n\n## {_literal(section.title)}')
        parts += [_markdown_block(block, figures_at) for block in section.blocks]
    return "\n\n".join(filter(None, parts)) + "\n"


def _check_anchors(sections: Sequence[Section]) -> None:
    anchors = [section.anchor for section in sections]
    for anchor in anchors:
        if not re.fullmatch(r"[A-Za-z][\w-]*", anchor, re.ASCII):
            raise ValueError(f"an anchor is a letter, then letters, digits, - and _; got {anchor!r}")
    if len(set(anchors)) < len(anchors):
        raise ValueError(f"anchors must differ, got {anchors}")


# Inline markup. A `Mark` writes one piece: its kind (text, code, bold or link), its content and where a link leads. The
# content of bold and link is already written.
Mark = Callable[[str, str, str], str]
_MARKUP = re.compile(
    r"`(?P<code>[^`]+)`"
    r"|\*\*(?P<bold>(?:`[^`]*`|[^`])+?)\*\*"
    r"|\[(?P<link>[^][]+)]\((?P<target>#[\w-]+|https?://[^\s()|]+|[\w./-]+(?:#[\w-]+)?)\)"
)


def _inline(text: str, mark: Mark) -> str:
    """Text with its markup written by `mark`; white space collapsed."""
    text = " ".join(text.split())
    pieces, end = [], 0
    for match in _MARKUP.finditer(text):
        pieces.append(mark("text", text[end : match.start()], ""))
        kind = next(name for name in ("code", "bold", "link") if match[name])
        content = match[kind] if kind == "code" else _nested(match[kind], mark)
        pieces.append(mark(kind, content, match["target"] or ""))
        end = match.end()
    return "".join([*pieces, mark("text", text[end:], "")])


def _nested(text: str, mark: Mark) -> str:
    """What stands in bold or in a link; links in it stay literal, since HTML has none within another."""
    return _inline(text, lambda kind, content, target: content if kind == "link" else mark(kind, content, target))


def _plain(_kind: str, content: str, _target: str) -> str:
    return content


def _html_mark(kind: str, content: str, target: str) -> str:
    match kind:
        case "code":
            return f"<code>{escape(content)}</code>"
        case "bold":
            return f"<strong>{content}</strong>"
        case "link":
            return f'<a href="{escape(target)}">{content}</a>'
    return escape(content)


def _markdown_mark(kind: str, content: str, target: str) -> str:
    match kind:
        case "code":
            return f"`{content}`"
        case "bold":
            return f"**{content}**"
        case "link":
            return f"[{content}]({target})"
    return _literal(content)


def _literal(text: str) -> str:
    """Markdown that shows exactly `text`, inside a line. Underscores within a word, and < and & before a space, may stay."""
    special = r"[\\`*\[\]~$]|<(?! )|&(?=#?\w+;)|(?<![^\W_])_|_(?![^\W_])"
    return re.sub(special, r"\\\g<0>", text)


def _paragraphs(text: str) -> list[str]:
    return [paragraph for paragraph in re.split(r"\n\s*\n", text) if paragraph.strip()]


def _html_section(section: Section) -> str:
    blocks = "\n".join(_html_block(block) for block in section.blocks)
    return f'<section id="{section.anchor}">\n<h2>{escape(section.title)}</h2>\n{blocks}\n</section>'


def _html_block(block: Block) -> str:
    match block:
        case Text():
            return "\n".join(f"<p>{_inline(paragraph, _html_mark)}</p>" for paragraph in _paragraphs(block.text))
        case Table():
            return _html_table(block)
        case Figure():
            return _html_figure(block)
        case Commands():
            lines = escape("\n".join(block.lines))
            return f'<pre tabindex="0"><code>{lines}</code></pre>'


def _html_figure(figure: Figure) -> str:
    data = figure.path.read_bytes()
    if data[:8] != b"\x89PNG\r\n\x1a\n":
        raise ValueError(f"{figure.path} is not a PNG file")
    width, height = struct.unpack(">II", data[16:24])
    return (
        f'<figure>\n<img src="data:image/png;base64,{base64.b64encode(data).decode()}" width="{width}" height="{height}"'
        f' alt="{escape(figure.alt)}">\n<figcaption>{_inline(figure.caption, _html_mark)}</figcaption>\n</figure>'
    )


def _html_table(table: Table) -> str:
    """The table in a box of its own, that scrolls where it is wider than the page."""
    classes = []
    for column, align in enumerate(table.align or "l" * len(table.headings)):
        wide = any(len(row[column]) > CELL_CHARACTERS for row in table.rows)
        classes.append(align + (" wide" if wide else ""))
    headings = [
        f'<th scope="col" class="{kind}">{_inline(heading, _html_mark)}</th>'
        for heading, kind in zip(table.headings, classes, strict=True)
    ]
    lines = [f"<tr>{''.join(headings)}</tr>"]
    for row in table.rows:
        cells = [_html_cell(cell, kind, first=i == 0) for i, (cell, kind) in enumerate(zip(row, classes, strict=True))]
        lines.append(f"<tr>{''.join(cells)}</tr>")
    many = ' class="many"' if len(table.headings) > MANY_COLUMNS else ""
    return (
        f'<div class="scroll" role="region" tabindex="0" aria-label="{escape(_inline(table.caption, _plain))}">\n'
        f"<table{many}>\n<caption><span>{_inline(table.caption, _html_mark)}</span></caption>\n"
        f"<thead>\n{lines[0]}\n</thead>\n<tbody>\n" + "\n".join(lines[1:]) + "\n</tbody>\n</table>\n</div>"
    )


def _html_cell(cell: str, kind: str, *, first: bool) -> str:
    tag, scope = ("th", ' scope="row"') if first else ("td", "")
    content = _inline(cell, _html_mark)
    if isinstance(cell, Verdict):
        content = f'<span class="verdict {cell.name.lower().replace("_", "-")}">{content}</span>'
    return f'<{tag}{scope} class="{kind}">{content}</{tag}>'


def _markdown_text(text: str) -> str:
    """Paragraphs. What would make a line a heading, a list, a rule or a quotation is escaped."""
    lines = [_inline(paragraph, _markdown_mark) for paragraph in _paragraphs(text)]
    return "\n\n".join(re.sub(r"^(\d*)([-+=#.)]+(?:\s|$)|>)", r"\1\\\2", line) for line in lines)


def _markdown_block(block: Block, figures_at: str) -> str:
    match block:
        case Text():
            return _markdown_text(block.text)
        case Table():
            return _markdown_table(block)
        case Figure():
            target = quote(f"{figures_at.rstrip('/')}/{block.path.name}")
            return f"![{_literal(' '.join(block.alt.split()))}]({target})\n\n{_markdown_text(block.caption)}".rstrip()
        case Commands():
            longest = max(map(len, re.findall("`+", "\n".join(block.lines))), default=0)
            fence = "`" * max(3, longest + 1)
            return "\n".join([f"{fence}sh", *block.lines, fence])


def _markdown_table(table: Table) -> str:
    rules = {"l": "---", "r": "---:", "c": ":---:"}
    lines = [
        [_markdown_cell(heading) for heading in table.headings],
        [rules[align] for align in table.align or "l" * len(table.headings)],
        *([_markdown_cell(cell) for cell in row] for row in table.rows),
    ]
    rows = "\n".join(f"| {' | '.join(line)} |" for line in lines)
    return f"{_markdown_text(table.caption)}\n\n{rows}".lstrip()


def _markdown_cell(cell: str) -> str:
    """A cell. Markdown's tables want pipes escaped within code as well."""
    text = _inline(cell, _markdown_mark).replace("|", r"\|")
    return f"**{text}**" if isinstance(cell, Verdict) else text
