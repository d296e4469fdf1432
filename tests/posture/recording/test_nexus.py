"""The text export of Vicon Nexus, as it is laid out: two sections of one rate, and one of another."""

import numpy as np
import pytest

from posture.config.errors import ConfigError
from posture.recording.columns import read_recording
from posture.recording.formats import read_table
from tests.posture.recording.people import config, recording, times, write

MOTION = recording(0.5, 40.0, times(2.0))


def nexus(motion):
    hip, ankle = -np.degrees(motion.hip), -np.degrees(motion.ankle)
    count = range(len(hip))
    return [
        "Model Outputs,,,,,,,",
        "100,,,,,,,",
        ",,Anna:RHipAngles,,,Anna:RAnkleAngles,,",
        "Frame,Sub Frame,X,Y,Z,X,Y,Z",
        ",,deg,deg,deg,deg,deg,deg",
        *(f"{i + 1},0,{float(hip[i])!r},1,2,{float(ankle[i])!r},3,4" for i in count),
        "",
        "Trajectories",
        "100",
        ",,Anna:LFHD,,",
        "Frame,Sub Frame,X,Y,Z",
        ",,mm,mm,mm",
        *(f"{i + 1},0,7,{1e3 * float(motion.head[i])!r},1700" for i in count),
        "",
        "Devices",
        "1000",
        ",,Force,,",
        "Frame,Sub Frame,Fx,Fy,Fz",
        ",,N,N,N",
        *(f"{i + 1},{k},0,0,700" for i in count for k in range(10)),
    ]


def test_sections_of_one_rate_are_one_table(tmp_path):
    path = write(tmp_path / "a.csv", nexus(MOTION))
    table = read_table(path)
    assert table.rate == 100.0 and len(table.names) == 8 + 5 and table.names[2] == "Anna:RHipAngles.x"
    assert table.units[2] == "deg" and table.units[9 + 1] == "mm"
    found = read_recording(path, config("columns.head=[Anna:LFHD.y]"))
    np.testing.assert_allclose(found.hip, MOTION.hip, rtol=1e-12)
    np.testing.assert_allclose(found.ankle, MOTION.ankle, rtol=1e-12)
    np.testing.assert_allclose(found.head, MOTION.head, atol=1e-12)
    np.testing.assert_allclose(found.time, MOTION.time, atol=1e-12)


def test_a_faster_section_may_come_first(tmp_path):
    """With its analogue devices at 1000 Hz above the angles and markers at 100 Hz, the file says the same."""
    rows = nexus(MOTION)
    at = rows.index("Devices")
    path = write(tmp_path / "a.csv", [*rows[at:], "", *rows[:at]])
    table = read_table(path)
    assert table.rate == 100.0 and len(table.names) == 8 + 5
    # Rows of the file as an editor numbers them: ten a frame and five headings of the devices, a blank, five headings.
    assert table.rows[0] == 10 * len(MOTION.time) + 5 + 1 + 5 + 1
    found = read_recording(path, config("columns.head=[Anna:LFHD.y]"))
    np.testing.assert_allclose(found.hip, MOTION.hip, rtol=1e-12)
    np.testing.assert_allclose(found.head, MOTION.head, atol=1e-12)
    np.testing.assert_allclose(found.time, MOTION.time, atol=1e-12)


def test_which_section_gives_the_rate(tmp_path):
    """Not a slower one, if another has a row for each frame; of sections with other titles the slowest."""
    rows = ["Slow Devices", "10", ",,EMG", "Frame,Sub Frame,V", ",,V", "1,0,0.5", "11,0,0.6", "", *nexus(MOTION)]
    assert read_table(write(tmp_path / "a.csv", rows)).rate == 100.0
    renamed = ["Others" if row in ("Model Outputs,,,,,,,", "Trajectories") else row for row in nexus(MOTION)]
    at = renamed.index("Devices")
    table = read_table(write(tmp_path / "a.csv", [*renamed[at:], "", *renamed[:at]]))
    assert table.rate == 100.0 and table.names[2] == "Anna:RHipAngles.x"


def test_what_is_wrong_in_one_line(tmp_path):
    rows = nexus(MOTION)
    rows[9] = rows[9].replace(",0,", ",0,x", 1)
    with pytest.raises(ConfigError, match=r"a\.csv: row 10, column Anna:RHipAngles\.x: 'x.*' is not a number"):
        read_recording(write(tmp_path / "a.csv", rows), config())
    with pytest.raises(ConfigError, match="has headings of Vicon Nexus, but no rows of numbers"):
        read_recording(write(tmp_path / "a.csv", [*rows[:5], ""]), config())
    with pytest.raises(ConfigError, match="has a sampling rate of 100 Hz, beside which rate= has no effect"):
        read_recording(write(tmp_path / "a.csv", nexus(MOTION)), config("rate=50"))
