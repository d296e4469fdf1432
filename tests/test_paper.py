"""The paper (`paper.md`, `paper.bib`): pandoc warns of nothing, the form is the journal's, and every number has a source.

The form is that of the Journal of Open Source Software. Each rule is also tried on a copy of the paper that breaks it.
"""

import json
import re
import subprocess
import sys
from datetime import datetime
from pathlib import Path

import pytest
import yaml

pypandoc = pytest.importorskip("pypandoc", reason="pandoc comes with `make setup`")

ROOT = Path(__file__).resolve().parents[1]
TEXT = (ROOT / "paper.md").read_text(encoding="utf-8")
ENTRIES = (ROOT / "paper.bib").read_text(encoding="utf-8")
MOST_WORDS = 1200
SECTIONS = ["Summary", "Statement of need", "State of the field", "Software design", "Results", "References"]

WITHOUT_DOI = {"mujoco_warp", "newton", "bardy1999", "ko2003", "ferry2007"}
"""Software that has none, and articles whose DOI we could not check. Each has an address."""


def pandoc(text, *options):
    """What pandoc makes of a text."""
    command = [pypandoc.get_pandoc_path(), *options]
    return subprocess.run(command, input=text, capture_output=True, text=True, encoding="utf-8", check=True).stdout


def nodes(tree, kind):
    """The contents of all nodes of a kind in pandoc's syntax tree."""
    if isinstance(tree, dict):
        if tree.get("t") == kind:
            yield tree["c"]
        tree = list(tree.values())
    if isinstance(tree, list):
        for branch in tree:
            yield from nodes(branch, kind)


def flaws(text, entries):
    """What is wrong with a paper of this text and these BibTeX entries."""
    tree = json.loads(pandoc(text, "--from=markdown", "--to=json"))
    return [*in_front_matter(text), *in_references(tree, entries), *in_body(text, tree)]


def in_front_matter(text):
    front = yaml.safe_load(text.split("---\n")[1])
    fields = ("title", "tags", "authors", "affiliations", "date", "bibliography")
    found = [f"no {field}" for field in fields if not front.get(field)]
    known = {str(place["index"]) for place in front.get("affiliations", []) if place.get("name")}
    for author in front.get("authors", []):
        places = set(re.split(r",\s*", str(author.get("affiliation", ""))))
        if not author.get("name") or not places <= known:
            found.append(f"author without name or affiliation: {author}")
    try:
        datetime.strptime(str(front.get("date")), "%d %B %Y")
    except ValueError:
        found.append(f"not a date such as 1 May 2026: {front.get('date')}")
    return found


def in_references(tree, entries):
    items = {item["id"]: item for item in json.loads(pandoc(entries, "--from=bibtex", "--to=csljson"))}
    cited = {citation["citationId"] for citations, _ in nodes(tree, "Cite") for citation in citations}
    found = [f"no entry: {key}" for key in sorted(cited - set(items))]
    found += [f"never cited: {key}" for key in sorted(set(items) - cited)]
    for key, item in items.items():
        name, form = ("URL", r"https://\S+") if key in WITHOUT_DOI else ("DOI", r"10\.\d{4,5}/\S+")
        found += [] if re.fullmatch(form, item.get(name, "")) else [f"no {name}: {key}"]
        found += [f"no {field}: {key}" for field in ("title", "author", "issued") if not item.get(field)]
    return found


def in_body(text, tree):
    words = len(pandoc(text, "--from=markdown", "--to=plain").split())
    found = [f"{words} words"] if words > MOST_WORDS else []
    headings = re.findall(r"^# (.+)$", text, flags=re.M)
    found += [f"sections {headings}"] if headings != SECTIONS else []
    found += [f"no figure {path}" for *_, (path, _) in nodes(tree, "Image") if not (ROOT / path).is_file()]
    return found + [f"not in the documents that its paragraph names: {number}" for number in numbers_without_source(text)]


def numbers_without_source(text):
    """Numbers that are in none of the documents which their paragraph names."""
    found = []
    for paragraph in text.split("---\n", 2)[2].split("\n\n"):
        sources = [ROOT / path for path in re.findall(r"`([\w/]+\.md)`", paragraph)]
        known = " ".join(path.read_text(encoding="utf-8") for path in sources)
        prose = re.sub(r"\]\([^)]*\)(\{.*?\})?|`[^`]*`|\[?@[\w; @]+\]?", "", paragraph)
        numbers = re.findall(r"(?<![\w.])\d+(?:\.\d+)?(?!\w)", prose)
        found += [number for number in numbers if not re.search(rf"(?<![\d.]){re.escape(number)}(?!\.?\d)", known)]
    return found


def make(out, source="paper.md"):
    command = [sys.executable, ROOT / "docs" / "paper.py", out, source]
    return subprocess.run(command, capture_output=True, text=True, encoding="utf-8", cwd=ROOT)


def test_html_has_everything_in_it(tmp_path):
    done = make(tmp_path / "paper.html")
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")
    page = (tmp_path / "paper.html").read_text(encoding="utf-8")
    images = re.findall(r'<img[^>]*src="([^"]{0,30})', page)
    assert len(images) == TEXT.count("![") and all(image.startswith("data:image/") for image in images)
    assert not re.search(r"<(script|link|iframe)\b|url\(", page)
    author = yaml.safe_load(TEXT.split("---\n")[1])["authors"][0]["name"]
    for visible in (f"{author} (", "Figure 2.", "Shen et al. (2023)"):
        assert visible in page


@pytest.mark.parametrize(("old", "new"), [("[@bardy1999;", "[@nobody2000;"), ("(docs/theory_map.png)", "(docs/no_map.png)")])
def test_a_warning_of_pandoc_is_an_error(tmp_path, old, new):
    assert old in TEXT
    (tmp_path / "paper.md").write_text(TEXT.replace(old, new), encoding="utf-8")
    assert make(tmp_path / "paper.html", tmp_path / "paper.md").returncode != 0


def test_paper_is_without_flaws():
    assert flaws(TEXT, ENTRIES) == []


@pytest.mark.parametrize(
    ("old", "new", "flaw"),
    [
        ("date: ", "date: about ", "not a date"),
        ("date: ", "day: ", "no date"),
        ("    index: 1", "    index: 2", "author without name or affiliation"),
        ("tags:", "keywords:", "no tags"),
        ("[@bardy1999;", "[@nobody2000;", "no entry: nobody2000"),
        ("[@bonnet2009]", "[@kuo1995]", "never cited: bonnet2009"),
        ("  doi = {10.1007/BF00336922}", "  note = {}", "no DOI: haken1985"),
        ("  url = {https://github.com/newton-physics/newton}", "  note = {}", "no URL: newton"),
        ("(docs/theory_map.png)", "(docs/no_map.png)", "no figure docs/no_map.png"),
        ("# Summary", "# Abstract", "sections ["),
        ("# References", "many words " * 100 + "\n\n# References", " words"),
        ("0.656 Hz", "0.655 Hz", "paragraph names: 0.655"),
        ("(`docs/human.md`)", "", "paragraph names: 180"),
    ],
)
def test_a_flaw_is_found(old, new, flaw):
    assert old in TEXT + ENTRIES
    found = flaws(TEXT.replace(old, new, 1), ENTRIES.replace(old, new, 1))
    assert any(flaw in one for one in found), found
