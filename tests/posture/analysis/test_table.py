"""The evaluation table: alignment, the published value beside its frequency, falls spelled out."""

import math
from dataclasses import replace
from typing import Any

import pytest

from posture.analysis.results import LeastCost, Result
from posture.analysis.table import Column, evaluation_columns, markdown_table, text_table
from posture.config.published import Condition, Table3

# Values unlike any measured ones, so that a misplaced cell shows.
PAPER = Table3(
    condition=Condition(hip_k=125, ankle_k=25, load=0, amplitude=0.1, energy_weight=20),
    freq_hz=(0.1, 0.3),
    target_head_r=(0.1111, 0.3333),
    head_amplitude_m=(1.1, 3.3),
    head_speed_mps=(10.5, 30.5),
    mode=("in", "anti"),
)
STOOD = Result(
    freq_hz=0.1,
    hip_k_nm_per_rad=125.0,
    ankle_k_nm_per_rad=25.0,
    load_kg=0.0,
    valid=True,
    fell=False,
    mode="in-phase",
    hip_ankle_r=0.51234,
    relative_phase_deg=42.4,
    target_head_r=0.98765,
    head_amplitude_m=0.07654,
    head_speed_mps=0.4321,
    energy_j=1234.4,
    cost=0.05678,
)
FELL = Result(
    freq_hz=0.3, hip_k_nm_per_rad=125.0, ankle_k_nm_per_rad=25.0, load_kg=0.0, valid=False, fell=True, fall_time_s=12.34
)


def row(freq: float, **changes: Any) -> Result:
    return replace(STOOD, freq_hz=freq, **changes)


def fallen(freq: float) -> Result:
    return replace(FELL, freq_hz=freq)


UNDEFINED = replace(STOOD, mode="undefined", hip_ankle_r=math.nan, relative_phase_deg=math.nan)


def text(rows: list[Result], paper: Table3 | None) -> str:
    return text_table(rows, evaluation_columns(rows, paper))


def lines(rows: list[Result], paper: Table3 | None) -> list[str]:
    """The lines of the worlds, single-spaced."""
    return [" ".join(line.split()) for line in text(rows, paper).splitlines()[3:]]


def test_terminal_table_lines_up():
    headings, units, rule, *worlds = text([row(0.1), fallen(0.3), row(0.25)], PAPER).splitlines()
    assert len({len(line) for line in (headings, rule, *worlds)}) == 1
    assert len(units) <= len(rule) and set(rule) == {"-", " "}
    # A heading ends above the last letter of its cells, as they are right-aligned.
    for heading, cell in [("amplitude", "0.0765"), ("energy", "1234"), ("cost", "0.0568"), ("mode", "in-phase")]:
        assert headings.index(heading) + len(heading) == worlds[0].index(cell) + len(cell)
    assert units.split() == ["[Hz]", "r", "[m]", "[m/s]", "r", "[deg]", "[J]"]


@pytest.mark.parametrize(
    ("shown", "expected"),
    [
        # 0.30000000000000004 is what 3 x 0.1 gives; it is the paper's 0.3.
        (row(3 * 0.1), "0.3 in-phase anti-phase 0.9877 0.3333 0.0765 3.3000 0.4321 30.5000 0.512 42 1234 0.0568"),
        (row(0.25), "0.25 in-phase - 0.9877 - 0.0765 - 0.4321 - 0.512 42 1234 0.0568"),
        (fallen(0.3), "0.3 fell at 12.3 s anti-phase - 0.3333 - 3.3000 - 30.5000 - - - -"),
        (replace(fallen(0.3), fell=False), "0.3 not finite anti-phase - 0.3333 - 3.3000 - 30.5000 - - - -"),
        (UNDEFINED, "0.1 undefined in-phase 0.9877 0.1111 0.0765 1.1000 0.4321 10.5000 - - 1234 0.0568"),
    ],
)
def test_published_values_stand_beside_their_frequency(shown, expected):
    assert lines([row(0.1), shown], PAPER)[1] == expected


@pytest.mark.parametrize("paper", [None, PAPER])
def test_without_published_values_there_is_no_column_for_them(paper):
    assert "paper" not in text([row(0.25)], paper) and "0.9877" in text([row(0.25)], paper)


def test_conditions_show_where_they_differ():
    swept = [row(0.3, hip_k_nm_per_rad=50.0), row(0.3, hip_k_nm_per_rad=175.0)]
    assert "[Nm/rad]" not in text([row(0.1), row(0.3)], None) and "load" not in text(swept, None)
    assert [line.split()[:2] for line in lines(swept, None)] == [["0.3", "50"], ["0.3", "175"]]
    assert lines([row(math.nan)], PAPER)[0].split()[0] == "ramp"


def test_the_least_cost_shows_where_the_rows_have_it():
    least = LeastCost(hip_ankle_r=-0.25)
    shown = row(0.3, least=least, cost_ratio=1.234, beyond_tolerance_share=0.125, foot_not_flat_share=0.0)
    assert lines([shown], None)[0].endswith("0.0568 1.23 -0.250 0.125 0.000")
    assert "least" not in text([row(0.3)], None)


def test_columns_have_a_factor_and_a_format():
    columns = [Column("a [Hz]", lambda row: row[0], "g"), Column("b [mm]", lambda row: row[1], ".1f", 1e3)]
    assert text_table([(0.5, math.nan), (12.0, 0.001)], columns).splitlines() == [
        "   a     b",
        "[Hz]  [mm]",
        "----  ----",
        " 0.5     -",
        "  12   1.0",
    ]


def test_markdown_has_the_same_cells():
    rows = [row(0.1), fallen(0.3)]
    headings, rule, *worlds = markdown_table(rows, evaluation_columns(rows, PAPER)).splitlines()
    cells = [[cell.strip() for cell in line.strip("|").split("|")] for line in (headings, *worlds)]
    assert cells[0][:5] == ["f [Hz]", "mode", "paper", "target-head r", "paper"]
    assert cells[2][:5] == ["0.3", "fell at 12.3 s", "anti-phase", "-", "0.3333"]
    assert {len(line) for line in cells} == {rule.count("---:")} == {13}
    assert [" ".join(line) for line in cells[1:]] == lines(rows, PAPER)
