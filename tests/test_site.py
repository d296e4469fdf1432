"""The documentation site: it builds without a warning, its links lead somewhere, and it loads nothing from elsewhere."""

import re
import subprocess
import sys
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

import pytest

ROOT = Path(__file__).resolve().parents[1]
LOADED = {"img", "script", "link", "iframe", "video", "source", "audio", "embed", "object"}
"""Elements whose address a browser loads by itself."""
ADDRESS = ("href", "src", "data", "poster")


class Page(HTMLParser):
    """The ids of a page, and its addresses: (element, address)."""

    def __init__(self, path):
        super().__init__()
        self.ids, self.addresses = set(), []
        self.feed(path.read_text(encoding="utf-8"))

    def handle_starttag(self, tag, attrs):
        self.ids.update(value for name, value in attrs if name == "id")
        self.addresses += [(tag, value) for name, value in attrs if name in ADDRESS and value]


def build(source, out, *options):
    command = [sys.executable, "-m", "sphinx", "-q", "-W", "--keep-going", "-c", ROOT / "docs", *options, source, out]
    return subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=600)


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    """The whole site, without running its notebook (`test_notebook.py` does)."""
    out = tmp_path_factory.mktemp("site")
    done = build(ROOT, out, "-D", "nb_execution_mode=off")
    assert done.returncode == 0, done.stderr
    return out


@pytest.fixture(scope="module")
def pages(site):
    return {path: Page(path) for path in site.rglob("*.html") if "results/film" not in path.as_posix()}


@pytest.mark.slow
def test_every_address_leads_to_a_file_and_a_place_in_it(site, pages):
    checked = 0
    for page, content in pages.items():
        for _, address in content.addresses:
            url = urlsplit(address)
            if url.scheme:
                continue
            target = (page.parent / unquote(url.path)).resolve() if url.path else page
            assert target.is_file(), f"{page.relative_to(site)}: {address}"
            if url.fragment and target in pages:
                assert unquote(url.fragment) in pages[target].ids | {""}, f"{page.relative_to(site)}: {address}"
            checked += 1
    assert checked > 1000


@pytest.mark.slow
def test_nothing_is_loaded_from_another_site(site, pages):
    for page, content in pages.items():
        for tag, address in content.addresses:
            assert tag not in LOADED or urlsplit(address).scheme in ("", "data"), f"{page.relative_to(site)}: {address}"
    for sheet in site.rglob("*.css"):
        assert not re.search(r"""(@import|url\()\s*["']?(https?:)?//""", sheet.read_text(encoding="utf-8")), sheet.name


@pytest.mark.slow
def test_first_page_films_and_reference(site, pages):
    assert ("img", "_images/two_modes.gif") in pages[site / "index.html"].addresses
    assert ("a", "paper.html") in pages[site / "index.html"].addresses
    assert "ref-shen2023" in pages[site / "paper.html"].ids
    gallery = pages[site / "docs/gallery.html"].addresses
    assert {("iframe", "../results/film/session.html"), ("video", "../results/film/ramp.mp4")} <= set(gallery)
    assert "posture.evaluation.trial.evaluate_at" in pages[site / "docs/api/evaluation.html"].ids
    assert "envs.task.head_tracking.HeadTrackingEnv.step" in pages[site / "docs/api/task.html"].ids


@pytest.mark.slow
@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[x](nowhere.md)", "nowhere.md"),
        ("[x](nowhere.yaml)", "nowhere.yaml"),
        ("[x](#nothing)", "nothing"),
        ("[x](docs/other.md#nothing)", "nothing"),
        ("![x](nowhere.png)", "nowhere.png"),
        ('<video src="nowhere.mp4"></video>', "nowhere.mp4"),
    ],
)
def test_a_broken_link_is_an_error(tmp_path, text, message):
    (tmp_path / "docs").mkdir()
    (tmp_path / "docs" / "other.md").write_text("# Other\n\n## A part\n")
    (tmp_path / "README.md").write_text("# First\n\n[part](docs/other.md#a-part)\n\n" + text + "\n")
    done = build(tmp_path, tmp_path / "out", "-D", "suppress_warnings=toc")
    lines = [line for line in done.stderr.splitlines() if "WARNING" in line or "ERROR" in line]
    assert done.returncode != 0 and len(lines) == 1 and message in lines[0], done.stderr
