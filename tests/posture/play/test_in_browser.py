"""The page in a real browser: what it shows, and that its controls reach the session. What they do is in test_server.

Screenshots are left in runs/play/, for a person to look at.
"""

import io
import shutil
import time
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from posture.play.policies import policy_choices
from posture.play.recording import record
from posture.play.server import running
from tests.posture.play.sessions import DT, compose_play

sync_api = pytest.importorskip("playwright.sync_api", reason="the Playwright package is not installed")

CHROMIUM = shutil.which("chromium")
ARGUMENTS = [
    "--no-sandbox",
    "--use-gl=angle",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
]
SCREENSHOTS = Path(__file__).parents[3] / "runs" / "play"
TIMEOUT_S = 60

pytestmark = pytest.mark.skipif(CHROMIUM is None, reason="no chromium on this machine (Debian: apt-get install chromium)")


@pytest.fixture(scope="module")
def browser():
    SCREENSHOTS.mkdir(parents=True, exist_ok=True)
    with sync_api.sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=ARGUMENTS)
        yield browser
        browser.close()


@pytest.fixture(scope="module")
def server():
    config = compose_play("port=0")
    with running(config, policy_choices(config.ckpt, config.lqr)) as server:
        yield server


def new_page(browser, width, height):
    """A browser page, the error messages of its console, and the addresses that it requests."""
    page = browser.new_page(viewport={"width": width, "height": height})
    page.set_default_timeout(1000 * TIMEOUT_S)
    errors, requests = [], []
    page.on("console", lambda message: errors.append(message.text) if message.type == "error" else None)
    page.on("pageerror", lambda error: errors.append(str(error)))
    page.on("request", lambda request: requests.append(request.url))
    return page, errors, requests


def pixels(picture):
    """RGB of a screenshot, (height, width, 3)."""
    return np.asarray(Image.open(io.BytesIO(picture)).convert("RGB"), dtype=float)


def blue(image):
    """Share of pixels in the colour of the body."""
    return (image[..., 2] > image[..., 0] + 30).mean()


class Window:
    """A browser window with the page, and the visitor of the server that belongs to it."""

    def __init__(self, browser, server, height=1400):
        known = set(server.visitors)
        self.page, self.errors, self.requests = new_page(browser, 1360, height)
        self.page.goto(f"http://127.0.0.1:{server.port}")
        self.page.get_by_text("posture").first.wait_for()
        self.wait(lambda: set(server.visitors) - known)
        (number,) = set(server.visitors) - known
        self.visitor = server.visitors[number]
        self.wait(lambda: self.visitor.frames > 0)
        self.session = self.visitor.session

    def wait(self, condition):
        end = time.monotonic() + TIMEOUT_S
        while not condition():
            assert time.monotonic() < end, "timeout"
            self.page.wait_for_timeout(100)

    def control(self, label):
        return self.page.locator("label", has_text=label).locator("xpath=ancestor::div[.//input][1]")

    def value(self, label):
        return float(self.control(label).locator("input").last.input_value())

    def enter(self, label, value):
        self.control(label).locator("input").last.fill(str(value))
        self.page.keyboard.press("Enter")

    def press(self, name):
        self.page.get_by_role("button", name=name, exact=True).click()

    def toggle(self, label):
        self.page.locator("label", has_text=label).click()

    def screenshot(self, name):
        self.page.screenshot(path=SCREENSHOTS / f"{name}.png")


# These come first: beside another window, which also renders in software, they are slow.


@pytest.mark.slow
def test_error_is_shown(browser, server, monkeypatch):
    window = Window(browser, server, height=400)
    monkeypatch.setattr(window.session, "step", lambda: 1 / 0)
    window.page.get_by_text("ZeroDivisionError: division by zero; reload the page").wait_for()
    window.page.close()


@pytest.mark.slow
def test_recording_plays_without_python(browser, tmp_path):
    config = compose_play("record=x.html", "recording.freq=[0.7,0.75]", "recording.hold=2", "frames_per_s=10")
    path = tmp_path / "session.html"
    record(config, path)
    page, errors, requests = new_page(browser, 1000, 700)
    page.goto(path.as_uri())
    page.locator(".mantine-Slider-root").wait_for()
    end = time.monotonic() + TIMEOUT_S
    while not 0.01 < blue(pixels(page.screenshot(path=SCREENSHOTS / "recording.png"))) < 0.5:  # the scene fades in
        assert time.monotonic() < end, "the body is not visible"
        page.wait_for_timeout(500)
    assert errors == []
    assert [url for url in requests if not url.startswith(("data:", "blob:", path.as_uri()))] == []
    page.close()


