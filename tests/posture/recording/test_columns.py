"""Which column is what, in which unit and with which sign: the same motion in the conventions of several programs."""

import math

import numpy as np
import pytest

from posture.config.errors import ConfigError
from posture.recording.columns import known_name, read_recording
from posture.recording.indices import measure
from tests.posture.recording.people import config, lines, recording, times, write

MOTION = recording(0.5, 40.0, times(2.0))
DEGREES = 180 / np.pi


def read(tmp_path, content, *overrides, name="a.csv"):
    return read_recording(write(tmp_path / name, content), config(*overrides))


@pytest.mark.parametrize(
    ("names", "factor", "overrides"),
    [
        ("time,hip_left_angle_rad,ankle_left_angle_rad", 1.0, []),  # our own export
        ("time_s,hip_flexion_r_rad,ankle_angle_r_rad", -1.0, []),  # OpenSim's signs
        ("t [s],Hip_Flexion_L [deg],Ankle_Angle_L [deg]", -DEGREES, []),
        ("time,hip_flexion_r,ankle_angle_r", -DEGREES, ["angle_unit=deg"]),
        ("time,/jointset/hip_r/hip_flexion_r/value,/jointset/ankle_r/ankle_angle_r/value", -1.0, ["angle_unit=rad"]),
        (
            "clock,trunk,shank",
            DEGREES,
            ["columns.time=clock", "columns.hip=trunk", "columns.ankle=shank", "angle_unit=deg", "signs=posture"],
        ),
        ("time,H (deg),A (deg)", -DEGREES, ["columns.hip=H", "columns.ankle='A (deg)'", "signs=opensim"]),
        ("time,hip_flexion_r,ankle_angle_r", 1.0, ["angle_unit=rad", "signs=posture"]),  # signs= is stronger than the name
        ("time,hip_flexion_r_rad,ankle_angle_r_rad", 1.0, ["scale.hip=-1", "scale.ankle=-1"]),
    ],
)
def test_the_same_motion_in_each_convention(tmp_path, names, factor, overrides):
    found = read(tmp_path, lines(MOTION, names, factor=factor), *overrides)
    np.testing.assert_allclose(found.time, MOTION.time, atol=1e-12)
    np.testing.assert_allclose(found.hip, MOTION.hip, rtol=1e-12)
    np.testing.assert_allclose(found.ankle, MOTION.ankle, rtol=1e-12)
    assert found.head is None and found.target is None and not found.simulated


@pytest.mark.parametrize(
    ("overrides", "sign"), [(["scale.hip=-1"], -1), (["scale.ankle=-1"], -1), (["scale.hip=-1", "scale.ankle=-1"], 1)]
)
def test_signs_of_correlation(tmp_path, overrides, sign):
    """The table in docs/people.md: both signs reversed keep r, one reversed turns it. It is cos 40 deg."""
    found = read(tmp_path, lines(MOTION, "time,hip_left_angle_rad,ankle_left_angle_rad"), *overrides)
    settings = {"transient_s": 0.0, "tolerance_m": 0.025, "still_joint_deg": 0.5, "torque_limit": 100.0}
    assert measure(found, 0.5, **settings)[0].hip_ankle_r == pytest.approx(sign * math.cos(math.radians(40)))


def test_left_and_right_are_averaged(tmp_path):
    rows = ["time [s],hip_flexion_r_rad,hip_flexion_l_rad,ankle_angle_r_rad", "0,-0.1,-0.3,-0.2", "1,-0.2,,-0.2"]
    both = read(tmp_path, rows)
    np.testing.assert_allclose(both.hip, [0.2, np.nan])
    np.testing.assert_allclose(read(tmp_path, rows, "side=right").hip, [0.1, 0.2])
    np.testing.assert_allclose(read(tmp_path, rows, "columns.hip=[hip_flexion_l]", "side=right").hip, [0.3, np.nan])
    with pytest.raises(ConfigError, match="no column of the ankle angle; columns.ankle= names it"):
        read(tmp_path, rows, "side=left")


