"""The page in a real browser: what is turned there moves the stander here, and pictures show something.

Screenshots are left in runs/play/, for a person to look at.
"""

import io
import shutil
import time
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from posture.play.pilot import candidates
from posture.play.record import record
from posture.play.server import opened
from tests.posture.play.playing import compose_play

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
SHOTS = Path(__file__).parents[3] / "runs" / "play"
PATIENCE_S = 60

pytestmark = pytest.mark.skipif(CHROMIUM is None, reason="no chromium on this machine (Debian: apt-get install chromium)")


@pytest.fixture(scope="module")
def browser():
    SHOTS.mkdir(parents=True, exist_ok=True)
    with sync_api.sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=ARGUMENTS)
        yield browser
        browser.close()


@pytest.fixture(scope="module")
def served():
    config = compose_play("port=0", "visitors=2")
    with opened(config, candidates(config.ckpt, config.lqr)) as served:
        yield served


class Guest:
    """A browser window on the page, and the visit that belongs to it."""

    def __init__(self, browser, served, height=1000):
        known = set(served.visits)
        self.page = browser.new_page(viewport={"width": 1360, "height": height})
        self.page.set_default_timeout(1000 * PATIENCE_S)
        self.problems, self.requests = [], []
        self.page.on("console", lambda m: self.problems.append(m.text) if m.type == "error" else None)
        self.page.on("pageerror", lambda error: self.problems.append(str(error)))
        self.page.on("request", lambda request: self.requests.append(request.url))
        self.page.goto(f"http://127.0.0.1:{served.port}")
        self.page.get_by_text("posture").first.wait_for(timeout=1000 * PATIENCE_S)
        self.wait(lambda: set(served.visits) - known)
        (self.number,) = set(served.visits) - known
        self.visit = served.visits[self.number]
        self.session = self.visit.session

    def wait(self, true):
        end = time.monotonic() + PATIENCE_S
        while not true():
            assert time.monotonic() < end, "waited in vain"
            self.page.wait_for_timeout(100)

    def field(self, label):
        return self.page.locator("label", has_text=label).locator("xpath=ancestor::div[.//input][1]").locator("input").last

    def turn(self, label, value):
        self.field(label).fill(str(value))
        self.page.keyboard.press("Enter")

    def press(self, name):
        self.page.get_by_role("button", name=name, exact=True).click()

    def shot(self, name):
        self.page.screenshot(path=SHOTS / f"{name}.png")

    def pixels(self, locator):
        return np.asarray(Image.open(io.BytesIO(locator.screenshot())).convert("RGB"), dtype=float)


@pytest.fixture(scope="module")
def shared(browser, served):
    guest = Guest(browser, served)
    yield guest
    guest.page.close()


@pytest.fixture
def guest(shared):
    """One window for most tests, upright, at 0.3 Hz."""
    if shared.session.paused:
        shared.page.locator("label", has_text="pause").click()
    shared.turn("frequency [Hz]", 0.3)
    shared.press("reset")
    shared.wait(lambda: shared.session.knobs.freq == 0.3 and not shared.session.paused and shared.session.time > 0)
    return shared


def test_the_page_loads_from_this_machine_alone_and_without_errors(guest, served):
    guest.wait(lambda: guest.session.measures().mode != "undefined" and guest.session.theory() is not None)
    guest.page.wait_for_timeout(1000)
    guest.shot("start")
    assert guest.problems == []
    elsewhere = [url for url in guest.requests if not url.startswith((f"http://127.0.0.1:{served.port}", "data:", "blob:"))]
    assert elsewhere == []


@pytest.mark.slow
def test_mode_theory_and_cost_are_told(guest):
    guest.page.locator("[data-mode='in-phase']").wait_for(timeout=1000 * PATIENCE_S)
    guest.wait(lambda: guest.session.time > 20)  # until the motion from standing has been forgotten
    row = guest.page.locator("tr", has_text="switch in theory")
    guest.wait(lambda: "Hz" in row.inner_text())
    told = float(row.inner_text().split()[-2])
    assert told == pytest.approx(guest.session.theory().transition, abs=6e-4)
    ratio = guest.page.locator("tr", has_text="cost / least cost").inner_text().split()[-1]
    assert 0.9 < float(ratio) < 1.6


