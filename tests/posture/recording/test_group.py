"""Subjects and frequencies together, by hand."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from posture.analysis.results import RampTransitions
from posture.config.errors import ConfigError
from posture.recording.group import conditions, group
from posture.recording.indices import Cycles, Indices
from posture.recording.tables import group_columns
from posture.recording.trial import Trial, subject_of


def trial(subject, freq, phases, r):
    indices = Indices(duration_s=30.0, rate_hz=50.0, missing_share=0.0, freq_hz=freq, hip_ankle_r=r)
    angles = np.array(phases, dtype=float)
    return Trial(
        Path(f"{subject}.csv"), subject, "target", 1.0, indices, Cycles(np.arange(len(angles)), {"phase_deg": angles})
    )


def test_each_subject_counts_once():
    trials = [
        trial("A", 0.30, [170, 170, 170, 170], -0.9),
        trial("A", 0.31, [-170, -170, -170, -170], -0.9),
        trial("B", 0.30, [160], -0.5),
        trial("C", 0.9, [10], 0.8),
    ]
    rows = group(trials, 0.03)
    assert [(row.subject, row.recordings, row.subjects) for row in rows] == [
        ("A", 2, 1), ("B", 1, 1), ("all", 3, 2), ("C", 1, 1), ("all", 1, 1),
    ]  # fmt: skip
    a, b, together = rows[:3]
    assert a.phase_mean_deg == pytest.approx(180, abs=1e-9) or a.phase_mean_deg == pytest.approx(-180, abs=1e-9)
    assert a.phase_resultant == pytest.approx(math.cos(math.radians(10)))
    assert together.phase_mean_deg == pytest.approx(170)  # between 180 and 160, not weighted by cycles
    assert together.freq_hz == pytest.approx(0.91 / 3)
    # Fisher: artanh 0.9 = 1.4722, artanh 0.5 = 0.5493, mean 1.0108, tanh of it 0.7661.
    assert together.r_mean == pytest.approx(-0.7661, abs=1e-4)
    assert math.isnan(b.r_low) and together.r_low < -0.9 < -0.5 < together.r_high


def test_conditions_are_close_to_their_lowest_frequency_and_ramps_are_last():
    trials = [trial("A", freq, [0], 1.0) for freq in (0.36, math.nan, 0.30, 0.32, 0.34, math.nan)]
    found = [[one.indices.freq_hz for one in own] for own in conditions(trials, 0.05)]
    assert found[:2] == [[0.30, 0.32, 0.34], [0.36]] and len(found) == 3 and len(found[2]) == 2


def test_transitions_of_ramps():
    """0.6 and 0.7 Hz: mean 0.65, sd 0.0707, Student's t for 1 degree of freedom 12.7062, so 0.65 -+ 12.7062 x 0.05."""
    trials = []
    for subject, freq in (("A", 0.6), ("B", 0.7)):
        one = trial(subject, math.nan, [], 0.0)
        trials.append(replace(one, indices=replace(one.indices, ramp=RampTransitions(transition_centred_hz=freq))))
    *_, together = group(trials, 0.03)
    assert together.transition_mean_hz == pytest.approx(0.65)
    assert together.transition_high_hz - together.transition_mean_hz == pytest.approx(0.63531, abs=1e-4)
    headings = [column.heading for column in group_columns([together])]
    assert "centred f* [Hz]" in headings and "Rayleigh p" not in headings


def test_subjects_of_paths():
    path = Path("data/S07/fast_2.csv")
    assert subject_of(path, None) == "fast_2"
    assert subject_of(path, r"S\d+") == "S07" and subject_of(path, r"S(\d+)") == "07"
    with pytest.raises(ConfigError, match="finds nothing in it"):
        subject_of(path, "P.")
