"""The page: nothing is taken for markup that is not, figures are inside, and a Markdown table has the shape of its rows."""

import base64
import re
import struct
import zlib
from html.parser import HTMLParser
from pathlib import Path

import pytest

from posture.reproduce.page.page import Block, Commands, Figure, Section, Table, Text, Verdict, html, markdown

NASTY = """<b>&amp; "quoted" 'it' | pipe</b>"""
TABLE = Table(["f [Hz]", "claim", "verdict"], [["0.15", "a|b", Verdict.REPRODUCED], ["0.30", "`c|d`", "-"]], "All", "rlc")


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


def page(*blocks: Block, title: str = "Title", subtitle: str = "Subtitle") -> Reader:
    return Reader(html(title, subtitle, [Section("First", "first", blocks), Section("Second", "second", [])]))


def md(*blocks: Block, title: str = "Title", subtitle: str = "Subtitle") -> str:
    return markdown(title, subtitle, [Section("First", "first", blocks)], "figures")


def test_html_shows_literally_what_is_not_markup(tmp_path: Path) -> None:
    figure = Figure(png(tmp_path / "a.png"), NASTY, NASTY)
    table = Table([NASTY, "b"], [[NASTY, f"`{NASTY}`"]], NASTY)
    sections = [Section(NASTY, "first", [Text(NASTY), table, figure, Commands([NASTY])])]
    read = Reader(html(NASTY, NASTY, sections))
    # Title twice, subtitle, section's title twice, text, a heading, two cells, captions of table and figure, command.
    assert read.text.count(NASTY) == 12
    assert not read.all("b")
    assert read.all("img")[0]["alt"] == NASTY
    assert [meta["content"] for meta in read.all("meta") if meta.get("name") == "description"] == [NASTY]


def test_inline_markup_in_html() -> None:
    document = html("T", "S", [Section("A", "a", [Text("**bold `x**2`** and `**code**` in [the **same**](#a), 2 ** 3")])])
    assert (
        "<p><strong>bold <code>x**2</code></strong> and <code>**code**</code> in"
        ' <a href="#a">the <strong>same</strong></a>, 2 ** 3</p>' in document
    )


def test_links_within_bold_stay_literal_and_scripts_are_no_links() -> None:
    read = page(Text("**[x](#first)** [y](javascript:alert) [z](https://example.org/?a=1&b=2) [w](docs/theory.md#cost)"))
    assert [a["href"] for a in read.all("a")][2:] == ["https://example.org/?a=1&b=2", "docs/theory.md#cost"]
    assert "[y](javascript:alert)" in read.text


def test_paragraphs_are_separated_by_empty_lines() -> None:
    read = page(Text("one\n  line\n\n  \nand another\n"))
    assert len(read.all("p")) == 3  # the subtitle is one
    assert "one line" in read.text
    assert md(Text("one\n  line\n\n  \nand another\n")).endswith("one line\n\nand another\n")


def test_embedded_images_are_the_files(tmp_path: Path) -> None:
    paths = [png(tmp_path / "a.png", 30, 20), png(tmp_path / "b.png", 5, 7, grey=9)]
    images = page(*(Figure(path, "what it shows", "caption") for path in paths)).all("img")
    for path, image in zip(paths, images, strict=True):
        kind, _, data = str(image["src"]).partition(",")
        assert kind == "data:image/png;base64"
        assert base64.b64decode(data, validate=True) == path.read_bytes()
    assert [(image["width"], image["height"]) for image in images] == [("30", "20"), ("5", "7")]


def test_nothing_is_fetched(tmp_path: Path) -> None:
    document = html(
        "T", "S", [Section("A", "a", [Text("[out](https://example.org)"), Figure(png(tmp_path / "a.png"), "x", "y"), TABLE])]
    )
    read = Reader(document)
    assert not {"script", "iframe", "object", "video", "base"} & {tag for tag, _ in read.elements}
    loaded = [link["href"] for link in read.all("link")] + [image["src"] for image in read.all("img")]
    assert all(str(address).startswith("data:") for address in loaded)
    rest = re.sub(r'<a href="[^"]*"', "<a", document)
    assert not re.search(r"https?:|//[a-z]|url\(|@import|@font-face", re.sub(r"base64,[\w+/=]+", "", rest))


