"""Every test that docs/robustness.md names exists."""

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
NAMED = [
    (file, word)
    for row in ROWS
    for file, words in re.findall(r"`(test_\w+)`([^`;]*)", row)
    for word in re.findall(r"\w+", re.sub(r"\(.*?\)|;.*", "", words)) or [""]
]


@pytest.mark.parametrize(("file", "word"), NAMED)
def test_named_test_exists(file, word):
    sources = [path.read_text(encoding="utf-8") for path in TESTS.rglob(f"{file}.py")]
    assert any(re.search(rf"def test_\w*{word}", source) for source in sources)


def test_every_row_names_a_test():
    assert len(ROWS) > 50 and all("`test_" in row for row in ROWS)