def test_positions_in_their_units_and_directions(tmp_path):
    rows = ["time [s],hip_flexion_r_rad,ankle_angle_r_rad,head_x_mm,target_x", "0,0.1,0.1,-20,-0.02", "1,0.2,0.1,-40,-0.05"]
    found = read(tmp_path, [rows[0].replace("target_x", "target_x_m"), *rows[1:]], "scale.head=-1", "scale.target=-1")
    np.testing.assert_allclose(found.head, [0.02, 0.04])
    np.testing.assert_allclose(found.target, [0.02, 0.05])
    with pytest.raises(ConfigError, match="nothing says the unit of column target_x, the target; length_unit=m or"):
        read(tmp_path, rows)
    with pytest.raises(ConfigError, match=r"row 4, column head_x: -40000 m is more than 5 m from the median"):
        read(tmp_path, [rows[0], "0,0.1,0.1,1,1", "1,0.1,0.1,2,1", "2,0.2,0.1,-40000,1"], "length_unit=m")


def test_a_unit_behind_the_name_of_a_column(tmp_path):
    rows = ["time,hip_flexion_r,ankle_angle_r_deg,head_x,target_x", "0,0.1,6,0,20", "0.1,0.2,6,-0.02,50"]
    keys = ("columns.hip='hip_flexion_r [rad]'", "columns.target='target_x (mm)'", "length_unit=m", "signs=posture")
    found = read(tmp_path, rows, *keys)
    np.testing.assert_allclose(found.hip, [0.1, 0.2])
    np.testing.assert_allclose(found.ankle, np.radians([6, 6]))
    np.testing.assert_allclose(found.head, [0, -0.02])
    np.testing.assert_allclose(found.target, [0.02, 0.05])
    with pytest.raises(ConfigError, match="column target_x, the target, is in deg; allowed are m, cm, mm"):
        read(tmp_path, rows, "columns.target='target_x [deg]'", *keys[2:], "columns.hip='hip_flexion_r [rad]'")


def test_times_by_rate_and_in_milliseconds(tmp_path):
    rows = ["hip_flexion_r_rad,ankle_angle_r_rad", "0.1,0.1", "0.2,0.1", "0.1,0.1"]
    np.testing.assert_allclose(read(tmp_path, rows, "rate=50").time, [0, 0.02, 0.04])
    rows = ["Time (ms),hip_flexion_r_rad,ankle_angle_r_rad", "0,0.1,0.1", "20,0.2,0.1"]
    np.testing.assert_allclose(read(tmp_path, rows).time, [0, 0.02])
    with pytest.raises(ConfigError, match="beside which rate= has no effect"):
        read(tmp_path, rows, "rate=50")


@pytest.mark.parametrize("heading", ["stamp", "stamp [s]"])
@pytest.mark.parametrize("step", [10, 0.2])  # [ms]: 100 Hz, and 5 kHz
def test_a_unit_behind_the_name_of_the_time(tmp_path, heading, step):
    rows = [f"{heading},hip_flexion_r_rad,ankle_angle_r_rad", *(f"{i * step},0.1,0.1" for i in range(3))]
    np.testing.assert_allclose(read(tmp_path, rows, "columns.time='stamp [ms]'").time, [0, step / 1000, 2 * step / 1000])
    np.testing.assert_allclose(read(tmp_path, rows, "columns.time='stamp [s]'").time, [0, step, 2 * step])
    with pytest.raises(ConfigError, match=r"column stamp, the time, is in mm; allowed are s, ms; \"columns\.time='stamp"):
        read(tmp_path, rows, "columns.time='stamp [mm]'")


def test_milliseconds_and_numbers_of_frames_are_not_taken_for_seconds(tmp_path):
    for name, step in (("time", 10), ("frame", 1)):
        rows = [f"{name},hip_flexion_r_rad,ankle_angle_r_rad", *(f"{i * step},0.1,0.1" for i in range(3))]
        with pytest.raises(ConfigError, match=f"nothing says the unit of column {name}, whose values are {step} apart"):
            read(tmp_path, rows, f"columns.time={name}")


