"""Ranges written with dots: worked cases, refusals, exact arithmetic, and Hydra's reading of the result."""

import re
from fractions import Fraction

import pytest
from hydra.errors import HydraException
from hypothesis import given
from hypothesis import strategies as st

from posture.cli.ranges import expand_ranges
from posture.config.errors import ConfigError


@pytest.mark.parametrize(
    ("override", "expected"),
    [
        ("env.hip_k=25,50,...,200", "env.hip_k=25,50,75,100,125,150,175,200"),
        ("++env.hip_k=1,2,...,4", "++env.hip_k=1,2,3,4"),
        ("seed=0,1,2,...,5", "seed=0,1,2,3,4,5"),
        ("env.hip_k= 25, 50, ..., 100", "env.hip_k=25,50,75,100"),
        # 0.05 is not a binary fraction: floating-point sums would give 0.15000000000000002.
        ("env.freq=0.05,0.10,...,0.30", "env.freq=0.05,0.1,0.15,0.2,0.25,0.3"),
        # One float among the given numbers makes all of them floats.
        ("env.freq=0,0.5,...,2", "env.freq=0.0,0.5,1.0,1.5,2.0"),
        ("rate=1e-4,2e-4,...,5e-4", "rate=0.0001,0.0002,0.0003,0.0004,0.0005"),
        ("x=10,5,...,-10", "x=10,5,0,-5,-10"),
        ("x=-0.2,-0.1,...,0.1", "x=-0.2,-0.1,0.0,0.1"),
    ],
)
def test_a_range_is_written_out(override, expected):
    assert expand_ranges([override]) == [expected]


@pytest.mark.parametrize(
    "override",
    [
        "env.hip_k=25,50,75",
        "env.hip_k=range(25,201,25)",
        "env.freq=[0.1,0.2,...,0.5]",
        "env.freq=choice(1,2,...,5)",
        "env={a:1,b:2,...:3}",
        "note='1,2,...,5'",
        "note=wait...",
        "ckpt=../runs/first",
        "ckpt=../a,../b",
        "hydra.run.dir=..",
        "",
    ],
)
def test_other_values_are_unchanged(override):
    assert expand_ranges([override]) == [override]


@pytest.mark.parametrize(
    ("override", "reason"),
    [
        ("x=25,50,...,190", "190 is not reached in steps of 25; end at 175 or 200, or write the values out"),
        ("x=25,50,...,60", "60 is not reached in steps of 25; end at 75, or"),
        ("x=0.05,0.15,...,0.50", "0.5 is not reached in steps of 0.1; end at 0.45 or 0.55, or"),
        ("x=5,5,...,5", "the second number must differ from the first"),
        ("x=25,50,...,0", "the numbers do not go on in steps of 25 to 0"),
        ("x=25,50,...,50", "the numbers do not go on in steps of 25 to 50"),
        ("x=1,2,4,...,8", "the numbers do not go on in steps of 1 to 8"),
        ("x=1,...,5", "a range is written first,second,...,last"),
        ("x=1,2,...,5,6", "a range is written first,second,...,last"),
        ("x=1,2,...,5,6,...,9", "a range is written first,second,...,last"),
        ("x=1,2,..,5", "a range is written first,second,...,last"),
        ("x=1,2...5", "a range is written first,second,...,last"),
        ("x=a,b,...,d", "a is not a number"),
        ("x=1,2,...,inf", "inf is not a number"),
        ("x=1,2,...,'5'", "5 is not a number"),
        ("x=1,2,...,true", "True is not a number"),
        ("x=1,2,...,10001", "more than 10,000 values"),
        ("x=1e-99,2e-99,...,1e99", "more than 10,000 values"),
    ],
)
def test_an_ambiguous_range_is_refused(override, reason):
    with pytest.raises(ConfigError, match=re.escape(f"{override}: {reason}")):
        expand_ranges([override])


@given(
    first=st.integers(-(10**14), 10**14),
    step=st.integers(-(10**10), 10**10).filter(bool),
    length=st.integers(4, 60),
    decimals=st.integers(0, 12),
    shown=st.integers(2, 3),
)
def test_values_are_the_exact_progression(first, step, length, decimals, shown):
    """At up to 15 digits, which a float represents exactly."""
    texts = [str(n) if decimals == 0 else f"{n}e-{decimals}" for n in (first + i * step for i in range(length))]
    (written,) = expand_ranges([f"x={','.join(texts[:shown])},...,{texts[-1]}"])
    values = [Fraction(value) for value in written.removeprefix("x=").split(",")]
    assert values == [Fraction(first + i * step, 10**decimals) for i in range(length)]


@given(st.text("+~-0123456789.,e'\"[](){}\\ ", max_size=20))
def test_any_text_after_the_dots_is_expanded_once_or_refused(text):
    try:
        expanded = expand_ranges([f"x=1,2,...{text}"])
    except (ConfigError, HydraException):
        return
    assert expand_ranges(expanded) == expanded
