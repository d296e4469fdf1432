"""The evaluation table: alignment, the published value beside its frequency, falls spelled out."""

import math
from dataclasses import replace
from typing import Any

import pytest

from posture.analysis.results import Result
from posture.analysis.table import evaluation_columns, markdown_table, text_table

# Values unlike any measured ones, so that a misplaced cell shows.
PAPER = {
    "table_3": {
        "freq_hz": [0.1, 0.3],
        "target_head_r": [0.1111, 0.3333],
        "head_amplitude_m": [1.1, 3.3],
        "head_speed_mps": [10.5, 30.5],
        "mode": ["in", "anti"],
    }
}


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


def evaluation_table(rows: list[Result], paper: Any) -> str:
    return text_table(rows, evaluation_columns(rows, paper))


def test_terminal_table_lines_up() -> None:
    lines = evaluation_table([row(0.1), fallen(0.3), row(0.25)], PAPER).splitlines()
    headings, units, rule, *worlds = lines
    assert len({len(line) for line in (headings, rule, *worlds)}) == 1
    assert len(units) <= len(rule) and set(rule) == {"-", " "}
    # A heading ends above the last letter of its cells, as they are right-aligned.
    for heading, cell in [
        ("amplitude", "0.0765"),
        ("energy", "1234"),
        ("cost", "0.0568"),
        ("mode", "in-phase"),
    ]:
        assert headings.index(heading) + len(heading) == worlds[0].index(cell) + len(cell)
    assert units.split() == ["[Hz]", "r", "[m]", "[m/s]", "r", "[deg]", "[J]"]


def test_published_values_stand_beside_their_frequency() -> None:
    # 0.30000000000000004 is what 3 x 0.1 gives; it is the paper's 0.3.
    lines = evaluation_table([row(3 * 0.1), row(0.25)], PAPER).splitlines()[3:]
    assert [" ".join(line.split()) for line in lines] == [
        "0.3 in-phase anti-phase 0.9877 0.3333 0.0765 3.3000 0.4321 30.5000 0.512 42 1234 0.0568",
        "0.25 in-phase - 0.9877 - 0.0765 - 0.4321 - 0.512 42 1234 0.0568",
    ]


def test_a_fall_is_spelled_out_beside_the_published_values() -> None:
    line = evaluation_table([fallen(0.3)], PAPER).splitlines()[3]
    assert "fell 12.3 s" in line
    assert "nan" not in line
    assert " ".join(line.split()) == "0.3 fell 12.3 s anti-phase - 0.3333 - 3.3000 - 30.5000 - - - -"


def test_a_world_that_blew_up_is_not_called_fallen() -> None:
    line = evaluation_table([replace(fallen(0.3), fell=False)], None).splitlines()[3]
    assert "not finite" in line
    assert "fell" not in line


@pytest.mark.parametrize("paper", [None, {}, {"table_3": {}}, {"table_4": {"gamma": [0]}}, PAPER])
def test_without_a_published_frequency_there_is_no_column_for_it(paper: dict[str, Any] | None) -> None:
    text = evaluation_table([row(0.25)], paper)
    assert "paper" not in text
    assert "0.9877" in text


def test_a_published_table_may_lack_columns() -> None:
    paper = {"table_3": {"freq_hz": [0.3], "target_head_r": [0.3333]}}
    cells = evaluation_table([row(0.3)], paper).splitlines()[3].split()
    assert cells[:7] == ["0.3", "in-phase", "-", "0.9877", "0.3333", "0.0765", "-"]


def test_conditions_show_where_they_differ() -> None:
    same = evaluation_table([row(0.1), row(0.3)], None)
    swept = evaluation_table([row(0.3, hip_k_nm_per_rad=50.0), row(0.3, hip_k_nm_per_rad=175.0)], None)
    assert "[Nm/rad]" not in same
    assert [line.split()[:2] for line in swept.splitlines()[3:]] == [["0.3", "50"], ["0.3", "175"]]
    assert "load" not in swept


def test_a_ramp_has_no_frequency() -> None:
    assert evaluation_table([row(math.nan)], PAPER).splitlines()[3].split()[0] == "ramp"


def test_markdown_has_the_same_cells() -> None:
    rows = [row(0.1), fallen(0.3)]
    headings, rule, *worlds = markdown_table(rows, evaluation_columns(rows, PAPER)).splitlines()
    cells = [[cell.strip() for cell in line.strip("|").split("|")] for line in (headings, *worlds)]
    assert cells[0][:5] == ["f [Hz]", "mode", "paper", "target-head r", "paper"]
    assert cells[2][:5] == ["0.3", "fell 12.3 s", "anti-phase", "-", "0.3333"]
    assert {len(line) for line in cells} == {rule.count("---:")} == {13}
    terminal = evaluation_table(rows, PAPER).splitlines()[3:]
    assert [" ".join(line) for line in cells[1:]] == [" ".join(line.split()) for line in terminal]