def test_a_row_that_was_written_twice_counts_once(tmp_path):
    """As OpenSim does at the end of some files."""
    found = read(tmp_path, [*SOUND, SOUND[-1]])
    np.testing.assert_allclose(found.time, [0, 0.1, 0.2])


def test_names_of_other_programs():
    assert known_name("/jointset/hip_r/hip_flexion_r/value") == "hip_flexion_r"
    assert known_name("/jointset/hip_r/hip_flexion_r/speed") == "/jointset/hip_r/hip_flexion_r/speed"
    assert known_name("Anna:RHipAngles.x") == "rhipangles.x"


SOUND = ["time,hip_flexion_r_rad,ankle_angle_r_rad", "0,0.1,0.1", "0.1,0.2,0.1", "0.2,0.1,0.1"]


@pytest.mark.parametrize(
    ("rows", "overrides", "message"),
    [
        (
            ["time,knee", "0,1"],
            [],
            "no column of the hip angle; columns.hip= names it (known: hip_left_angle, hip_flexion_l",
        ),
        ([SOUND[0].replace("time", "frame"), *SOUND[1:]], [], "no column of times; columns.time= names it, or rate="),
        ([*SOUND[:2], "0,0.1,0.2"], [], "row 3, column time: 0 does not come after 0, the time before it"),
        ([*SOUND[:3], "0.05,0.1,0.1"], [], "row 4, column time: 0.05 does not come after 0.1"),
        ([*SOUND[:3], ",0.1,0.1"], [], "row 4, column time: has no time"),
        ([*SOUND[:3], "inf,0.1,0.1"], [], "row 4, column time: infinite"),
        (
            [SOUND[0].replace("_rad", ""), *SOUND[1:]],
            [],
            "nothing says the unit of column hip_flexion_r, the hip; angle_unit=",
        ),
        (
            [*SOUND[:3], "0.2,35,0.1"],
            [],
            "row 4, column hip_flexion_r: 35 rad is more than 10 rad; angle_unit= sets another",
        ),
        (
            [*SOUND[:3], "0.2,0.1,6.2"],
            [],
            "row 4, column ankle_angle_r: jumps from 0.1 to 6.2 rad; allowed are angles that do",
        ),
        (["time,a_b,a_rad", "0,1,1"], ["columns.hip=B"], "no column B, which columns.hip names; there are a_b, time, a"),
        (SOUND, ["columns.hip=hop"], "no column hop, which columns.hip names; there are time, hip_flexion_r, ankle_angle_r"),
        (
            ["time,a_rad,b_rad", "0,1,1"],
            ["columns.hip=a", "columns.ankle=b"],
            "nothing says the sign of column a, the hip; signs=",
        ),
        (["time,hip_flexion_r_rad,hip_flexion_r_deg,ankle_angle_r_rad", "0,1,1,1"], [], "could both be the right hip angle"),
        (["time,a_rad,a_rad,ankle_angle_r_rad", "0,1,1,1"], ["columns.hip=a", "signs=opensim"], "2 columns are called a"),
        (
            ["time,hip_flexion_r_rad,ankle_angle_r_rad", "0,,1", "1,,1"],
            [],
            "the column of the hip, hip_flexion_r, has no numbers",
        ),
        (["time,t,hip_flexion_r_rad,ankle_angle_r_rad", "0,0,1,1"], [], "time and t could both be the time; columns.time="),
    ],
)
def test_what_is_wrong_in_one_line(tmp_path, rows, overrides, message):
    with pytest.raises(ConfigError) as refusal:
        read(tmp_path, rows, *overrides)
    assert message in str(refusal.value) and "\n" not in str(refusal.value)
    assert str(refusal.value).startswith(str(tmp_path / "a.csv"))
