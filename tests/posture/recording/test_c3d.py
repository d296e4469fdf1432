"""C3D files that ezc3d itself wrote."""

import struct
import sys

import ezc3d
import numpy as np
import pytest

from posture.config.errors import ConfigError
from posture.recording.c3d import read_c3d
from posture.recording.columns import read_recording
from tests.posture.recording.people import HEAD, config, recording, times, wave, write

RATE = 100.0


def write_c3d(path, points, rate=RATE, units="mm", angle_units="deg", channels=None, channel_units="V"):
    """`points`: (3, T) by label. `channels`: (T x k,) by label."""
    content = ezc3d.c3d()
    content["parameters"]["POINT"]["RATE"]["value"] = [rate]
    content["parameters"]["POINT"]["LABELS"]["value"] = list(points)
    content["parameters"]["POINT"]["UNITS"]["value"] = [units]
    if angle_units:
        content.add_parameter("POINT", "ANGLE_UNITS", [angle_units])
    stacked = np.stack(list(points.values()), axis=1)
    content["data"]["points"] = np.concatenate([stacked, np.ones((1, *stacked.shape[1:]))])
    if channels:
        count = len(next(iter(channels.values()))) // stacked.shape[2]
        content["parameters"]["ANALOG"]["RATE"]["value"] = [rate * count]
        content["parameters"]["ANALOG"]["LABELS"]["value"] = list(channels)
        content["parameters"]["ANALOG"]["UNITS"]["value"] = len(channels) * [channel_units]
        content["data"]["analogs"] = np.stack(list(channels.values()))[None]
    content.write(str(path))
    return path


def along_x(values):
    return np.stack([values, 0 * values + 7.0, 0 * values - 7.0])


def plug_in_gait(motion):
    """Model outputs and a marker of a motion in our signs: degrees, millimetres, y forward."""
    return {
        "LFHD": np.stack([0 * motion.head, 1e3 * motion.head + 3.0, 0 * motion.head + 1700.0]),
        "RFHD": np.stack([0 * motion.head, 1e3 * motion.head - 3.0, 0 * motion.head + 1700.0]),
        "Anna:RHipAngles": along_x(-np.degrees(motion.hip) + 1.0),
        "Anna:LHipAngles": along_x(-np.degrees(motion.hip) - 1.0),
        "Anna:RAnkleAngles": along_x(-np.degrees(motion.ankle)),
        "Anna:LAnkleAngles": along_x(-np.degrees(motion.ankle)),
    }


