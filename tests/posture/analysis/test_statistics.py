"""The bootstrap interval against hand calculation and the normal distribution."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from posture.analysis.statistics import bootstrap_mean

few = st.lists(st.floats(-10, 10), min_size=2, max_size=6)


def test_interval_of_two_values_by_hand() -> None:
    # Resampling {0, 1} gives a mean of 0, 1/2 and 1 with chances 1/4, 1/2 and 1/4: 95 % reaches from end to end, the
    # middle 40 % (quantiles 0.3 and 0.7) is the point 1/2.
    assert bootstrap_mean([0.0, 1.0]) == (0.5, 0.0, 1.0)
    assert bootstrap_mean([0.0, 1.0], confidence=0.4) == (0.5, 0.5, 0.5)


def test_interval_of_three_values_by_hand() -> None:
    # The mean of three draws from {0, 0, 3} is the number of threes, binomial(3, 1/3): chances 8/27, 12/27, 6/27, 1/27. The
    # cumulative ones are 0.296, 0.741, 0.963, 1: the quantiles 0.025 and 0.975 are 0 and 3, 0.25 and 0.75 are 0 and 2.
    assert bootstrap_mean([0.0, 3.0, 0.0]) == (1.0, 0.0, 3.0)
    assert bootstrap_mean([0.0, 3.0, 0.0], confidence=0.5) == (1.0, 0.0, 2.0)


@pytest.mark.parametrize(("confidence", "deviations"), [(0.6827, 1.0), (0.95, 1.96)])
def test_interval_of_many_values_is_that_of_the_normal_distribution(confidence: float, deviations: float) -> None:
    values = np.random.default_rng(1).normal(5.0, 2.0, 400)
    error = values.std() / math.sqrt(len(values))
    mean, low, high = bootstrap_mean(values, confidence)
    assert mean == pytest.approx(values.mean())
    # 9999 resamples determine the end of the interval to about 0.03 standard errors.
    assert (mean - low, high - mean) == pytest.approx((deviations * error, deviations * error), abs=0.12 * error)


@settings(max_examples=20, deadline=None)
@given(few, st.floats(0.1, 10), st.floats(-10, 10))
def test_interval_shifts_and_scales_with_the_values(values: list[float], scale: float, shift: float) -> None:
    mean, low, high = bootstrap_mean(values)
    assert min(values) - 1e-9 <= low <= mean + 1e-9
    assert mean - 1e-9 <= high <= max(values) + 1e-9
    moved = bootstrap_mean(scale * np.array(values) + shift)
    assert moved == pytest.approx([scale * x + shift for x in (mean, low, high)], abs=1e-7)


def test_nan_is_ignored() -> None:
    assert bootstrap_mean([0.2, math.nan, 0.4, 0.9]) == bootstrap_mean([0.2, 0.4, 0.9])


def test_too_few_values_give_nan() -> None:
    assert np.isnan(bootstrap_mean([])).all()
    assert np.isnan(bootstrap_mean([math.nan])).all()
    mean, low, high = bootstrap_mean([0.7, math.nan])
    assert mean == 0.7
    assert math.isnan(low)
    assert math.isnan(high)


def test_interval_of_equal_values_has_zero_width() -> None:
    assert bootstrap_mean([0.3, 0.3, 0.3]) == pytest.approx((0.3, 0.3, 0.3))


def test_interval_is_determined_by_the_seed() -> None:
    values = np.random.default_rng(2).normal(size=30)
    assert bootstrap_mean(values, seed=3) == bootstrap_mean(values, seed=3)
    assert bootstrap_mean(values, seed=3) != bootstrap_mean(values, seed=4)


def test_two_dimensional_values_are_refused() -> None:
    with pytest.raises(ValueError, match=r"shape \(2, 2\): they must be \(N,\)"):
        bootstrap_mean([[1.0, 2.0], [3.0, 4.0]])
