"""A page: text is shown as written, figures are inside the HTML, and Markdown tables have the shape of their rows."""

import base64
import re
import struct
import zlib
from html.parser import HTMLParser
from pathlib import Path

from posture.reproduce.claims.rules import Outcome
from posture.reproduce.page.page import Figure, Section, Table, html, markdown

SPECIAL = """<b>&amp; "quoted" 'it' | pipe</b>"""
TABLE = Table(["f [Hz]", "claim", "verdict"], [["0.15", "a|b", Outcome.PARTLY], ["0.30", "`c|d`", "-"]], "All", "rll")


def png(path: Path, width: int = 3, height: int = 2, grey: int = 128) -> Path:
    """Write a grey image, made by hand from the format's chunks."""

    def chunk(kind: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    header = struct.pack(">IIBBBBB", width, height, 8, 0, 0, 0, 0)
    pixels = zlib.compress((b"\0" + bytes([grey]) * width) * height)
    path.write_bytes(b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", pixels) + chunk(b"IEND", b""))
    return path


class Reader(HTMLParser):
    """Every element with its attributes, the text, and whether elements close in the order in which they opened."""

    VOID = ("meta", "link", "img")

    def __init__(self, page: str) -> None:
        super().__init__()
        self.elements: list[tuple[str, dict[str, str | None]]] = []
        self.text = ""
        self._open: list[str] = []
        self.feed(page)
        self.close()
        assert not self._open

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements.append((tag, dict(attrs)))
        if tag not in self.VOID:
            self._open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self._open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.text += data

    def all(self, tag: str) -> list[dict[str, str | None]]:
        return [attributes for name, attributes in self.elements if name == tag]


def page(*blocks: str | Table | Figure) -> Reader:
    return Reader(html("Title", "Subtitle", [Section("First", "first", blocks), Section("Second", "second", [])]))


def test_html_in_the_text_is_shown_and_not_interpreted(tmp_path: Path) -> None:
    figure = Figure(png(tmp_path / "a.png"), SPECIAL, SPECIAL)
    table = Table([SPECIAL, "b"], [[SPECIAL, f"`{SPECIAL}`"]], SPECIAL)
    read = Reader(html(SPECIAL, SPECIAL, [Section(SPECIAL, "first", [SPECIAL, table, figure])]))
    assert not read.all("b")
    # Title twice, subtitle, section title twice, paragraph, heading, two cells, captions of table and figure; in Markdown
    # an entity is the character that it names, except in titles and code.
    as_written, as_markdown = read.text.count(SPECIAL), read.text.count(SPECIAL.replace("&amp;", "&"))
    assert (as_written, as_markdown) == (5, 6)
    assert read.all("img")[0]["alt"] == SPECIAL
    assert [meta["content"] for meta in read.all("meta") if meta.get("name") == "description"] == [SPECIAL]


def test_text_is_markdown() -> None:
    document = html("T", "S", [Section("A", "a", ["**bold `x**2`** and\n[the **same**](#a), 2 ** 3\n\n```sh\nmake\n```"])])
    assert '<strong>bold <code>x**2</code></strong> and\n<a href="#a">the <strong>same</strong></a>, 2 ** 3</p>' in document
    assert '<pre tabindex="0"><code class="language-sh">make\n</code></pre>' in document
    read = page("[y](javascript:alert) [z](https://example.org/?a=1&b=2) [w](docs/theory.md#cost)")
    assert [a["href"] for a in read.all("a")][2:] == ["https://example.org/?a=1&b=2", "docs/theory.md#cost"]


def test_html_is_one_file_that_loads_nothing(tmp_path: Path) -> None:
    paths = [png(tmp_path / "a.png", 30, 20), png(tmp_path / "b.png", 5, 7, grey=9)]
    figures = [Figure(path, "what it shows", "caption") for path in paths]
    document = html("T", "S", [Section("A", "a", ["[out](https://example.org)", *figures, TABLE])])
    read = Reader(document)
    for path, image in zip(paths, read.all("img"), strict=True):
        kind, _, data = str(image["src"]).partition(",")
        assert kind == "data:image/png;base64" and base64.b64decode(data, validate=True) == path.read_bytes()
    assert not {"script", "iframe", "object", "video", "base"} & {tag for tag, _ in read.elements}
    assert all(str(link["href"]).startswith("data:") for link in read.all("link"))
    rest = re.sub(r'<a href="[^"]*"', "<a", re.sub(r"base64,[\w+/=]+", "", document))
    assert not re.search(r"https?:|//[a-z]|url\(|@import|@font-face", rest)


def test_html_for_assistive_technology(tmp_path: Path) -> None:
    read = page(TABLE, Figure(png(tmp_path / "a.png"), "what it shows", "caption"))
    assert read.all("html") == [{"lang": "en"}]
    assert {"name": "viewport", "content": "width=device-width, initial-scale=1"} in read.all("meta")
    assert [heading["scope"] for heading in read.all("th")] == ["col"] * 3 + ["row"] * 2
    assert len(read.all("caption")) == len(read.all("figure")) == len(read.all("figcaption")) == 1
    assert [a["href"] for a in read.all("a")] == ["#first", "#second"]
    assert [span["class"] for span in read.all("span") if "class" in span] == ["verdict partly"]


def test_columns_are_aligned_and_long_cells_wrap() -> None:
    read = page(TABLE, Table(["a", "b"], [["x", "word " * 20], ["x", "y"]], "caption"))
    assert [heading["class"] for heading in read.all("th")] == ["r", "l", "l", "r", "r", "l", "l wide", "l", "l"]


def test_markdown(tmp_path: Path) -> None:
    figure = Figure(png(tmp_path / "a.png"), "a view", "A **caption**.")
    assert markdown("Title", "Subtitle", [Section("First", "first", ["one\n\ntwo\n", TABLE, figure])]).splitlines() == [
        "# Title",
        "",
        "Subtitle",
        "",
        '<a id="first"></a>',
        "",
        "## First",
        "",
        "one",
        "",
        "two",
        "",
        "All",
        "",
        "| f [Hz] | claim | verdict |",
        "| ---: | --- | --- |",
        "| 0.15 | a\\|b | **partly** |",
        "| 0.30 | `c\\|d` | - |",
        "",
        "![a view](figures/a.png)",
        "",
        "A **caption**.",
    ]
