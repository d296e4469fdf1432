"""What the trials of all seeds say together, beside what is reported of people."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from posture.analysis.coordination import circular_mean_sd, sign_change_frequency
from posture.analysis.statistics import mean_interval
from posture.dynamics.measures import FluctuationRow, RelaxationRow, SwitchRow

LITERATURE = {
    "head_tracking": "Bardy et al. 2002, tracking a target with the head: hysteresis",
    "platform": "Ko et al. 2003, standing on a moving platform: no hysteresis",
    "ramp": "",
    "fluctuation": "Bardy et al. 2002: critical fluctuations, the relative phase varies most near the switch",
    "phase_relaxation": "Bardy et al. 2002: critical slowing down, recovery takes longest near the switch",
    "angle_relaxation": "",
    "slow_mode": "Faugloire et al. 2006: in-phase near 20 deg",
    "fast_mode": "Faugloire et al. 2006: anti-phase near 180 deg",
}
"""What the abstracts say of people."""

NEGLIGIBLE_HZ = 0.01
"""Where all of the interval is smaller, there is none that counts [Hz]; the steps of a staircase are 0.05 Hz or more."""
NEGLIGIBLE_DEG = 1.0
"""Where the relative phase varies less than this at every frequency, it is not said to fluctuate [deg]."""


@dataclass(frozen=True)
class Finding:
    """A number with its 95 % interval: over the seeds where there are several, else over the repeats; nan without one.

    name: hysteresis_<course>, width [Hz], positive where each mode lasts beyond the other's switch; fluctuation,
    phase_relaxation and angle_relaxation, ratio [-] of the value near the switch to that elsewhere; slow_mode and fast_mode,
    relative phase hip - ankle [deg]. found: what it means. people: what is reported of people.
    """

    name: str
    seeds: int
    value: float
    low: float
    high: float
    found: str
    people: str


def findings(
    switches: Sequence[SwitchRow], fluctuation: Sequence[FluctuationRow], relaxation: Sequence[RelaxationRow], near: float
) -> list[Finding]:
    """Everything that can be said of these rows; `near` [Hz] is how far from the switch "near" reaches."""
    found = [_hysteresis(course, switches) for course in dict.fromkeys(row.course for row in switches)]
    where = switch_of_seeds(fluctuation)
    if fluctuation:
        found.append(_peak("fluctuation", [(row.seed, row.freq_hz, row.phase_sd_deg) for row in fluctuation], where, near))
        found += [
            _mode(name, fluctuation, where, near, above) for name, above in (("slow_mode", False), ("fast_mode", True))
        ]
    if relaxation and fluctuation:
        for name in ("phase", "angle"):
            times = [(row.seed, row.freq_hz, getattr(row, f"{name}_relaxation_s")) for row in relaxation]
            found.append(_peak(f"{name}_relaxation", times, where, near))
    return found


def switch_of_seeds(rows: Sequence[FluctuationRow]) -> dict[int, float]:
    """By seed, the frequency at which the correlation at constant frequencies changes its sign [Hz]; nan without one."""
    found = {}
    for seed in dict.fromkeys(row.seed for row in rows):
        own = [row for row in rows if row.seed == seed]
        freq = sign_change_frequency([row.freq_hz for row in own], [row.hip_ankle_r for row in own])
        found[seed] = math.nan if freq is None else freq
    return found


def _hysteresis(course: str, switches: Sequence[SwitchRow]) -> Finding:
    own = [row for row in switches if row.course == course]
    seeds = {row.seed: [one.width_hz for one in own if one.seed == row.seed] for row in own}
    value, low, high = _interval(list(seeds.values()))
    if max(abs(low), abs(high)) < NEGLIGIBLE_HZ:
        meaning = f"no hysteresis of {NEGLIGIBLE_HZ:g} Hz or more"
    elif math.isnan(low):
        meaning = "-" if math.isnan(value) else "no interval: one trial"
    elif low > 0:
        meaning = "hysteresis: each mode lasts beyond the other's switch"
    elif high < 0:
        meaning = "reversed: each mode ends before the other's switch"
    else:
        meaning = "no hysteresis that could be told from zero"
    return Finding(f"hysteresis_{course}", len(seeds), value, low, high, meaning, LITERATURE.get(course, ""))


def _peak(name: str, points: Sequence[tuple[int, float, float]], where: dict[int, float], near: float) -> Finding:
    """The mean of a quantity at frequencies near the switch over that elsewhere; points: seed, frequency [Hz], value."""
    ratios = []
    for seed, switch in where.items():
        own = [(abs(freq - switch) <= near, value) for one, freq, value in points if one == seed and math.isfinite(value)]
        close, far = ([value for is_near, value in own if is_near == side] for side in (True, False))
        ratios.append([float(np.mean(close) / np.mean(far))] if close and far and np.mean(far) > 0 else [])
    value, low, high = _interval(ratios)
    meaning = "-" if math.isnan(value) else "larger near the switch" if value > 1 else "not larger near the switch"
    if value > 1 and not low > 1:
        meaning += ", not certainly so"
    if name == "fluctuation" and not any(value >= NEGLIGIBLE_DEG for _, _, value in points):
        meaning = f"below {NEGLIGIBLE_DEG:g} deg at every frequency"
    return Finding(name, len(where), value, low, high, meaning, LITERATURE[name])


def _mode(name: str, rows: Sequence[FluctuationRow], where: dict[int, float], near: float, above: bool) -> Finding:
    """Circular mean of the relative phase over the frequencies below, or above, the switch."""
    means = []
    for seed, switch in where.items():
        side = [row for row in rows if row.seed == seed and abs(row.freq_hz - switch) > near]
        phases = np.array([row.phase_mean_deg for row in side if (row.freq_hz > switch) == above])
        means.append(circular_mean_sd(phases)[0] if len(phases) else math.nan)
    value, _ = circular_mean_sd(np.array(means))
    # About their mean, so that angles on both sides of 180 deg are neighbours.
    _, low, high = _interval([[(one - value + 180.0) % 360.0 - 180.0] for one in means if math.isfinite(one)])
    return Finding(name, len(where), value, value + low, value + high, "-", LITERATURE[name])


def _interval(seeds: Sequence[Sequence[float]]) -> tuple[float, float, float]:
    """Mean over the seeds of the mean of each, and its 95 % interval by Student's t; over the values of a single seed."""
    known = [[value for value in values if math.isfinite(value)] for values in seeds]
    means = [float(np.mean(values)) for values in known if values]
    return mean_interval(means if len(means) != 1 else next(values for values in known if values))
