"""The CSV file of results: every column, read back as written; files of earlier versions."""

import csv
import math
import re
from dataclasses import replace
from pathlib import Path

import pytest

from posture.analysis.results import (
    LeastCost,
    Origin,
    RampTransitions,
    Result,
    RewardOptimum,
    as_row,
    read_csv,
    write_csv,
    write_rows,
)

RESULTS = Path(__file__).parents[3] / "results"
STOOD = Result(
    freq_hz=0.3,
    hip_k_nm_per_rad=125.0,
    ankle_k_nm_per_rad=25.0,
    load_kg=0.0,
    valid=True,
    fell=False,
    mode="in-phase",
    cycles=27,
    head_amplitude_m=0.0765432198,
)
FELL = replace(STOOD, valid=False, fell=True, fall_time_s=12.3, mode="undefined", cycles=math.nan, head_amplitude_m=math.nan)
WHOLE = replace(
    STOOD,
    origin=Origin(7, 20.0, "planar", 0.1, "a_run"),
    ramp=RampTransitions(0.69, 1, 0.78, 1),
    least=LeastCost(mode="anti-phase", cost=0.02, reward_energy=-1.5, cop_binds="toe"),
    reward=RewardOptimum(-0.5, 0.03, 1000.0),
)


def text(path: Path) -> list[dict[str, str]]:
    with path.open(newline="") as file:
        return list(csv.DictReader(file))


def test_a_file_holds_every_row(tmp_path):
    write_csv([FELL, STOOD], tmp_path / "rows.csv")
    first, second = text(tmp_path / "rows.csv")
    assert list(first) == list(as_row(STOOD))
    assert (first["freq_hz"], first["fall_time_s"], first["fell"], first["cycles"]) == ("0.3", "12.3", "True", "nan")
    assert (second["mode"], second["cycles"], second["head_amplitude_m"]) == ("in-phase", "27", "0.0765432")
    assert [path.name for path in tmp_path.iterdir()] == ["rows.csv"]


@pytest.mark.parametrize("rows", [[STOOD, FELL], [WHOLE], [STOOD, WHOLE]])
def test_what_was_written_is_read(rows, tmp_path):
    write_csv(rows, tmp_path / "rows.csv")
    found = read_csv(tmp_path / "rows.csv")
    assert [as_row(row)["freq_hz"] for row in found] == [0.3] * len(rows)
    write_csv(found, tmp_path / "again.csv")
    assert (tmp_path / "again.csv").read_bytes() == (tmp_path / "rows.csv").read_bytes()
    assert found[-1].origin == rows[-1].origin and found[-1].ramp == rows[-1].ramp and found[-1].reward == rows[-1].reward
    assert (found[-1].least.cop_binds, found[-1].valid) == (rows[-1].least.cop_binds, rows[-1].valid)


def test_groups_that_no_row_has_are_left_out(tmp_path):
    write_csv([replace(STOOD, least=LeastCost())], tmp_path / "rows.csv")
    (row,) = text(tmp_path / "rows.csv")
    assert row["least_cost"] == "nan" and row["cop_binds"] == "-"
    assert not {"seed", "run", "transition_centred_hz", "reward_cost"} & set(row)


@pytest.mark.parametrize(
    "path",
    [RESULTS / "lqr" / "metrics.csv", *sorted((RESULTS / "reproduction" / "tables").glob("[!v]*.csv"))],
    ids=lambda path: path.name,
)
def test_published_files_stay_readable(path, tmp_path):
    write_csv(read_csv(path), tmp_path / "again.csv")
    for before, after in zip(text(path), text(tmp_path / "again.csv"), strict=True):
        assert before == {name: after[name] for name in before}


def test_columns_that_are_unknown_or_missing_are_named(tmp_path):
    path = tmp_path / "rows.csv"
    path.write_text("freq_hz,colour\n1,red\n")
    with pytest.raises(ValueError, match="rows.csv: unknown columns colour"):
        read_csv(path)
    path.write_text("freq_hz,hip_k_nm_per_rad,ankle_k_nm_per_rad,load_kg,valid\n1,125,25,0,True\n")
    with pytest.raises(ValueError, match="rows.csv: missing columns fell"):
        read_csv(path)


def test_a_damaged_file_is_refused_in_one_line(tmp_path):
    path = tmp_path / "rows.csv"
    write_csv([STOOD, FELL], path)
    whole = path.read_bytes()
    header, first, _ = whole.splitlines(keepends=True)
    for damaged, why in (
        (b"", "missing columns freq_hz"),
        (header, "has no rows"),
        (header[:200], "unknown columns"),
        (whole[: len(header) + 20], "line 2 is damaged"),
        (whole[:-40], "line 3 is damaged"),
        (whole[:-1], "was cut short"),
        (header + first.replace(b"True", b"Tru"), "line 2 is damaged"),
        (header + first[:-1] + b",1\n", "line 2 is damaged"),
        (whole.replace(b"in-phase", b"\xff\xfe"), "not a text in UTF-8"),
        (whole.replace(b"125", b"12x"), "line 2 is damaged"),
    ):
        path.write_bytes(damaged)
        with pytest.raises(ValueError, match=f"^{re.escape(str(path))}: .*{why}") as error:
            read_csv(path)
        assert "\n" not in str(error.value)


def test_a_file_of_nothing_is_refused(tmp_path):
    for write in (write_csv, write_rows):
        with pytest.raises(ValueError, match="no rows"):
            write([], tmp_path / "rows.csv")
    assert not list(tmp_path.iterdir())
