"""Ranges written with dots: worked cases, refusals, exact arithmetic, and Hydra's reading of the result."""

import re
from fractions import Fraction

import pytest
from hydra._internal.core_plugins.basic_sweeper import BasicSweeper
from hydra.core.override_parser.overrides_parser import OverridesParser
from hypothesis import given
from hypothesis import strategies as st

from posture.cli.ranges import MAX_SLUG_LENGTH, expand_ranges, override_slug


@pytest.mark.parametrize(
    ("argument", "expected"),
    [
        ("env.hip_k=25,50,...,200", "env.hip_k=25,50,75,100,125,150,175,200"),
        ("+env.hip_k=1,2,...,4", "+env.hip_k=1,2,3,4"),
        ("++env.hip_k=1,2,...,4", "++env.hip_k=1,2,3,4"),
        ("seed=0,1,2,...,5", "seed=0,1,2,3,4,5"),
        ("seed=1,2,...,3", "seed=1,2,3"),
        ("env.hip_k= 25, 50, ..., 100", "env.hip_k=25,50,75,100"),
        # 0.05 is not a binary fraction: floats would give 0.15000000000000002.
        ("env.freq=0.05,0.10,...,0.30", "env.freq=0.05,0.10,0.15,0.20,0.25,0.30"),
        ("env.freq=.1,.2,...,.5", "env.freq=0.1,0.2,0.3,0.4,0.5"),
        # One kind of number throughout: a float among the given makes them all floats.
        ("env.freq=0,0.5,...,2", "env.freq=0.0,0.5,1.0,1.5,2.0"),
        ("env.freq=1.,2.,...,3.", "env.freq=1.0,2.0,3.0"),
        ("rate=1e-4,2e-4,...,5e-4", "rate=0.0001,0.0002,0.0003,0.0004,0.0005"),
        ("mass=1e1,2e1,...,4e1", "mass=10.0,20.0,30.0,40.0"),
        ("x=10,5,...,-10", "x=10,5,0,-5,-10"),
        ("x=-0.2,-0.1,...,0.1", "x=-0.2,-0.1,0.0,0.1"),
    ],
)
def test_range_is_written_out(argument: str, expected: str) -> None:
    assert expand_ranges([argument]) == [expected]


@pytest.mark.parametrize(
    "argument",
    [
        "env.hip_k=25,50,75",
        "env.hip_k=25",
        "env.hip_k=",
        "env.hip_k=range(25,201,25)",
        "env.freq=[0.1,0.2,...,0.5]",
        "env.freq=choice(1,2,...,5)",
        "env={a:1,b:2,...,c:3}",
        "note='1,2,...,5'",
        'note="1,2,...,5"',
        "note='it\\'s 1,2,...,5'",
        "note=wait...",
        "ckpt=../runs/first",
        "ckpt=../a,../b",
        "hydra.run.dir=..",
        "~env.hip_k=1,2,...,5",
        "--config-name=1,2,...,5",
        "-m",
        "1,2,...,5",
        "",
    ],
)
def test_everything_else_passes_unchanged(argument: str) -> None:
    assert expand_ranges([argument]) == [argument]


def test_order_of_arguments_is_kept() -> None:
    assert expand_ranges(["-m", "a=1,2,...,3", "b=x", "c=2,4,...,6"]) == ["-m", "a=1,2,3", "b=x", "c=2,4,6"]


@pytest.mark.parametrize(
    ("argument", "reason"),
    [
        (
            "env.hip_k=25,50,...,190",
            "190 is not reached from 25 in steps of 50-25=25; end at 175 or 200, "
            "use range(25,201,25) or write the values out",
        ),
        (
            "f=0.05,0.15,...,0.50",
            "0.50 is not reached from 0.05 in steps of 0.15-0.05=0.10; end at 0.45 or 0.55 or write the values out",
        ),
        ("x=10,7,...,0", "end at 1 or -2, use range(10,-3,-3) or write the values out"),
        ("x=25,50,...,60", "end at 75, use range(25,76,25) or write the values out"),
        ("x=5,5,...,5", "the step 5-5=0 is zero"),
        ("x=25,50,...,0", "0 does not lie beyond 50 in steps of 50-25=25"),
        ("x=25,50,...,50", "50 does not lie beyond 50"),
        ("x=1,2,3,...,2", "2 does not lie beyond 3"),
        ("x=1,2,4,...,8", "1,2,4 is no progression in steps of 2-1=1"),
        ("x=1,...,5", "1 before and 1 after the dots"),
        ("x=...,5", "0 before and 1 after the dots"),
        ("x=1,2,...", "2 before and 0 after the dots"),
        ("x=...", "0 before and 0 after the dots"),
        ("x=1,2,...,5,6", "2 before and 2 after the dots"),
        ("x=1,2,...,5,6,...,9", "three dots must stand once"),
        ("x=1,2,..,5", "three dots must stand once"),
        ("x=1,2,....,5", "three dots must stand once"),
        ("x=1,2,…,5", "three dots must stand once"),
        ("x=1,2...5", "three dots must stand once"),
        ("x=1..5", "three dots must stand once"),
        ("x=1,2,...,..,5", "'..' is not a number"),
        ("x=a,b,...,d", "'a' is not a number"),
        ("x=1,2,...,inf", "'inf' is not a number"),
        ("x=1,2,...,'5'", "\"'5'\" is not a number"),
        ("x=1,,...,5", "'' is not a number"),
        ("x=1,2,...,1e999", "'1e999' is not a number"),
        ("x=1,2,...,10001", "more than 10,000 values"),
        ("x=1e-99,2e-99,...,1e99", "more than 10,000 values"),
    ],
)
def test_what_is_ambiguous_is_refused(argument: str, reason: str) -> None:
    with pytest.raises(ValueError, match=re.escape(reason)) as refusal:
        expand_ranges([argument])
    message = str(refusal.value)
    assert message.startswith(f"{argument}: ")
    assert "\n" not in message


