"""Text files as programs write them: the numbers by hand, and one line that names the place of what is wrong."""

import math

import numpy as np
import pytest

from posture.config.errors import ConfigError
from posture.recording.table import name_and_unit
from posture.recording.text import read_lines, read_text
from tests.posture.recording.people import write

NUMBERS = [[0.0, 1.5, -2.0], [0.1, 2.5, -3.0]]


def read(tmp_path, name, content):
    path = write(tmp_path / name, content)
    table = read_text(path, read_lines(path))
    return table, table.values(range(len(table.names)))


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("a.csv", "time,hip,ankle\n0,1.5,-2\n0.1,2.5,-3\n"),
        ("a.csv", "time,hip,ankle\r\n0,1.5,-2\r\n0.1,2.5,-3"),  # Windows, no end of line at the end
        ("a.csv", b"\xef\xbb\xbftime,hip,ankle\n0,1.5,-2\n0.1,2.5,-3\n"),  # a byte order mark
        ("a.csv", "time,hip,ankle\n0,1.5,-2\n0.1,2.5,-3\n".encode("utf-16")),
        ("a.csv", "time;hip;ankle\n0;1,5;-2\n0,1;2,5;-3\n"),  # decimal commas
        ("a.csv", "sep=;\ntime;hip;ankle\n0;1.5;-2\n0.1;2.5;-3\n"),  # of Excel
        ("a.csv", '"time","hip","ankle"\n"0","1.5","-2"\n"0.1","2.5","-3"\n'),
        ("a.csv", "# a note, with a comma\n\ntime,hip,ankle\n\n0,1.5,-2\n\n0.1,2.5,-3\n\n"),
        ("a.csv", "time,hip,ankle,\n0,1.5,-2,\n0.1,2.5,-3,\n"),  # a separator at the end of each line
        ("a.tsv", "time\thip\tankle\n0\t1.5\t-2\n0.1\t2.5\t-3\n"),
        ("a.tsv", "time\thip\tankle\n0\t1,5\t-2\n0,1\t2,5\t-3\n"),
        ("a.txt", "time  hip ankle\n 0  1.5 -2\n 0.1 2.5  -3\n"),
        (
            "a.sto",
            "any\nversion=1\nnRows=2\nnColumns=3\ninDegrees=no\nendheader\ntime\thip\tankle\n0\t1.5\t-2\n0.1\t2.5\t-3\n",
        ),
        ("a.mot", "any\nnRows=2\n\nA note.\nendheader\n\ntime\thip\tankle\n  0\t 1.5\t -2\t\n  0.1\t 2.5\t -3\t\n"),
    ],
)
def test_the_same_numbers_from_each_format(tmp_path, name, content):
    table, values = read(tmp_path, name, content)
    assert list(table.names) == ["time", "hip", "ankle"]
    np.testing.assert_array_equal(values, NUMBERS)
    np.testing.assert_array_equal(table.values([2, 0]), np.array(NUMBERS)[:, [2, 0]])


def test_missing_values_and_rows_as_an_editor_counts_them(tmp_path):
    table, values = read(tmp_path, "a.csv", "# note\ntime,hip,ankle\n0,,-2\n\n0.1,NaN,NA\n")
    np.testing.assert_array_equal(values, [[0, math.nan, -2], [0.1, math.nan, math.nan]])
    assert list(table.rows) == [3, 5]
    assert table.place(1, 2).endswith("a.csv: row 5, column ankle")


@pytest.mark.parametrize(
    ("heading", "name", "unit"),
    [
        ("hip_left_angle_rad", "hip_left_angle", "rad"),
        ("hip_left_velocity_rad_per_s", "hip_left_velocity", "rad"),
        ("head_vx_m_per_s", "head_vx", "m"),
        ("Hip flexion [deg]", "Hip flexion", "deg"),
        ("Hip (°)", "Hip", "deg"),
        ("time_s", "time", "s"),
        ("Time (ms)", "Time", "ms"),
        ("hip_flexion_r", "hip_flexion_r", ""),  # r is no unit
        ("head [forward]", "head [forward]", ""),
    ],
)
def test_units_of_headings(heading, name, unit):
    assert name_and_unit(heading) == (name, unit)


def test_a_row_of_units_and_those_of_a_header(tmp_path):
    table, values = read(tmp_path, "a.csv", "time,hip,ankle\ns,deg,[rad]\n0,1.5,-2\n0.1,2.5,-3\n")
    assert list(table.units) == ["s", "deg", "rad"] and values.shape == (2, 3)
    for word, unit in (("yes", "deg"), ("no", "rad"), ("Yes", "deg")):
        table, _ = read(tmp_path, "a.mot", f"x\ninDegrees={word}\nendheader\ntime\thip\n0\t1\n")
        assert table.units_of == {"angle": unit, "length": "m"}
    table, _ = read(tmp_path, "b.mot", "x\nendheader\ntime\thip\n0\t1\n")
    assert table.units_of == {"length": "m"}


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("a.csv", "", "is empty"),
        ("a.csv", " \n\n", "is empty"),
        ("a.csv", "time,hip,ankle\n", "has names of columns, but no rows of numbers"),
        ("a.csv", "# only\n% comments\n", "has comments only"),
        ("a.csv", "0,1,2\n3,4,5\n", "begins with numbers"),
        ("a.csv", "time\n0\n1\n", "has one column only, 'time'"),
        ("a.csv", "time,hip\n0,1\n0.1,abc\n", "row 3, column hip: 'abc' is not a number"),
        ("a.csv", "time,hip\n0,1\n\n0.1,1..2\n", "row 4, column hip: '1..2' is not a number"),
        ("a.csv", "time,hip\n0,1\n0.1\n", "row 3 has 1 cells, but the file has 2 columns"),
        ("a.csv", "time,hip\n0,1\n0.1,2,3\n", "row 3 has 3 cells, but the file has 2 columns"),
        ("a.csv", "time,hip\n0,1\n0.1,2,3\n0.2\n", "row 3 has 3 cells"),  # as many separators as in a sound file
        ("a.csv", "time;hip\n0;1.234,5\n", "row 2, column hip: '1.234,5' is not a number"),
        ("a.csv", b"time,hip\n0,\0\n", "is not a text file"),
        ("a.sto", "x\nnRows=1\ntime\thip\n0\t1\n", "has no endheader"),
        ("a.sto", "x\nendheader\n", "has no labels after endheader"),
        ("a.sto", "x\nendheader\ntime\thip\tankle\n0\t1\t2\n1\t2\n", "row 5 has 2 cells, but the file has 3 columns"),
    ],
)
def test_what_is_wrong_in_one_line(tmp_path, name, content, message):
    with pytest.raises(ConfigError) as refusal:
        read(tmp_path, name, content)
    assert message in str(refusal.value) and "\n" not in str(refusal.value)
    assert str(refusal.value).startswith(str(tmp_path / name))
