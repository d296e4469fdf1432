"""Sweep arguments: ranges written with `...`, and file names for the jobs of a sweep.

Hydra reads `env.hip_k=25,50,...,200` as the four values 25, 50, '...' and 200. `expand_ranges` writes such
an override out before Hydra sees it, in exact decimal arithmetic, and refuses what could mean two things.
"""

import hashlib
import re
from decimal import ROUND_CEILING, Decimal, localcontext

MAX_VALUES = 10_000
MAX_SLUG_LENGTH = 80

_OVERRIDE = re.compile(r"(\+{0,2}[^-~+=\s][^=\s]*)=(.*)", re.DOTALL)
_NUMBER = re.compile(r"[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][+-]?[0-9]{1,2})?")
_INTEGER = re.compile(r"[+-]?[0-9]+")
_DOTS = re.compile(r"[0-9+.…-]*(\.\.|…)[0-9+.…-]*")  # dots alone or stuck to a number: 25,50...200
_FORM = "a range is written first,second,...,last"


def expand_ranges(argv: list[str]) -> list[str]:
    """Command-line arguments with each `key=25,50,...,200` written out as `key=25,50,75,...` up to 200.

    Only `key=value`, `+key=value` and `++key=value` are looked at, and there only dots outside quotes and
    brackets. Raises ValueError, in one line, for dots that do not stand for one arithmetic progression.
    """
    return [_expand(argument) for argument in argv]


def override_slug(overrides: str) -> str:
    """Hydra's `override_dirname` as part of a file name: `env.hip_k=25,seed=3` becomes `hip_k-25_seed-3`.

    Different overrides may share a slug (only the last part of each key is kept), so it labels a job and does
    not identify it. A slug over 80 characters is cut and ends in a hash of the whole.
    """
    words = []
    for override in _split(overrides):
        key, _, value = override.partition("=")
        name = re.split(r"[./]", key)[-1]
        words.append("-".join(re.findall(r"[A-Za-z0-9._-]+", f"{name} {value}")))
    slug = "_".join(filter(None, words)).lstrip(".-")
    if len(slug) > MAX_SLUG_LENGTH:
        digest = hashlib.sha256(overrides.encode()).hexdigest()[:8]
        slug = f"{slug[: MAX_SLUG_LENGTH - 9]}-{digest}"
    return slug or "job"


def _expand(argument: str) -> str:
    match = _OVERRIDE.fullmatch(argument)
    if match is None:
        return argument
    key, value = match.groups()
    elements = [element.strip() for element in _split(value)]
    # A lone `..` is a folder, not a range.
    if elements == [".."] or not any(_DOTS.fullmatch(element) for element in elements):
        return argument
    try:
        return f"{key}={','.join(_progression(elements))}"
    except ValueError as error:
        raise ValueError(f"{argument}: {error}") from None


def _progression(elements: list[str]) -> list[str]:
    """All terms of `first, second, '...', last` as text, each with as many decimals as the longest given."""
    if elements.count("...") != 1:
        raise ValueError(f"three dots must stand once, between commas; {_FORM}")
    for element in elements:
        if element != "..." and not _NUMBER.fullmatch(element):
            raise ValueError(f"{element!r} is not a number; {_FORM}, all numbers")
    dots = elements.index("...")
    if dots < 2 or len(elements) != dots + 2:
        raise ValueError(
            f"{dots} before and {len(elements) - dots - 1} after the dots; "
            f"{_FORM}: at least two numbers before the dots and exactly one after"
        )

    with localcontext() as context:
        # Enough digits for every sum below to be exact: those written, and those that two exponents can span.
        context.prec = sum(map(len, elements)) + 250
        given = [Decimal(element) for element in elements[:dots]]
        first, second, last = given[0], given[1], Decimal(elements[-1])
        step = second - first
        step_text = f"{elements[1]}-{elements[0]}={step:f}"
        if step == 0:
            raise ValueError(f"the step {step_text} is zero; the second number must differ from the first")
        if any(b - a != step for a, b in zip(given, given[1:], strict=False)):
            raise ValueError(
                f"{','.join(elements[:dots])} is no progression in steps of {step_text}; "
                "write the values out or give only the first two"
            )
        if (last - given[-1]) / step <= 0:
            raise ValueError(
                f"{elements[-1]} does not lie beyond {elements[dots - 1]} in steps of {step_text}; "
                "the last number must lie on the far side of those before the dots"
            )
        if (last - first) / step > MAX_VALUES - 1:
            raise ValueError(f"more than {MAX_VALUES:,} values; at most {MAX_VALUES:,} are allowed")

        is_integer = all(_INTEGER.fullmatch(element) for element in elements if element != "...")
        decimals = 0 if is_integer else max(1, *(_decimals(number) for number in (*given, last)))
        unit = Decimal(1).scaleb(-decimals)
        intervals = int(((last - first) / step).to_integral_value(ROUND_CEILING))
        end = first + intervals * step
        if end != last:
            allowed = f"{end - step:f} or {end:f}" if intervals > dots else f"{end:f}"
            # Hydra's range stops short of its second argument, and is exact for integers alone.
            stop = end + unit.copy_sign(step)
            hydra_range = f", use range({first:f},{stop:f},{step:f})" if is_integer else ""
            raise ValueError(
                f"{elements[-1]} is not reached from {elements[0]} in steps of {step_text}; "
                f"end at {allowed}{hydra_range} or write the values out"
            )
        return [f"{(first + i * step).quantize(unit):f}" for i in range(intervals + 1)]


def _decimals(number: Decimal) -> int:
    """Digits written after the decimal point; negative for 1e3."""
    exponent = number.as_tuple().exponent
    assert isinstance(exponent, int)  # a letter only for infinity and NaN
    return -exponent


def _split(text: str) -> list[str]:
    """Elements between those commas that stand outside quotes and brackets, as Hydra's grammar has it."""
    elements = [""]
    depth = 0
    quote = ""
    escaped = False
    for character in text:
        if character == "," and depth == 0 and not quote and not escaped:
            elements.append("")
            continue
        elements[-1] += character
        if escaped:
            escaped = False
        elif character == "\\":
            escaped = True
        elif quote:
            quote = "" if character == quote else quote
        elif character in "'\"":
            quote = character
        elif character in "[({":
            depth += 1
        elif character in "])}":
            depth = max(depth - 1, 0)
    return elements
