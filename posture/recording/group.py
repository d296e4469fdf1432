"""Several recordings together: each subject, and all of them, at each frequency."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from posture.analysis.coordination import circular_mean_sd
from posture.analysis.statistics import mean_interval
from posture.analysis.trajectory import Array
from posture.recording.circular import mean_half_width, rayleigh_p, resultant_length
from posture.recording.indices import mean_correlation
from posture.recording.trial import Trial

ALL = "all"
"""In place of a subject: all of them."""


@dataclass(frozen=True)
class GroupRow:
    """One subject, or all subjects, at one frequency.

    Of a subject, the relative phase is that of all cycles, and r of the recordings. Of all subjects, both are of the
    subjects' means, so that each counts once. phase_low, phase_high: 95 % interval of the mean direction. rayleigh_p:
    probability by chance of directions that are this much alike; cycles that follow one another are not independent, so
    that it is too small for a single subject. r_mean, r_low, r_high: mean and 95 % interval by Fisher's transformation.
    transition_..: of ramps, the frequency at which the correlation in the centred window changes its sign, mean and 95 %
    interval by Student's t.
    """

    freq_hz: float  # mean of the recordings; nan for ramps
    subject: str
    subjects: int
    recordings: int
    phase_mean_deg: float
    phase_sd_deg: float
    phase_low_deg: float
    phase_high_deg: float
    phase_resultant: float
    rayleigh_p: float
    r_mean: float
    r_low: float
    r_high: float
    transition_mean_hz: float
    transition_low_hz: float
    transition_high_hz: float


def group(trials: Sequence[Trial], same_freq: float) -> list[GroupRow]:
    """The rows of each frequency, from low to high: one for each subject, then one for all. Frequencies within `same_freq`
    [Hz] of the lowest of a group belong together; ramps come last, by themselves."""
    rows = []
    for own in conditions(trials, same_freq):
        freq = float(np.mean([trial.indices.freq_hz for trial in own]))
        subjects = list(dict.fromkeys(trial.subject for trial in own))
        of_each = []
        for subject in subjects:
            mine = [trial for trial in own if trial.subject == subject]
            phases = np.concatenate([trial.cycles.values.get("phase_deg", np.empty(0)) for trial in mine])
            r = [trial.indices.hip_ankle_r for trial in mine]
            switches = [trial.indices.ramp.transition_centred_hz for trial in mine]
            of_each.append(_row(freq, subject, 1, len(mine), phases, r, switches))
        means = np.array([row.phase_mean_deg for row in of_each])
        r, switches = [row.r_mean for row in of_each], [row.transition_mean_hz for row in of_each]
        rows += [*of_each, _row(freq, ALL, len(subjects), len(own), means, r, switches)]
    return rows


def conditions(trials: Sequence[Trial], same_freq: float) -> list[list[Trial]]:
    """The recordings of each frequency, from low to high."""
    found: list[list[Trial]] = []
    for trial in sorted(trials, key=lambda one: (math.isnan(one.indices.freq_hz), one.indices.freq_hz)):
        first = found[-1][0].indices.freq_hz if found else math.inf
        freq = trial.indices.freq_hz
        if found and (freq - first <= same_freq or (math.isnan(freq) and math.isnan(first))):
            found[-1].append(trial)
        else:
            found.append([trial])
    return found


def _row(
    freq: float, subject: str, subjects: int, recordings: int, phases: Array, r: Sequence[float], switches: Sequence[float]
) -> GroupRow:
    mean, sd = circular_mean_sd(phases)
    half = mean_half_width(phases)
    found, switch = mean_correlation(r), mean_interval(switches)
    return GroupRow(
        freq_hz=freq,
        subject=subject,
        subjects=subjects,
        recordings=recordings,
        phase_mean_deg=mean,
        phase_sd_deg=sd,
        phase_low_deg=mean - half,
        phase_high_deg=mean + half,
        phase_resultant=resultant_length(phases),
        rayleigh_p=rayleigh_p(phases),
        r_mean=found.mean,
        r_low=found.low,
        r_high=found.high,
        transition_mean_hz=switch.mean,
        transition_low_hz=switch.low,
        transition_high_hz=switch.high,
    )
