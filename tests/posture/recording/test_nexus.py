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


def test_what_is_wrong_in_one_line(tmp_path):
    rows = nexus(MOTION)
    rows[9] = rows[9].replace(",0,", ",0,x", 1)
    with pytest.raises(ConfigError, match=r"a\.csv: row 10, column Anna:RHipAngles\.x: 'x.*' is not a number"):
        read_recording(write(tmp_path / "a.csv", rows), config())
    with pytest.raises(ConfigError, match="has headings of Vicon Nexus, but no rows of numbers"):
        read_recording(write(tmp_path / "a.csv", [*rows[:5], ""]), config())
    with pytest.raises(ConfigError, match="has a sampling rate of 100 Hz, beside which rate= has no effect"):
        read_recording(write(tmp_path / "a.csv", nexus(MOTION)), config("rate=50"))