@pytest.mark.slow
def test_pictures_are_not_blank_and_move(guest):
    guest.wait(lambda: guest.session.time > 1)
    scene = guest.page.locator("canvas").first
    largest = max(guest.page.locator("canvas").all(), key=lambda c: (c.bounding_box() or {"width": 0})["width"])
    first = guest.pixels(largest)
    guest.page.wait_for_timeout(1200)
    second = guest.pixels(largest)
    assert scene is not None and first.std() > 5, "the body is seen"
    assert np.abs(first - second).max() > 50, "it moves"
    orange = ((first[..., 0] > first[..., 2] + 80) & (first[..., 1] > first[..., 2] + 40)).mean()
    assert 0.0005 < orange < 0.05, "target and band are orange, and not everywhere"
    blue = (first[..., 2] > first[..., 0] + 30).mean()
    assert 0.01 < blue < 0.5, "the body is blue"
    charts = guest.page.locator(".uplot-container canvas")
    assert charts.count() == 1
    for chart in charts.all():
        chart.scroll_into_view_if_needed()
        pixels = guest.pixels(chart)
        assert pixels.std() > 5 and pixels.mean() > 200
    assert guest.page.locator("svg[role=img]").count() == 5


@pytest.mark.parametrize(
    ("label", "knob", "value"),
    [
        ("frequency [Hz]", "freq", 0.9),
        ("hip stiffness", "hip_k", 60),
        ("ankle stiffness", "ankle_k", 50),
        ("load [kg]", "load", 4),
        ("amplitude [m]", "amplitude", 0.06),
        ("tolerance [m]", "tolerance", 0.035),
    ],
)
@pytest.mark.slow
def test_sliders_turn_the_knobs(guest, label, knob, value):
    before = getattr(guest.session.knobs, knob)
    guest.turn(label, value)
    guest.wait(lambda: getattr(guest.session.knobs, knob) == value)
    if knob in ("hip_k", "ankle_k", "load"):
        guest.wait(lambda: float(getattr(guest.session._env.sim, knob)) == value)
    guest.turn(label, before)
    guest.wait(lambda: getattr(guest.session.knobs, knob) == before)


