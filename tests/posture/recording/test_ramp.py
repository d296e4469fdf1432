"""A switch at a known frequency, found by windows and as a change point; an exported ramp as its evaluation has it."""

import math

import numpy as np
import pytest

from envs.config import Ramp
from posture.analysis.ramp import transitions
from posture.config.errors import ConfigError
from posture.export.trajectory_files import write_csv
from posture.recording.ramp import change_point, course_and_transitions, follow
from posture.recording.signals import prepare
from posture.recording.trial import analyse
from tests.posture.analysis.trials import DT, TIME, trial
from tests.posture.recording.people import ANKLE, HEAD, HIP, config, recording, times


def ramped(start, rate, switch, time=None, **changes):
    """A motion that is in-phase below the frequency `switch` [Hz], and in anti-phase above it."""
    t = times(40.0) if time is None else time
    phase = 2 * math.pi * (start * t + rate * t**2 / 2)
    sign = np.where(start + rate * t < switch, 1.0, -1.0)
    head = HEAD * (1 - np.cos(phase))
    fields = {"hip": HIP * sign * np.cos(phase), "ankle": ANKLE * np.cos(phase), "head": head, "target": head}
    return recording(time=t, **{**fields, **changes})


@pytest.mark.parametrize(("start", "rate"), [(0.2, 0.02), (1.0, -0.02)])
@pytest.mark.parametrize("estimated", [True, False])
def test_a_sudden_switch_while_the_frequency_rises_or_falls(start, rate, estimated):
    """The change point is the switch. A centred window of 5 s is half on either side of it, up to a part of a cycle; a
    trailing one sees it half a window, 2.5 s, later."""
    one = ramped(start, rate, 0.6)
    freq = follow(one, None if estimated else Ramp(start=start, rate=rate, duration=40.0))
    course, found, change = course_and_transitions(one, freq, 5.0, math.radians(0.5))
    slack = 0.02 if estimated else 0.01
    assert change.change_point_hz == pytest.approx(0.6, abs=slack)
    assert change.change_point_s == pytest.approx(20.0, abs=0.5)
    assert found.transition_centred_hz == pytest.approx(0.6, abs=slack + 0.01)
    assert found.transition_trailing_hz == pytest.approx(0.6 + 2.5 * rate, abs=slack + 0.01)
    assert found.crossings_centred == found.crossings_trailing == 1
    assert len(course.freq) == len(course.r) == len(course.phase) == len(course.time) == 2000  # every second of 100 Hz
    assert np.nanmean(np.abs(course.phase[(course.freq > 0.25) & (course.freq < 0.5)])) < 10


def test_no_switch():
    one = ramped(0.2, 0.02, 2.0)
    course, found, change = course_and_transitions(one, follow(one, None), 5.0, math.radians(0.5))
    assert math.isnan(found.transition_centred_hz) and math.isnan(change.change_point_hz)
    assert np.nanmin(course.r) > 0.9


def test_the_change_point_by_brute_force():
    """That of ruptures, against all ways to divide the sequence in two."""
    draw = np.random.default_rng(1)
    time = np.arange(60) / 10.0
    phase = np.where(np.arange(60) < 37, 10.0, 165.0) + draw.normal(scale=40.0, size=60)
    direction = np.exp(1j * np.radians(phase))
    cost = [
        sum(float(np.sum(np.abs(part - part.mean()) ** 2)) for part in (direction[:k], direction[k:])) for k in range(2, 59)
    ]
    best = 2 + int(np.argmin(cost))
    assert change_point(time, 0.1 * time, phase).change_point_s == pytest.approx(time[(2 * best - 1) // 2])


def test_an_exported_ramp_has_the_transitions_of_its_evaluation(tmp_path):
    """The window is that of the paper, 300 control steps."""
    phase = 2 * math.pi * 0.015 * TIME**2 / 2
    sign = np.where(0.015 * TIME < 0.5, 1.0, -1.0)
    hip, ankle, head = sign * 0.1 * np.cos(phase), 0.05 * np.cos(phase), 0.1 - 0.1 * np.cos(phase)
    made = trial(
        math.nan,
        joint_angle=np.stack([hip, ankle, hip, ankle], axis=-1)[:, None],
        target_x=head[:, None],
        head_x=head[:, None],
    )
    write_csv(made, 0, tmp_path / "ramp.csv")
    (expected,) = transitions(made, 0.0, 0.015, 100.0, 300, math.radians(0.5))
    given = "ramp={start: 0.0, rate: 0.015, duration: 100.0}"
    found = analyse(tmp_path / "ramp.csv", config(given, f"window={300 * DT!r}")).trial
    assert found.indices.ramp == expected and expected.transition_centred_hz == pytest.approx(0.5, abs=0.02)
    assert found.freq_from == "ramp" and math.isnan(found.indices.freq_hz)


def test_what_cannot_be_told():
    with pytest.raises(ConfigError, match="has neither target nor head"):
        follow(recording(head=None, target=None), None)
    with pytest.raises(ConfigError, match="fewer than three strokes"):
        follow(recording(target=np.zeros(4000)), None)


@pytest.mark.parametrize(("samples", "every", "override"), [(1, 4000, "detrend=true"), (5, 100, "low_pass=5.0")])
def test_a_target_of_which_preparation_leaves_nothing(samples, every, override):
    """A single number, and stretches too short for a filter."""
    target = np.where(np.arange(4000) % every < samples, 0.1, math.nan)
    prepared = prepare(recording(target=target), config(override))
    assert np.isnan(prepared.target).all()
    with pytest.raises(ConfigError, match="fewer than three strokes"):
        follow(prepared, None)
