"""Measures of sinusoidal motions, by hand arithmetic."""

import math

import pytest

from posture.play.measures import History, Trail, measure
from tests.posture.play.sessions import DT


def sinusoid(freq, sign=1, steps=2000, cost=lambda angle: 0.5):
    """A history in which the ankle moves with the hip (`sign` 1) or against it (-1)."""
    history = History(1500)
    for i in range(steps):
        angle = 2 * math.pi * freq * i * DT
        sway = math.sin(angle)
        history.append(i * DT, freq, 0.1 * sway, sign * 0.05 * sway, 0.0, 0.03 * (i % 2), 0.01, cost(angle))
    return history


@pytest.mark.parametrize(("sign", "mode"), [(1, "in-phase"), (-1, "anti-phase")])
def test_measures_of_a_sinusoid(sign, mode):
    found = measure(sinusoid(1.0, sign), DT, 300, 0.01, 0.02)
    assert found.r == pytest.approx(sign) and found.mode == mode
    assert found.cost == 0.5 and found.freq == pytest.approx(1.0) and found.window == pytest.approx(300 * DT)
    assert found.error == pytest.approx(0.03 / math.sqrt(2)) and found.beyond == 0.5


@pytest.mark.parametrize("steps", range(400, 650, 25))
def test_cost_is_the_mean_over_whole_cycles(steps):
    """At 0.3 Hz the window of 300 steps holds 1.5 cycles: the mean of 1 + sin is 1 over a cycle, 1.6 over half of one."""
    history = sinusoid(0.3, steps=steps, cost=lambda angle: 1 + math.sin(angle))
    assert measure(history, DT, 300, 0.01, 0.02).cost == pytest.approx(1.0, abs=0.01)


def test_window_is_at_least_one_cycle():
    assert measure(sinusoid(0.1), DT, 300, 0.01, 0.02).window == pytest.approx(10.0, abs=DT)


@pytest.mark.parametrize(
    ("history", "still"), [(sinusoid(1.0, steps=299), 0.01), (sinusoid(1.0), 0.2), (History(10), 0.01)],
    ids=["window not full", "joints still", "empty"],
)  # fmt: skip
def test_mode_is_undefined(history, still):
    measures, trail = measure(history, DT, 300, still, 0.02), Trail()
    trail.add(measures, 1)
    assert measures.mode == "undefined" and not trail.points


def test_history_keeps_the_last_samples():
    history = History(7)
    for i in range(40):
        history.append(*(float(i + k) for k in range(8)))
        assert history.last("time", 5).tolist() == list(range(max(0, i - 4), i + 1))
        assert history.last("freq", 100).tolist() == [1 + j for j in range(max(0, i - 6), i + 1)]