def test_a_file_that_was_cut_short_is_refused(tmp_path):
    path = write_c3d(tmp_path / "a.c3d", plug_in_gait(recording(0.5, 30.0)))
    content = path.read_bytes()
    path.write_bytes(content[: len(content) // 2])
    with pytest.raises(ConfigError, match=r"was cut short: it has \d+ of its 4000 frames"):
        read_c3d(path)


def test_a_file_of_a_mips_processor_is_refused(tmp_path):
    """Big-endian, as far as a reader comes: the words of the header, and the processor at byte 4 of the parameters."""
    path = write_c3d(tmp_path / "a.c3d", plug_in_gait(recording()))
    content = bytearray(path.read_bytes())
    content[2:512] = struct.pack(">255H", *struct.unpack("<255H", content[2:512]))
    assert content[515] == 84  # Intel
    content[515] = 86
    with pytest.raises(ConfigError, match=r"a\.c3d: is in the MIPS \(SGI\) format of C3D, which ezc3d cannot read; convert"):
        read_c3d(write(path, bytes(content)))


def test_a_file_without_points_or_without_a_rate_is_refused(tmp_path):
    path = write_c3d(tmp_path / "a.c3d", plug_in_gait(recording()))
    content = path.read_bytes()
    rate = content.index(struct.pack("<f", RATE), 512)  # POINT:RATE is the first 100.0 of the parameters
    path.write_bytes(content[:rate] + struct.pack("<f", -5.0) + content[rate + 4 :])
    with pytest.raises(ConfigError, match=r"a\.c3d: has a POINT:RATE of -5 Hz; allowed is a sampling rate above 0"):
        read_c3d(path)
    content = ezc3d.c3d()
    content["parameters"]["POINT"]["RATE"]["value"] = [RATE]
    content["data"]["points"] = np.ones((4, 0, 40))
    content.write(str(path))
    with pytest.raises(ConfigError, match=r"a\.c3d: has no points; at least one with a name in POINT:LABELS is needed"):
        read_c3d(path)


def test_angles_of_plug_in_gait_and_the_mean_of_two_markers(tmp_path):
    motion = recording(0.5, 30.0)
    path = write_c3d(tmp_path / "a.c3d", plug_in_gait(motion))
    found = read_recording(path, config("columns.head=[LFHD.y,RFHD.y]"))
    np.testing.assert_allclose(found.time, motion.time, atol=1e-9)
    np.testing.assert_allclose(found.hip, motion.hip, atol=1e-6)  # single precision in the file
    np.testing.assert_allclose(found.ankle, motion.ankle, atol=1e-6)
    np.testing.assert_allclose(found.head, motion.head, atol=1e-6)
    assert found.target is None
    right = read_recording(path, config("side=right"))
    np.testing.assert_allclose(right.hip, motion.hip - np.radians(1.0), atol=1e-6)


def test_a_channel_is_averaged_about_each_frame_and_missing_points_are_nan(tmp_path):
    """Ten samples a frame, of which the first is as old as the frame's points. A sawtooth whose mean over ten samples is 0
    drops out; half a frame of delay would be an error of 1 mm."""
    motion = recording(0.5)
    target = HEAD * (1 - wave(times(rate=10 * RATE), 0.5)) + np.tile(np.linspace(-0.01, 0.01, 10), len(motion.time))
    points = plug_in_gait(motion)
    points["Anna:RHipAngles"][:, 5] = np.nan
    path = write_c3d(tmp_path / "a.c3d", points, channels={"Laser": target}, channel_units="m")
    found = read_recording(path, config("columns.target=Laser"))
    np.testing.assert_allclose(found.target[1:-1], motion.target[1:-1], atol=1e-5)
    assert np.flatnonzero(np.isnan(found.hip)).tolist() == [5]


def test_a_channel_in_volts_does_not_count_as_millimetres(tmp_path):
    """0.04 m a volt."""
    motion = recording(0.5)
    for units, named in (("V", "V"), ("", "an unknown unit")):
        path = write_c3d(
            tmp_path / "a.c3d", plug_in_gait(motion), channels={"Laser": motion.target / 0.04}, channel_units=units
        )
        with pytest.raises(ConfigError, match=f"column Laser, the target, is in {named}; allowed are m, cm, mm"):
            read_recording(path, config("columns.target=Laser"))
    found = read_recording(path, config("columns.target='Laser [m]'", "scale.target=0.04", "columns.head=LFHD.y"))
    np.testing.assert_allclose(found.target, motion.target, atol=1e-6)
    np.testing.assert_allclose(found.head, motion.head + 0.003, atol=1e-6)  # still in mm


def test_the_unit_of_angles_is_not_guessed(tmp_path):
    path = write_c3d(tmp_path / "a.c3d", plug_in_gait(recording()), angle_units=None)
    with pytest.raises(ConfigError, match=r"nothing says the unit of column Anna:LHipAngles\.x, the hip; angle_unit=rad or"):
        read_recording(path, config())
    assert np.isfinite(read_recording(path, config("angle_unit=deg")).hip).all()


def test_a_place_is_named_by_its_frame(tmp_path):
    points = plug_in_gait(recording())
    points["Anna:LHipAngles"][0, 41] = 700.0
    with pytest.raises(ConfigError, match=r"a\.c3d: frame 42, column Anna:LHipAngles\.x: 700 deg is more than 10 rad"):
        read_recording(write_c3d(tmp_path / "a.c3d", points), config())


@pytest.mark.parametrize("content", [b"", b"time,hip\n0,1\n", bytes(range(256)) * 40])
def test_a_file_that_is_none(tmp_path, content):
    with pytest.raises(ConfigError) as refusal:
        read_c3d(write(tmp_path / "a.c3d", content))
    assert "a.c3d: is not a C3D file that ezc3d can read" in str(refusal.value) and "\n" not in str(refusal.value)


def test_without_ezc3d(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "ezc3d", None)
    with pytest.raises(ConfigError, match="python -m pip install ezc3d"):
        read_c3d(tmp_path / "a.c3d")
