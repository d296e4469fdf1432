"""What the page draws: well-formed, in the colours of the modes, and each mark at its place by hand arithmetic."""

import math
import re
from xml.etree import ElementTree

import numpy as np
import pytest

from posture.drawing.style import MODE_COLOUR
from posture.play import plots
from posture.play.measures import Measures
from posture.play.theory import Least

NOTHING = Measures(window=5.0, freq=math.nan, r=math.nan, cost=math.nan, error=math.nan, beyond=math.nan)
SOME = Measures(window=5.0, freq=0.5, r=-0.8, cost=0.03, error=0.012, beyond=0.25)
LEAST = Least(freq=np.array([0.0, 1.0]), cost=np.array([0.02, 0.03]), transition=0.656)
SOLE = (-0.06, 0.13)


def text(html):
    return " ".join("".join(ElementTree.fromstring(_plain(html)).itertext()).split())


def _plain(html):
    return f"<x>{html}</x>"


def test_the_headline_names_the_mode_in_its_colour():
    html = plots.headline(SOME, fallen=False, paused=False, ramping=1, freq=0.5)
    assert "anti-phase" in text(html) and "-0.80" in text(html) and "0.500 Hz, rising" in text(html)
    assert MODE_COLOUR["anti-phase"] in html
    assert "undefined" in text(plots.headline(NOTHING, fallen=False, paused=True, ramping=0, freq=0.5))
    assert "fallen" in text(plots.headline(SOME, fallen=True, paused=False, ramping=0, freq=0.5))


def test_numbers_beside_theory():
    told = text(plots.numbers(SOME, LEAST, "", 2, 0.0123))
    # At 0.5 Hz half-way between 0.02 and 0.03: 0.025; 0.03 / 0.025 = 1.2.
    for part in ("0.656 Hz", "0.0300", "0.0250", "1.20", "12.0 mm", "25 % of time", "12 mm / 2"):
        assert part in told


def test_numbers_say_what_is_not_known():
    waiting = text(plots.numbers(SOME, None, "planning <its> motion".replace("<", "").replace(">", ""), 0, 0.0))
    assert waiting.count("computing") == 3 and "planning its motion" in waiting
    none = Least(freq=np.array([0.0, 1.0]), cost=np.array([0.02, math.nan]), transition=None)
    assert "none" in text(plots.numbers(SOME, none, "", 0, 0.0))
    assert "no motion keeps foot and tolerance" in text(plots.numbers(SOME, none, "", 0, 0.0))
    text(plots.numbers(NOTHING, LEAST, "", 0, 0.0))
    assert "&lt;b&gt;" in plots.numbers(SOME, None, "<b>", 0, 0.0), "what a pilot says is no markup"


@pytest.mark.parametrize("count", [0, 1, 2, 1205])
def test_pictures_are_well_formed_however_little_there_is(count):
    wave = np.sin(np.linspace(0, 6, count))
    for picture in (
        plots.angle_angle(0.5 * wave, -0.1 * wave, "anti-phase"),
        plots.hysteresis([(0.5, r, 1) for r in wave], 0.656, (0.05, 1.5)),
        plots.foot(0.05 * wave, SOLE),
        plots.foot(np.full(count, np.nan), SOLE),
    ):
        ElementTree.fromstring(plots.row(picture))


def test_anti_phase_falls_to_the_right():
    wave = np.radians(np.linspace(-5, 5, 11))
    for sign, mode in ((1, "in-phase"), (-1, "anti-phase")):
        drawn = re.search(r'<polyline points="([^"]*)"', plots.angle_angle(sign * wave, wave, mode)).group(1)
        points = np.array([[float(x) for x in pair.split(",")] for pair in drawn.split()])
        points = points[np.argsort(points[:, 0])]
        assert (np.diff(points[:, 1]) * sign <= 0).all(), "y grows downwards on a screen"
        assert MODE_COLOUR[mode] in plots.angle_angle(sign * wave, wave, mode)


def test_the_centre_of_pressure_is_drawn_at_its_place_in_the_foot():
    picture = ElementTree.fromstring(plots.foot(np.array([-0.06, 0.13, 0.035]), SOLE))
    sole, span = picture.findall("{*}rect") or picture.findall("rect")
    dot = next(circle for circle in picture.iter() if circle.tag.endswith("circle"))
    left, width = float(sole.get("x")), float(sole.get("width"))
    assert float(dot.get("cx")) == pytest.approx(left + width / 2, abs=0.2), "0.035 m is half-way from heel to toe"
    assert float(span.get("x")) == pytest.approx(left, abs=0.2)
    assert float(span.get("width")) == pytest.approx(width, abs=0.2)


def test_the_switch_of_the_theory_is_drawn_among_the_frequencies():
    picture = plots.hysteresis([(0.656, 0.0, 1), (0.656, 0.5, -1)], 0.656, (0.05, 1.5))
    line = float(re.search(r'd="M([\d.]+) [\d.]+V[\d.]+" stroke="#333"', picture).group(1))
    places = [float(x) for x in re.findall(r'circle cx="([\d.]+)"', picture)]
    assert places == pytest.approx([line, line], abs=0.1)
    assert plots.RISING in picture and plots.FALLING in picture


def test_a_gap_in_a_strip_stays_a_gap_and_the_present_is_to_the_right():
    ago = np.array([-30.0, -20.0, -15.0, -10.0, 0.0])
    picture = plots.strip("r", ago, [(np.array([1.0, -1.0, math.nan, 0.0, 1.0]), "#123456")], 30.0, (-1.0, 1.0))
    path = re.search(r'd="([^"]*)" fill="none" stroke="#123456"', picture).group(1)
    assert path.count("M") == 2 and path.count("L") == 2
    points = np.array([[float(x) for x in pair.split()] for pair in re.split("[ML]", path)[1:]])
    first, last = points[0], points[-1]
    assert first[0] == 34 and last[0] == 2 * plots.SQUARE - 8 and first[1] == last[1] == 18
    assert points[2] == pytest.approx([34 + (2 * plots.SQUARE - 42) * 2 / 3, 52], abs=0.1)
    ElementTree.fromstring(plots.row(picture))
    ElementTree.fromstring(plots.strip("cost", ago[:0], [(ago[:0], "red"), (ago[:0], "blue")], 30.0, None))