def test_html_for_every_reader(tmp_path: Path) -> None:
    read = page(TABLE, Figure(png(tmp_path / "a.png"), "what it shows", "caption"))
    assert read.all("html") == [{"lang": "en"}]
    assert {"name": "viewport", "content": "width=device-width, initial-scale=1"} in read.all("meta")
    assert [heading["scope"] for heading in read.all("th")] == ["col"] * 3 + ["row"] * 2
    assert [cell["class"] for cell in read.all("td")] == ["l", "c"] * 2
    assert len(read.all("caption")) == len(read.all("figure")) == len(read.all("figcaption")) == 1
    assert [a["href"] for a in read.all("a")] == ["#first", "#second"]


@pytest.mark.parametrize("verdict", Verdict)
def test_a_verdict_is_coloured_and_written_out(verdict: Verdict) -> None:
    read = page(Table(["claim", "verdict"], [["x", verdict]], "caption"))
    kind = verdict.name.lower().replace("_", "-")
    assert {"class": f"verdict {kind}"} in read.all("span")
    assert f"\n.{kind} {{ color:" in read.text, "the style knows it"
    assert f"x{verdict}\n" in read.text
    assert f"| x | **{verdict}** |" in md(Table(["claim", "verdict"], [["x", verdict]], "caption"))


def test_only_long_cells_ask_for_a_wide_column() -> None:
    read = page(Table(["a", "b"], [["x", "word " * 20], ["x", "y"]], "caption"))
    assert [heading["class"] for heading in read.all("th")][:2] == ["l", "l wide"]


def test_markdown_table_has_the_shape_of_its_rows() -> None:
    assert md(TABLE).split("\n\n", 4)[-1].splitlines() == [
        "All",
        "",
        "| f \\[Hz\\] | claim | verdict |",
        "| ---: | --- | :---: |",
        "| 0.15 | a\\|b | **reproduced** |",
        "| 0.30 | `c\\|d` | - |",
    ]


@pytest.mark.parametrize(
    ("text", "written"),
    [
        ("a * b ~ c < 3 & d > 2", r"a \* b \~ c < 3 & d > 2"),
        ("<i> &amp; x[0] $a$", r"\<i> \&amp; x\[0\] \$a\$"),
        ("hip_k and _so_ and __init__", r"hip_k and \_so\_ and \_\_init\_\_"),
        ("# no heading", r"\# no heading"),
        ("- no list", r"\- no list"),
        ("1. no list", r"1\. no list"),
        ("---", r"\---"),
        ("> no quotation", r"\> no quotation"),
        ("-0.5 is a number, 0.5 too", "-0.5 is a number, 0.5 too"),
        ("**bold** `a*b|c` [there](#first)", "**bold** `a*b|c` [there](#first)"),
    ],
)
def test_markdown_shows_literally_what_is_not_markup(text: str, written: str) -> None:
    assert md(Text(text)).splitlines()[-1] == written


def test_markdown_links_figures_beside_it(tmp_path: Path) -> None:
    assert md(Figure(png(tmp_path / "a b.png"), "x [y]", "A **caption**.")).endswith(
        "![x \\[y\\]](figures/a%20b.png)\n\nA **caption**.\n"
    )


def test_markdown_headings_and_commands() -> None:
    assert md(Commands(["make", "echo '```'"]), title="T*") == (
        "# T\\*\n\nSubtitle\n\n<a id=\"first\"></a>\n\n## First\n\n````sh\nmake\necho '```'\n````\n"
    )


def test_what_cannot_be_a_page_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="1 cells beside 2 headings"):
        Table(["a", "b"], [["x", "y"], ["x"]], "caption")
    with pytest.raises(ValueError, match="each of 2 columns, got 'lx'"):
        Table(["a", "b"], [], "caption", "lx")
    with pytest.raises(ValueError, match="links to nowhere lead nowhere; sections: first, second"):
        page(Text("[x](#nowhere)"))
    with pytest.raises(ValueError, match="anchors must differ"):
        html("T", "S", [Section("A", "a", []), Section("B", "a", [])])
    with pytest.raises(ValueError, match="an anchor is"):
        markdown("T", "S", [Section("A", "a b", [])], "figures")
    (tmp_path / "a.png").write_bytes(b"no image")
    with pytest.raises(ValueError, match=r"a\.png is not a PNG file"):
        page(Figure(tmp_path / "a.png", "", ""))
