"""How the target's frequency changes during a trial; its phase never jumps."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from posture.analysis.trajectory import Array
from posture.config.dynamics import SlowRamp, StaircaseConfig


@dataclass(frozen=True)
class Step:
    """A part of a trial at the frequency `freq` [Hz], from control step `first` up to `end`; rising: on the way up."""

    freq: float
    first: int
    end: int
    rising: bool


def staircase(freq: tuple[float, ...], config: StaircaseConfig, dt: float) -> list[Step]:
    """Up through the rising frequencies `freq` [Hz] and down again, with `config.cycles` at each; control steps of `dt` [s].

    The highest frequency comes twice, as the last step of the way up and as the first of the way down.
    """
    steps, first = [], 0
    for rising, way in ((True, freq), (False, freq[::-1])):
        for one in way:
            end = first + round(config.cycles / one / dt)
            steps.append(Step(one, first, end, rising))
            first = end
    return steps


def frequency_of(steps: list[Step]) -> Array:
    """The frequency [Hz] in each control step of a staircase, (T,)."""
    return np.repeat([step.freq for step in steps], [step.end - step.first for step in steps])


def up_and_down(config: SlowRamp, dt: float) -> Array:
    """The frequency [Hz] in each control step of `dt` [s] of a ramp up and one down, (T,), an even number of steps."""
    count = round((config.end - config.start) / config.rate / dt)
    up = np.linspace(config.start, config.end, count)
    return np.concatenate([up, up[::-1]])
