"""The figures show the numbers."""

import math

import numpy as np
import pytest

from posture.recording.figures import group_figure, png, recording_figure
from posture.recording.group import group
from posture.recording.indices import measure
from posture.recording.trial import Analysed, Trial
from tests.posture.recording.people import ANKLE, HIP, recording, times
from tests.posture.recording.test_group import trial

SETTINGS = {"transient_s": 10.0, "tolerance_m": 0.025, "still_joint_deg": 0.5, "torque_limit": 100.0}


def analysed(**changes):
    one = recording(0.5, 160.0, times(40.0), **changes)
    return Analysed(Trial(one.path, "S1", "target", 1.0, *measure(one, 0.5, **SETTINGS)), one)


def test_a_recording():
    figure = recording_figure(analysed())
    over_time, loop, head, phases = figure.axes
    time, hip = over_time.lines[0].get_data()
    assert time[0] == pytest.approx(34.0, abs=0.02) and time[-1] == pytest.approx(39.99)  # three cycles of 2 s
    assert np.ptp(hip) == pytest.approx(math.degrees(2 * HIP), rel=1e-3)
    assert np.ptp(loop.lines[0].get_xdata()) == pytest.approx(math.degrees(2 * ANKLE), rel=1e-3)
    assert "r = -0.94, anti-phase" in loop.get_title()
    assert [text.get_text() for text in head.get_legend().get_texts()] == ["target", "head"]
    np.testing.assert_allclose(phases.lines[0].get_ydata(), 160.0, atol=0.1)
    assert png(figure).startswith(b"\x89PNG")
    without = recording_figure(analysed(head=None, target=None))
    assert not without.axes[2].axison and without.axes[2].get_title() == "no head recorded"


def test_a_group():
    """Bars of 15 deg whose areas are proportional to counts: 4 cycles in the highest, one in another is half as long."""
    trials = [trial("A", 0.3, [2, 3, 4, 5, 92], 0.9), trial("B", 0.3, [2, 3, 4, 5], 0.7), trial("A", 0.9, [170], -0.9)]
    rows = group(trials, 0.03)
    rose, correlations, phases = group_figure(trials, rows, lambda freq: 1 - 2 * freq).axes
    heights = {round(math.degrees(bar.get_x())): bar.get_height() for bar in rose.patches if bar.get_height() > 0}
    assert heights == pytest.approx({0: 1.0, 90: math.sqrt(1 / 8), 165: math.sqrt(1 / 8)})
    assert len(rose.texts) == 2  # an arrow for each frequency
    (together,) = [row for row in rows if row.subject == "all" and row.freq_hz == 0.3]
    means = correlations.containers[0].lines[0]
    np.testing.assert_allclose(means.get_data(), [[0.3, 0.9], [together.r_mean, -0.9]], atol=1e-6)
    theory = [line for line in correlations.lines if line.get_label() == "least torque"]
    np.testing.assert_allclose(theory[0].get_ydata()[[0, -1]], [0.4, -0.8])
    np.testing.assert_allclose(phases.containers[0].lines[0].get_ydata()[1], 170.0)


def test_whatever_a_user_has_set_for_matplotlib():
    import matplotlib

    plain = png(recording_figure(analysed()))
    with matplotlib.rc_context({"savefig.facecolor": "black", "savefig.dpi": 50, "lines.linewidth": 6.0, "font.size": 20}):
        assert png(recording_figure(analysed())) == plain
