"""The target against paper Eq. 5, its derivatives, and the statistics of drawn frequencies and lengths."""

import math

import pytest
import torch
from hypothesis import assume, given
from hypothesis import strategies as st

from envs.config import Ramp
from envs.task.target import FrequencySource, LengthSource, acceleration, frequency, phase, position, uniform, velocity


def at(time, freq, rate=0.0, duration=0.0):
    return (torch.tensor([v], dtype=torch.float64) for v in (time, freq, rate, duration))


def test_fixed_frequency_is_equation_5():
    for time in (0.0, 0.3, 1.7):
        expected = -0.1 * math.cos(2 * math.pi * 1.2 * time) + 0.1
        assert float(position(phase(*at(time, 1.2)), 0.1)) == pytest.approx(expected, abs=1e-12)


def test_starts_at_rest_and_reaches_twice_the_amplitude():
    assert float(position(phase(*at(0.0, 0.5)), 0.1)) == 0.0
    assert float(velocity(phase(*at(0.0, 0.5)), torch.tensor([0.5]), 0.1)) == 0.0
    assert float(position(phase(*at(1.0, 0.5)), 0.1)) == pytest.approx(0.2)  # half a period of 2 s


@given(st.floats(0.0, 40.0), st.floats(0.0, 2.0), st.floats(-0.02, 0.1), st.floats(0.1, 30.0))
def test_derivatives(time, freq, rate, duration):
    """Frequency is the slope of the phase, velocity that of the position, acceleration that of the velocity, by central
    differences."""
    h = 1e-5
    assume(abs(time - duration) >= 2 * h)  # the ramp's end is a kink
    before, after = (phase(*at(time + d, freq, rate, duration)) for d in (-h, h))
    now = frequency(*at(time, freq, rate, duration))
    assert float((after - before) / (2 * h) / (2 * math.pi)) == pytest.approx(float(now), abs=1e-5)
    slope = (position(after, 0.1) - position(before, 0.1)) / (2 * h)
    assert float(slope) == pytest.approx(float(velocity(phase(*at(time, freq, rate, duration)), now, 0.1)), abs=1e-4)
    rates = [frequency(*at(time + d, freq, rate, duration)) for d in (-h, h)]
    speeds = [velocity(place, rate_now, 0.1) for place, rate_now in zip((before, after), rates, strict=True)]
    slope = (speeds[1] - speeds[0]) / (2 * h)
    changing = torch.tensor([rate if time < duration else 0.0])
    now = acceleration(phase(*at(time, freq, rate, duration)), now, changing, 0.1)
    assert float(slope) == pytest.approx(float(now), rel=1e-4, abs=1e-4)


def test_ramp_of_experiment_4a():
    """0.036 Hz/s for 25 s from 0: 0.45 Hz half way, 0.9 Hz at the end and after; phase pi 0.036 25^2 there."""
    assert float(frequency(*at(12.5, 0.0, 0.036, 25.0))) == pytest.approx(0.45)
    assert float(frequency(*at(40.0, 0.0, 0.036, 25.0))) == pytest.approx(0.9)
    end = math.pi * 0.036 * 25**2
    assert float(phase(*at(25.0, 0.0, 0.036, 25.0))) == pytest.approx(end)
    assert float(phase(*at(26.0, 0.0, 0.036, 25.0))) == pytest.approx(end + 2 * math.pi * 0.9)


def draws(draw, worlds=1000, episodes=50, seed=3):
    source = FrequencySource((0.015, 1.5), None, draw, torch.arange(worlds), worlds, seed)
    return torch.stack([source.draw(torch.full((worlds,), k)) for k in range(episodes)])


@pytest.mark.parametrize("draw", ["uniform", "stratified"])
def test_drawn_frequencies_are_uniform(draw):
    found = draws(draw).flatten().double()
    assert float(found.min()) >= 0.015 and float(found.max()) < 1.5
    # 50,000 draws: the standard error of the mean is 0.0019, of a decile's share 0.0013.
    assert float(found.mean()) == pytest.approx(0.7575, abs=0.008)
    assert float(found.std()) == pytest.approx(1.485 / math.sqrt(12), abs=0.006)
    shares = torch.histc(found, 10, 0.015, 1.5) / len(found)
    assert shares.tolist() == pytest.approx([0.1] * 10, abs=0.006)


def test_stratified_keeps_each_world_in_its_part():
    found = draws("stratified", worlds=10)
    part = 1.485 / 10
    for world in range(10):
        low = 0.015 + world * part
        assert low - 1e-6 <= float(found[:, world].min()) and float(found[:, world].max()) <= low + part + 1e-6
        assert float(found[:, world].max() - found[:, world].min()) > 0.5 * part  # and moves about in it


def test_draws_do_not_depend_on_the_number_of_worlds():
    many, few = draws("uniform", worlds=64), draws("uniform", worlds=8)
    assert torch.equal(many[:, :8], few)


def test_seeds_worlds_and_episodes_draw_independently():
    worlds, episode = torch.arange(20_000), torch.zeros(20_000, dtype=torch.long)
    a, b, c = (uniform(s, worlds, e) for s, e in ((1, episode), (2, episode), (1, episode + 1)))
    for other in (b, c, a.roll(1)):
        assert abs(float(torch.corrcoef(torch.stack((a, other)))[0, 1])) < 0.03  # standard error 0.007


def test_fixed_and_ramp_sources():
    episode = torch.zeros(3, dtype=torch.long)
    assert FrequencySource(1.2, None, "uniform", torch.arange(3), 3, 0).draw(episode).tolist() == pytest.approx([1.2] * 3)
    ramp = FrequencySource(1.0, Ramp(start=0.1, rate=0.036, duration=25.0), "stratified", torch.arange(3), 3, 0)
    assert ramp.draw(episode).tolist() == pytest.approx([0.1] * 3)
    assert ramp.rate.tolist() == pytest.approx([0.036] * 3) and ramp.duration.tolist() == [25.0] * 3
    ramp.fix(torch.tensor([0.2, 0.4, 0.6]))
    assert ramp.draw(episode).tolist() == pytest.approx([0.2, 0.4, 0.6]) and ramp.rate.tolist() == [0.0] * 3


def test_drawn_lengths_are_uniform_and_not_the_frequencies():
    worlds = torch.arange(20_000)
    episode = torch.zeros(20_000, dtype=torch.long)
    lengths = LengthSource(2000, 8000, worlds, 1).draw(episode)
    assert int(lengths.min()) >= 2000 and int(lengths.max()) <= 8000
    assert float(lengths.double().mean()) == pytest.approx(5000, abs=50)  # standard error 12
    drawn = FrequencySource((0.0, 1.0), None, "uniform", worlds, 20_000, 1).draw(episode)
    assert abs(float(torch.corrcoef(torch.stack((lengths.float(), drawn)))[0, 1])) < 0.03
    assert LengthSource(7, 7, worlds, 1).draw(episode).unique().tolist() == [7]
    assert set(LengthSource(1, 3, worlds, 1).draw(episode).tolist()) == {1, 2, 3}
