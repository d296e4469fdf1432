"""Ranges of swept values written with `...`: `env.hip_k=25,50,...,200`."""

import math
import re
from collections.abc import Iterable, Sequence
from fractions import Fraction
from typing import Any

from hydra.core.override_parser.overrides_parser import OverridesParser
from hydra.core.override_parser.types import ChoiceSweep, QuotedString

from posture.config.errors import ConfigError

MAX_VALUES = 10_000

_FORM = "a range is written first,second,...,last"


def expand_ranges(overrides: Iterable[str]) -> list[str]:
    """Overrides with each `key=25,50,...,200` written out as `key=25,50,75,...` up to 200, in exact decimal arithmetic.

    Raises ConfigError where the dots do not stand for one arithmetic progression.
    """
    return [_expand(override) if ".." in override else override for override in overrides]


def _expand(override: str) -> str:
    (parsed,) = OverridesParser.create().parse_overrides([override])
    sweep = parsed.value()
    if not isinstance(sweep, ChoiceSweep) or not sweep.simple_form or not any(map(_has_dots, sweep.list)):
        return override
    try:
        return f"{parsed.get_key_element()}={','.join(map(str, _progression(sweep.list)))}"
    except ValueError as error:
        raise ConfigError(f"{override}: {error}") from None


def _has_dots(value: Any) -> bool:
    """Whether an unquoted value is dots, alone or attached to a number, and not a path such as ../runs."""
    return isinstance(value, str) and re.fullmatch(r"[0-9+.-]*\.\.[0-9+.-]*", value) is not None


def _progression(values: Sequence[Any]) -> list[int] | list[float]:
    """All terms of `first, second, '...', last`: integers if all given are integers."""
    if [v for v in values if _has_dots(v)] != ["..."] or len(values) < 4 or values[-2] != "...":
        raise ValueError(f"{_FORM}: two numbers or more, three dots, one number")
    given = [value for value in values if value != "..."]
    for value in given:
        if type(value) not in (int, float) or not math.isfinite(value):
            raise ValueError(f"{value.text if isinstance(value, QuotedString) else value} is not a number; {_FORM}")
    *head, last = (Fraction(str(value)) for value in given)
    first, step = head[0], head[1] - head[0]
    kind = int if all(type(value) is int for value in given) else float
    if step == 0:
        raise ValueError("the second number must differ from the first")
    intervals = (last - first) / step
    if intervals >= MAX_VALUES:
        raise ValueError(f"more than {MAX_VALUES:,} values")
    terms = [first + i * step for i in range(math.ceil(intervals) + 1)]
    if head != terms[: len(head)] or len(terms) <= len(head):
        raise ValueError(f"the numbers do not go on in steps of {kind(step)} to {given[-1]}")
    if terms[-1] != last:
        ends = " or ".join(str(kind(term)) for term in terms[-2:] if term not in head)
        raise ValueError(f"{given[-1]} is not reached in steps of {kind(step)}; end at {ends}, or write the values out")
    return [kind(term) for term in terms]