@pytest.mark.slow
def test_a_slider_can_be_dragged_and_the_target_does_not_jump(guest):
    track = guest.page.locator("label", has_text="frequency [Hz]").locator("xpath=ancestor::div[.//input][1]")
    box = track.locator("[role=slider]").bounding_box()
    guest.page.mouse.move(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    guest.page.mouse.down()
    guest.page.mouse.move(box["x"] + 60, box["y"] + box["height"] / 2, steps=8)
    guest.page.mouse.up()
    guest.wait(lambda: guest.session.knobs.freq > 0.5)
    guest.page.wait_for_timeout(500)
    target = guest.session.history.last("target", 200)
    # The fastest that the target ever moves: A 2 pi f.
    assert np.abs(np.diff(target)).max() <= 0.1 * 2 * np.pi * 1.5 * 0.0166 + 1e-6


@pytest.mark.slow
def test_what_is_typed_beyond_the_range_stops_at_its_end(guest):
    guest.turn("frequency [Hz]", 9)
    guest.wait(lambda: guest.session.knobs.freq == 1.5)
    guest.wait(lambda: float(guest.field("frequency [Hz]").input_value()) == 1.5)
    assert guest.problems == []


@pytest.mark.slow
def test_buttons(guest):
    guest.press("ramp up")
    guest.wait(lambda: guest.session.knobs.freq > 0.35)
    guest.wait(lambda: float(guest.field("frequency [Hz]").input_value()) > 0.33)  # the slider follows
    guest.press("ramp down")
    guest.wait(lambda: guest.session.ramping == -1)
    guest.press("ramp down")
    guest.wait(lambda: guest.session.ramping == 0)
    guest.press("push")
    guest.wait(lambda: guest.session._pushed == 0)
    guest.page.locator("label", has_text="pause").click()
    guest.wait(lambda: guest.session.paused)
    still = guest.session.time
    guest.page.wait_for_timeout(400)
    assert guest.session.time == still
    guest.page.locator("label", has_text="pause").click()
    guest.wait(lambda: guest.session.time > still)
    guest.press("reset")
    guest.wait(lambda: len(guest.session.history) < 100)


@pytest.mark.slow
def test_slow_motion_is_a_quarter_of_real_time(guest):
    box = guest.page.locator("label", has_text="slow motion")
    box.click()
    guest.wait(lambda: guest.visit._controls.speed == 0.25)
    begun, before = time.monotonic(), guest.session.time
    guest.page.wait_for_timeout(2000)
    share = (guest.session.time - before) / (time.monotonic() - begun)
    box.click()
    assert 0.15 < share < 0.27


@pytest.mark.slow
def test_the_mode_switches_with_the_frequency_and_the_page_says_so(guest):
    guest.turn("frequency [Hz]", 1.2)
    guest.page.locator("[data-mode='anti-phase']").wait_for(timeout=1000 * PATIENCE_S)
    guest.page.wait_for_timeout(6000)
    guest.shot("anti_phase")
    assert guest.session.measures().mode == "anti-phase" and guest.session.falls == 0


@pytest.mark.slow
def test_another_policy_can_be_chosen(guest):
    guest.page.locator("label", has_text="policy").locator("xpath=ancestor::div[.//input][1]").locator("input").first.click()
    guest.page.get_by_role("option", name="pretrained/hip_k-75", exact=True).click()
    guest.wait(lambda: guest.session.pilot == "pretrained/hip_k-75" and guest.session.knobs.hip_k == 75)
    guest.wait(lambda: float(guest.field("hip stiffness").input_value()) == 75)
    guest.page.locator("label", has_text="policy").locator("xpath=ancestor::div[.//input][1]").locator("input").first.click()
    guest.page.get_by_role("option", name="lqr", exact=True).click()
    guest.wait(lambda: guest.session.pilot == "lqr")
    guest.wait(lambda: guest.session.note == "" and guest.session.time > 3)
    guest.shot("lqr")
    guest.page.locator("label", has_text="policy").locator("xpath=ancestor::div[.//input][1]").locator("input").first.click()
    guest.page.get_by_role("option", name="pretrained/default", exact=True).click()
    guest.wait(lambda: guest.session.pilot == "pretrained/default")
    assert guest.problems == []


@pytest.mark.slow
def test_two_visitors_have_a_stander_each_and_a_third_is_told(guest, browser, served):
    other = Guest(browser, served, height=400)
    assert other.session is not guest.session
    other.turn("frequency [Hz]", 1.1)
    other.wait(lambda: other.session.knobs.freq == 1.1)
    assert guest.session.knobs.freq == 0.3 and float(guest.field("frequency [Hz]").input_value()) == 0.3
    third = browser.new_page(viewport={"width": 800, "height": 400})
    third.goto(f"http://127.0.0.1:{served.port}")
    third.get_by_text("2 visitors are here already").wait_for(timeout=1000 * PATIENCE_S)
    third.close()
    other.page.close()
    guest.wait(lambda: other.number not in served.visits)
    other.visit.join(timeout=10)
    assert not other.visit.is_alive(), "nothing goes on for one who has left"


@pytest.mark.slow
def test_it_keeps_up_with_real_time(guest):
    begun, before = time.monotonic(), guest.session.time
    guest.page.wait_for_timeout(4000)
    # Never faster; slower where the machine has much else to do. benchmarks/play.py measures it.
    assert 0.7 < (guest.session.time - before) / (time.monotonic() - begun) < 1.02


@pytest.mark.slow
def test_a_recording_plays_without_python(browser, tmp_path):
    config = compose_play("record=x.html", "recording.freq=[0.7,0.75]", "recording.hold=2", "frames_per_s=10")
    path = tmp_path / "session.html"
    record(config, path)
    page = browser.new_page(viewport={"width": 1000, "height": 700})
    problems, requests = [], []
    page.on("console", lambda message: problems.append(message.text) if message.type == "error" else None)
    page.on("pageerror", lambda error: problems.append(str(error)))
    page.on("request", lambda request: requests.append(request.url[:100]))
    page.goto(path.as_uri())
    page.locator(".mantine-Slider-root").wait_for(timeout=1000 * PATIENCE_S)
    end, blue = time.monotonic() + PATIENCE_S, 0.0
    while not 0.01 < blue < 0.5:  # the scene fades in; the body is blue
        assert time.monotonic() < end, "the body is not seen"
        page.wait_for_timeout(500)
        page.screenshot(path=SHOTS / "recording.png")
        pixels = np.asarray(Image.open(SHOTS / "recording.png").convert("RGB"), dtype=float)
        blue = (pixels[..., 2] > pixels[..., 0] + 30).mean()
    assert problems == []
    assert [url for url in requests if not url.startswith(("data:", "blob:", path.as_uri()))] == []
    page.close()
