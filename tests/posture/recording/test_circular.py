"""Statistics of directions: by hand, and against the share of intervals and tests that chance allows."""

import math

import numpy as np
import pytest

from posture.recording.circular import mean_half_width, rayleigh_p, resultant_length


def test_resultant_by_hand():
    assert resultant_length(np.array([0.0, 90.0])) == pytest.approx(math.sqrt(0.5))  # |(1, 1)| / 2
    assert resultant_length(np.array([10.0, 190.0])) == pytest.approx(0.0, abs=1e-12)
    assert resultant_length(np.array([170.0, -170.0, math.nan])) == pytest.approx(math.cos(math.radians(10)))
    assert math.isnan(resultant_length(np.array([])))


def test_rayleigh_by_hand():
    """n = 8 of the same direction: sqrt(1 + 32) - 17 = -11.2554, exp of it 1.2937e-5."""
    assert rayleigh_p(np.zeros(8)) == pytest.approx(1.2937e-5, rel=1e-3)
    assert rayleigh_p(np.array([0.0, 180.0])) == pytest.approx(1.0)
    assert math.isnan(rayleigh_p(np.array([math.nan])))


@pytest.mark.parametrize(("n", "spread_deg"), [(8, 20.0), (20, 20.0), (20, 60.0)])
def test_the_interval_of_the_mean_has_its_coverage(n, spread_deg):
    """Of many samples from a von Mises distribution (R of 0.94 and 0.6), 95 % of the intervals hold the true mean. That of
    few samples, of a formula for large ones, may be less, though not by much."""
    draw = np.random.default_rng(n)
    kappa = 1 / math.radians(spread_deg) ** 2
    samples = np.degrees(draw.vonmises(math.radians(170.0), kappa, (2000, n)))
    inside = 0
    for sample in samples:
        mean = math.degrees(np.angle(np.exp(1j * np.radians(sample)).mean()))
        half = mean_half_width(sample)
        inside += not half < abs((mean - 170.0 + 180) % 360 - 180)
    assert 0.90 < inside / len(samples) < 0.975


def test_rayleigh_has_its_share_of_chance():
    draw = np.random.default_rng(2)
    p = np.array([rayleigh_p(sample) for sample in draw.uniform(-180, 180, (2000, 12))])
    assert np.mean(p < 0.05) == pytest.approx(0.05, abs=0.015) and np.mean(p < 0.5) == pytest.approx(0.5, abs=0.03)


def test_no_interval():
    assert math.isnan(mean_half_width(np.array([5.0])))
    assert math.isnan(mean_half_width(np.array([0.0, 120.0, 240.0])))  # no direction in common
    assert mean_half_width(np.array([5.0, 5.0, 5.0])) == pytest.approx(0.0, abs=1e-6)