def test_ten_thousand_values_are_allowed() -> None:
    [argument] = expand_ranges(["x=1,2,...,10000"])
    assert argument.removeprefix("x=").split(",") == [str(i) for i in range(1, 10001)]


def _decimal_text(units: int, decimals: int) -> str:
    """`units` / 10^decimals in plain decimal notation, made from digits alone."""
    if decimals == 0:
        return str(units)
    digits = str(abs(units)).rjust(decimals + 1, "0")
    return f"{'-' if units < 0 else ''}{digits[:-decimals]}.{digits[-decimals:]}"


@given(
    first=st.integers(-(10**30), 10**30),
    step=st.integers(-(10**20), 10**20).filter(bool),
    length=st.integers(3, 60),
    decimals=st.integers(0, 25),
    data=st.data(),
)
def test_values_are_the_exact_progression(first: int, step: int, length: int, decimals: int, data: st.DataObject) -> None:
    shown = data.draw(st.integers(2, length - 1), label="numbers before the dots")
    texts = [_decimal_text(first + i * step, decimals) for i in range(length)]

    [argument] = expand_ranges([f"x={','.join(texts[:shown])},...,{texts[-1]}"])

    values = [Fraction(value) for value in argument.removeprefix("x=").split(",")]
    assert values == [Fraction(first + i * step, 10**decimals) for i in range(length)]
    assert argument == f"x={','.join(texts)}"
    assert expand_ranges([argument]) == [argument]


@given(
    first=st.integers(-1000, 1000),
    step=st.integers(2, 100),
    intervals=st.integers(2, 50),
    short=st.integers(1, 99),
)
def test_an_end_between_two_values_is_refused(first: int, step: int, intervals: int, short: int) -> None:
    last = first + intervals * step - (short % (step - 1) + 1)
    with pytest.raises(ValueError, match=r"is not reached|does not lie beyond"):
        expand_ranges([f"x={first},{first + step},...,{last}"])


@given(st.text("x=+~-0123456789.,…e'\"[](){}\\ ", max_size=30))
def test_any_text_is_expanded_once_or_refused(text: str) -> None:
    try:
        expanded = expand_ranges([text])
    except ValueError as refusal:
        assert str(refusal).startswith(f"{text}: ")
    else:
        assert expand_ranges(expanded) == expanded


def _jobs(argv: list[str]) -> list[list[str]]:
    """The overrides of each job that Hydra's own sweeper makes of the arguments."""
    overrides = OverridesParser.create().parse_overrides(argv)
    [batch] = BasicSweeper.split_arguments(overrides, max_batch_size=None)
    return batch


def test_hydra_makes_eight_jobs() -> None:
    jobs = _jobs(expand_ranges(["env.hip_k=25,50,...,200", "seed=3"]))
    assert jobs == [[f"env.hip_k={k}", "seed=3"] for k in (25, 50, 75, 100, 125, 150, 175, 200)]


def test_the_suggested_range_is_what_hydra_takes() -> None:
    with pytest.raises(ValueError) as refusal:
        expand_ranges(["x=10,7,...,0"])
    [suggestion] = re.findall(r"range\(.*\)", str(refusal.value))
    assert _jobs([f"x={suggestion}"]) == [["x=10"], ["x=7"], ["x=4"], ["x=1"], ["x=-2"]]


@pytest.mark.parametrize(
    ("overrides", "slug"),
    [
        ("env.hip_k=25,seed=3", "hip_k-25_seed-3"),
        ("+env.freq=[0.1,0.2],seed=3", "freq-0.1-0.2_seed-3"),
        ("env.load=-5", "load--5"),  # not the same as 5
        ("ckpt=runs/first run/model.pt", "ckpt-runs-first-run-model.pt"),
        ("env/body=tall", "body-tall"),
        ("experiment=", "experiment"),
        (".hidden=1", "hidden-1"),
        ("../..", "job"),
        ("", "job"),
        (",,", "job"),
    ],
)
def test_slug_by_hand(overrides: str, slug: str) -> None:
    assert override_slug(overrides) == slug


def test_long_slugs_stay_distinct() -> None:
    common = ",".join(f"key_{i}=1" for i in range(20))
    first, second = override_slug(f"{common},seed=1"), override_slug(f"{common},seed=2")
    assert len(first) == len(second) == MAX_SLUG_LENGTH
    assert first != second


@given(st.text(max_size=200))
def test_slug_is_a_safe_file_name(overrides: str) -> None:
    assert re.fullmatch(r"[A-Za-z0-9_][A-Za-z0-9._-]{0,79}", override_slug(overrides))
