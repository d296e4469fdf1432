"""The page in a real browser, on a phone and on a desk, light and dark: whole, legible, and no wider than the screen."""

import shutil
from collections.abc import Iterator
from pathlib import Path

import pytest

from posture.reproduce.claims.rules import Outcome
from posture.reproduce.page.page import Figure, Section, Table, html
from tests.posture.reproduce.page.test_page import png

sync_api = pytest.importorskip("playwright.sync_api", reason="the Playwright package is not installed")

ROOT = Path(__file__).parents[4]
REPORT = ROOT / "results/reproduction/report.html"
CHROMIUM = shutil.which("chromium")
ARGUMENTS = [
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
]
PHONE, DESK = (360, 740), (1280, 900)
SMALLEST_PX = 14

pytestmark = pytest.mark.skipif(CHROMIUM is None, reason="no chromium on this machine (Debian: apt-get install chromium)")


@pytest.fixture(scope="module")
def browser() -> Iterator["sync_api.Browser"]:
    with sync_api.sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=ARGUMENTS)
        yield browser
        browser.close()


def synthetic(folder: Path) -> Path:
    """A page with everything that could be wider than a phone."""
    columns = 17
    headings = [f"quantity_{i} [Nm/rad]" for i in range(columns)]
    table = Table(headings, [["-0.123"] * columns] * 10, "A long caption. " * 20, "l" + "r" * (columns - 1))
    verdicts = Table(["claim", "verdict"], [["Some claim of several words. " * 4, verdict] for verdict in Outcome], "Claims")
    sections = [
        Section("Text and tables", "text", ["Prose with [a link](#figures). " * 60, verdicts, table]),
        Section("Text" * 40, "figures", ["x" * 300 + f" `{'y' * 200}`"]),
        Section("Commands", "commands", ["```sh\npython -m posture.train " + "env.hip_k=60 " * 30 + "\n```"]),
    ]
    for i, size in enumerate([(975, 825), (2000, 300), (40, 900)]):
        figure = Figure(png(folder / f"{i}.png", *size), "a grey area", "A long caption. " * 30)
        sections.append(Section(f"Figure {i}", f"figure-{i}", [figure]))
    path = folder / "page.html"
    path.write_text(html("A title of " + "many words " * 10, "A subtitle. " * 10, sections), encoding="utf-8")
    return path


@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("viewport", [PHONE, DESK], ids=["phone", "desk"])
@pytest.mark.parametrize("which", ["synthetic", "report"])
def test_page_in_a_browser(
    browser: "sync_api.Browser", tmp_path: Path, which: str, viewport: tuple[int, int], scheme: str
) -> None:
    if which == "report" and not REPORT.exists():
        pytest.skip(f"{REPORT.relative_to(ROOT)} is not there")
    path = REPORT if which == "report" else synthetic(tmp_path)
    page = browser.new_page(viewport={"width": viewport[0], "height": viewport[1]}, color_scheme=scheme)
    problems: list[str] = []
    requests: list[str] = []
    page.on("console", lambda message: problems.append(message.text))
    page.on("pageerror", lambda error: problems.append(str(error)))
    page.on("requestfailed", lambda request: problems.append(request.url[:200]))
    page.on("request", lambda request: requests.append(request.url[:200]))
    page.goto(path.as_uri(), wait_until="load")

    assert problems == []
    assert [url for url in requests if not url.startswith("data:")] == [path.as_uri()]
    widths = page.evaluate("[...document.images].map(image => image.naturalWidth)")
    assert widths and min(widths) > 0
    scroll, client = page.evaluate("[document.documentElement.scrollWidth, document.documentElement.clientWidth]")
    assert scroll <= client <= viewport[0]
    anchors = page.evaluate("[...document.querySelectorAll('nav a')].map(link => link.getAttribute('href').slice(1))")
    assert anchors == page.evaluate("[...document.querySelectorAll('main > section')].map(section => section.id)")
    for text in ("body", "main p", "th", "td", "caption", "figcaption"):
        for element in page.locator(text).all()[:3]:
            assert element.evaluate("element => parseFloat(getComputedStyle(element).fontSize)") >= SMALLEST_PX, text
    dark = page.evaluate("getComputedStyle(document.body).backgroundColor") != "rgb(255, 255, 255)"
    assert dark == (scheme == "dark")
    assert set(page.evaluate("[...document.images].map(image => getComputedStyle(image).backgroundColor)")) == {
        "rgb(255, 255, 255)"
    }, "figures keep a white ground"
    page.close()


def test_a_wide_table_scrolls_in_its_own_box(browser: "sync_api.Browser", tmp_path: Path) -> None:
    page = browser.new_page(viewport={"width": PHONE[0], "height": PHONE[1]})
    page.goto(synthetic(tmp_path).as_uri())
    box = page.locator(".scroll").last
    assert box.evaluate("box => [box.scrollWidth > 2 * box.clientWidth, box.clientWidth <= innerWidth]") == [True, True]
    box.evaluate("box => box.scrollLeft = 500")
    caption = box.locator("caption span").bounding_box()
    assert caption is not None
    assert caption["x"] >= 0 and caption["x"] + caption["width"] <= PHONE[0], "its caption stays where it is read"
    page.close()


def test_a_contents_link_leads_to_its_section(browser: "sync_api.Browser", tmp_path: Path) -> None:
    page = browser.new_page(viewport={"width": PHONE[0], "height": PHONE[1]})
    page.goto(synthetic(tmp_path).as_uri())
    page.click("nav a[href='#commands']")
    top = page.evaluate("document.getElementById('commands').getBoundingClientRect().top")
    assert 0 <= top < PHONE[1] / 4
    page.close()


def test_printed_on_white_with_nothing_cut_off(browser: "sync_api.Browser", tmp_path: Path) -> None:
    # A4 less its margins is 178 mm = 673 CSS pixels wide. Dark screens print on white paper, too.
    page = browser.new_page(viewport={"width": 673, "height": 900}, color_scheme="dark")
    page.goto(synthetic(tmp_path).as_uri())
    page.emulate_media(media="print")
    assert page.evaluate("getComputedStyle(document.body).color") == "rgb(28, 30, 33)"
    for table in page.locator("table").all():
        assert table.evaluate("table => table.getBoundingClientRect().right") <= 673
    page.close()
