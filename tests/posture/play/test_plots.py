"""Numbers and charts of the page: the text shown, and the data of each chart by hand arithmetic."""

import math
from xml.etree import ElementTree

import numpy as np
import pytest

from posture.drawing.style import MODE_COLOUR
from posture.play.measures import Measures, TrailPoint
from posture.play.plots import Plots, headline, loop, numbers, trail
from posture.play.server import quiet_server, stop_quietly
from posture.play.theory_worker import LeastCost
from tests.posture.play.sessions import advance, compose_play, new_session

UNDEFINED = Measures(window=5.0, freq=math.nan, r=math.nan, cost=math.nan, error=math.nan, beyond=math.nan)
ANTI_PHASE = Measures(window=5.0, freq=0.5, r=-0.8, cost=0.03, error=0.012, beyond=0.25)
LEAST = LeastCost(freq=np.array([0.0, 1.0]), cost=np.array([0.02, 0.03]), transition=0.656)
INFEASIBLE = LeastCost(freq=np.array([0.0, 1.0]), cost=np.array([0.02, math.nan]), transition=None)


def text(html):
    return " ".join("".join(ElementTree.fromstring(f"<x>{html}</x>").itertext()).split())


@pytest.mark.parametrize(
    ("measures", "fallen", "paused", "colour", "parts"),
    [
        (ANTI_PHASE, False, False, "anti-phase", ["anti-phase", "-0.80", "0.500 Hz, rising"]),
        (UNDEFINED, False, True, "undefined", ["undefined", "not yet defined", "paused"]),
        (ANTI_PHASE, True, False, None, ["fallen"]),
    ],
)
def test_headline(measures, fallen, paused, colour, parts):
    html = headline(measures, fallen, paused, 1, 0.5)
    assert [part for part in parts if part not in text(html)] == []
    assert colour is None or MODE_COLOUR[colour] in html


@pytest.mark.parametrize(
    ("measures", "theory", "parts"),
    [
        # At 0.5 Hz half-way between 0.02 and 0.03: 0.025; 0.03 / 0.025 = 1.2.
        (ANTI_PHASE, LEAST, ["0.656 Hz", "0.0300", "0.0250", "1.20", "12.0 mm", "25 % of time", "12 mm / 2"]),
        (ANTI_PHASE, None, ["computing… cost", "<planning>"]),
        (ANTI_PHASE, INFEASIBLE, ["none", "no feasible motion"]),
        (UNDEFINED, LEAST, ["–"]),
    ],
)
def test_numbers(measures, theory, parts):
    shown = text(numbers(measures, theory, "<planning>", 2, 0.0123).replace("</td>", " </td>"))
    assert [part for part in parts if part not in shown] == []


@pytest.mark.parametrize(("sign", "mode", "column"), [(1, "in-phase", 1), (-1, "anti-phase", 2), (1, "undefined", 3)])
def test_loop(sign, mode, column):
    ankle = np.radians([-5, 5, 0, 2])
    data = loop(ankle, 3 * sign * ankle, mode)
    assert data[0] == pytest.approx([-5, 0, 2, 5]) and data[column] == pytest.approx(3 * sign * data[0])
    assert np.isnan([data[other] for other in {1, 2, 3} - {column}]).all()
    assert data[4] == pytest.approx([math.nan, math.nan, 6 * sign, math.nan], nan_ok=True)  # 2 deg is the newest
    assert loop(np.radians([-90, 90]), ankle[:2], mode)[0] == pytest.approx([-16, 8])  # at the edges


def test_trail():
    data = trail([TrailPoint(0.9, 0.5, 1), TrailPoint(0.3, -0.5, -1), TrailPoint(0.4, 0.1, 0)], 0.656)
    nan = math.nan
    freq, rising, falling, constant, line = [0.3, 0.4, 0.656, 0.656, 0.9], [nan] * 5, [nan] * 5, [nan] * 5, [nan] * 5
    rising[4], falling[0], constant[1], line[2:4] = 0.5, -0.5, 0.1, [-1, 1]
    for column, values in zip(data, [freq, rising, falling, constant, line], strict=True):
        assert column == pytest.approx(values, nan_ok=True)


@pytest.fixture(scope="module")
def gui():
    server = quiet_server(0)
    yield server.gui
    stop_quietly(server)


def test_charts_show_the_session(gui, body):
    session = new_session(body)
    plots = Plots(gui, compose_play(), session.sole)
    plots.refresh(session)  # nothing to show yet
    for _ in range(3):
        advance(session, 6.0)
        plots.refresh(session)
    history = session.history
    for i, (signal, factor) in enumerate({"hip": 180 / math.pi, "ankle": 180 / math.pi}.items(), 1):
        assert plots.angles.data[i][-1] == pytest.approx(factor * history.last(signal, 1)[0])
    assert -10 <= plots.angles.data[0][0] < -9.9 and plots.angles.data[0][-1] == 0  # the present is on the right
    heel, toe, cop = plots.pressure.data[1:]
    assert (heel[0], toe[0]) == pytest.approx([1e3 * end for end in session.sole])
    assert cop[-1] == pytest.approx(1e3 * session.state.cop) and (heel < cop).all() and (cop < toe).all()
    measures, theory = session.measures(), session.theory()
    time, in_phase, anti_phase = plots.correlation.data
    assert time[-1] == 0 and in_phase[-1] == measures.r and np.isnan(anti_phase[-1])
    assert [column[-1] for column in plots.cost.data[1:]] == [theory.at(measures.freq), measures.cost]
    (low, high) = plots.cost.scales["y"]["range"]
    assert low == 0 and high / 5 < np.nanmax(plots.cost.data[1:]) <= high
    count = len(plots.cost.data[0])
    plots.refresh(session)
    assert len(plots.cost.data[0]) == count  # no new point while paused