@pytest.fixture(scope="module")
def shared(browser, server):
    window = Window(browser, server)
    yield window
    window.page.close()


@pytest.fixture
def window(shared):
    """One window for most tests, reset, at 0.3 Hz."""
    if shared.session.paused:
        shared.toggle("pause")
    shared.enter("frequency [Hz]", 0.3)
    shared.press("reset")
    shared.wait(lambda: shared.session.settings.freq == 0.3 and not shared.session.paused)
    shared.page.locator("[data-mode='undefined']").wait_for()
    return shared


def test_page_loads_without_errors_and_without_the_internet(window, server):
    window.page.locator("[data-mode='in-phase']").wait_for()
    window.page.get_by_text("computing").first.wait_for(state="detached")
    window.screenshot("start")
    assert window.errors == []
    local = f"http://127.0.0.1:{server.port}", "data:", "blob:"
    assert [url for url in window.requests if not url.startswith(local)] == []


@pytest.mark.slow
def test_mode_theory_and_cost_are_shown(window):
    window.page.locator("[data-mode='in-phase']").wait_for()
    row = window.page.locator("tr", has_text="transition frequency")
    window.wait(lambda: "Hz" in row.inner_text())
    assert float(row.inner_text().split()[-2]) == pytest.approx(window.session._theory.result.transition, abs=6e-4)
    ratio = window.page.locator("tr", has_text="cost / least cost")
    window.wait(lambda: "–" not in ratio.inner_text() and 0.9 < float(ratio.inner_text().split()[-1]) < 1.6)
    window.enter("frequency [Hz]", 1.2)
    window.page.locator("[data-mode='anti-phase']").wait_for()
    window.screenshot("anti_phase")


@pytest.mark.slow
def test_scene_and_charts_show_something(window):
    window.wait(lambda: window.session.time > 10)
    scene = max(window.page.locator("canvas").all(), key=lambda c: (c.bounding_box() or {"width": 0})["width"])
    first = pixels(scene.screenshot())
    window.page.wait_for_timeout(1200)
    assert np.abs(first - pixels(scene.screenshot())).max() > 50, "the stander does not move"
    orange = ((first[..., 0] > first[..., 2] + 80) & (first[..., 1] > first[..., 2] + 40)).mean()
    assert 0.0005 < orange < 0.05, "share of target and tolerance band"
    assert 0.01 < blue(first) < 0.5, "share of the body"
    charts = window.page.locator(".uplot-container canvas")
    assert charts.count() == 6
    for chart in charts.all():
        chart.scroll_into_view_if_needed()
        image = pixels(chart.screenshot())
        coloured = np.ptp(image, axis=2) > 60
        assert image.mean() > 200 and image.std() > 5
        assert coloured.sum() > 10 or (image.max(axis=2) < 100).sum() > 10, "no curve"


@pytest.mark.slow
def test_dragging_the_frequency_slider_moves_the_target_smoothly(window):
    box = window.control("frequency [Hz]").locator("[role=slider]").bounding_box()
    middle = box["y"] + box["height"] / 2
    window.page.mouse.move(box["x"] + box["width"] / 2, middle)
    window.page.mouse.down()
    window.page.mouse.move(box["x"] + 60, middle, steps=8)
    window.page.mouse.up()
    window.wait(lambda: window.session.settings.freq > 0.5)
    window.page.wait_for_timeout(500)
    target = window.session.history.last("target", 200)
    assert np.abs(np.diff(target)).max() <= 0.1 * 2 * np.pi * 1.5 * DT + 1e-6  # A 2 pi f at the highest frequency


@pytest.mark.slow
def test_controls_reach_the_session_and_show_its_settings(window):
    window.enter("frequency [Hz]", 9)  # beyond the slider
    window.wait(lambda: window.session.settings.freq == window.value("frequency [Hz]") == 1.5)
    window.enter("frequency [Hz]", 0.3)
    window.wait(lambda: window.session.settings.freq == 0.3)
    window.press("ramp up")
    window.wait(lambda: window.value("frequency [Hz]") > 0.33)  # the slider follows
    window.press("ramp down")
    window.wait(lambda: window.session.ramping == -1)
    window.toggle("pause")
    window.wait(lambda: window.session.paused)
    window.page.get_by_text("paused").first.wait_for()
    window.toggle("pause")
    window.press("reset")
    window.wait(lambda: len(window.session.history) < 100)
    window.control("policy").locator("input").first.click()
    window.page.get_by_role("option", name="pretrained/hip_k-75", exact=True).click()
    window.wait(lambda: window.session.settings.hip_k == window.value("hip stiffness") == 75)
    assert window.session.policy == "pretrained/hip_k-75" and window.errors == []
