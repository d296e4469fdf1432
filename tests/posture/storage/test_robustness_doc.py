"""Every test that docs/robustness.md names exists, and a row whose tests are all slow says so."""

import ast
import functools
import re
from pathlib import Path

import pytest

TESTS = Path(__file__).parents[2]
DOCUMENT = TESTS.parent / "docs" / "robustness.md"
ROWS = [
    line.rsplit("|", 2)[1]
    for line in DOCUMENT.read_text(encoding="utf-8").splitlines()
    if re.match(r"\| (?!case|---)", line)
]


def named(row):
    """The files that a row names, each with a word from the name of a test."""
    return [
        (file, word)
        for file, words in re.findall(r"`(test_\w+)`([^`;]*)", row)
        for word in re.findall(r"\w+", re.sub(r"\(.*?\)|;.*", "", words)) or [""]
    ]


@functools.cache
def are_slow(file):
    """Whether each test of a file is slow, by its name."""
    found = {}
    for path in TESTS.rglob(f"{file}.py"):
        body = ast.parse(path.read_text(encoding="utf-8")).body
        all_slow = any(ast.unparse(node) == "pytestmark = pytest.mark.slow" for node in body)
        tests = [node for node in body if isinstance(node, ast.FunctionDef) and node.name.startswith("test_")]
        found |= {test.name: all_slow or "pytest.mark.slow" in map(ast.unparse, test.decorator_list) for test in tests}
    return found


@pytest.mark.parametrize("row", ROWS)
def test_named_tests_exist_and_are_slow_where_the_row_says_so(row):
    found = [[slow for name, slow in are_slow(file).items() if word in name] for file, word in named(row)]
    assert found and all(found)
    assert all(map(all, found)) == ("(slow)" in row)


def test_every_row_names_a_test():
    assert len(ROWS) > 50 and all(map(named, ROWS))
