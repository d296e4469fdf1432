"""Films: what a picture shows, against the trial it was made of and formulas; the command, and what it refuses."""

import math
import os
import subprocess
import sys

import hydra
import numpy as np
import pytest
from matplotlib.colors import to_rgb

from posture.analysis.trajectory import Trajectory
from posture.cli.jobs import CONF, plain
from posture.config.errors import RunError
from posture.config.film import FilmConfig
from posture.config.reading import read
from posture.drawing.silhouette import TARGET_COLOUR
from posture.drawing.style import BLUE, FALL_COLOUR, RED
from posture.film import trials as film_trials
from posture.film.__main__ import bracketed, film
from posture.film.motion import Motion, at_frames, running_correlation
from posture.film.scene import Ramp, TwoModes
from posture.storage import run_dir
from posture.storage.run_dir import PRETRAINED
from tests import commands
from tests.commands import refused
from tests.posture.film.test_video import decoded_gif, decoded_mp4

HEIGHT = 1.7  # of the target [m], paper Table 1
needs_policy = pytest.mark.skipif(not PRETRAINED.is_dir(), reason="no policies are shipped yet")


@pytest.fixture(autouse=True)
def _elsewhere(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setitem(commands.ENTRIES, "film", (FilmConfig, film))


def configured(*overrides):
    with hydra.initialize_config_dir(str(CONF), version_base="1.3"):
        return read(FilmConfig, plain(hydra.compose("film", list(overrides))))


# -- the command ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("given", "seen"),
    [
        (["ckpt=a", "env.freq=0.15,1.5"], ["ckpt=a", "env.freq=[0.15,1.5]"]),
        (["env.freq=[0.15,1.5]"], ["env.freq=[0.15,1.5]"]),
        (["env.freq=0.7"], ["env.freq=0.7"]),
        (["films=[ramp]", "out=a,b"], ["films=[ramp]", "out=a,b"]),
        (["-m", "env.freq=0.15,1.5"], ["-m", "env.freq=0.15,1.5"]),
    ],
)
def test_two_frequencies_are_one_film(given, seen):
    assert bracketed(given) == seen


def test_one_frequency_or_several():
    assert configured("env.freq=0.7").env.freq == (0.7,)
    assert configured("env.freq=[0.3,0.6,0.9]").env.freq == (0.3, 0.6, 0.9)


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        (["env.freq=0"], "env.freq.0 = 0: must be greater than"),
        (["env.freq=-1"], "env.freq.0 = -1: must be greater than"),
        (["env.freq=[0.5,11]"], "env.freq.1 = 11: must be less than or equal to 10"),
        (["env.freq=8"], "env.freq = 8: fewer than 4 frames to a cycle; allowed is up to 6 Hz with fps = 24"),
        (["env.freq=0.001"], "env.freq = 0.001: a cycle lasts 1000 s, longer than a film; allowed is 0.0166667 Hz or more"),
        (["env.freq=fast"], "env.freq.0 = 'fast': must be a valid number"),
        (["env.freq=[]"], "env.freq = []: "),
        (["env.freq=[1,1,1,1,1]"], "at most 4"),
        (["env.ramp.duration=90"], "env.ramp.duration = 90: allowed is up to longest = 60 s"),
        (["ckpt=nowhere"], "nowhere: no such file or folder"),
        (["ckpt=pretrained/nobody"], "pretrained/nobody: no such policy"),
        (["out=taken/film"], "cannot write to the folder taken/film"),
        (["width=361"], "width = 361: must be a multiple of 2"),
        (["fps=100"], "fps = 100: must be less than or equal to 50"),
        (["films=[three_modes]"], "'two_modes' or 'ramp'"),
        (["formats=[avi]"], "'mp4' or 'gif'"),
        (["frequency=1"], "frequency"),
    ],
)
def test_bad_input(monkeypatch, capsys, tmp_path, arguments, expected):
    (tmp_path / "taken").write_text("a file, not a folder")
    assert expected in refused(monkeypatch, capsys, "film", *arguments)
    assert [path.name for path in tmp_path.iterdir()] == ["taken"]


def test_a_sweep_of_policies_is_refused(monkeypatch, capsys):
    assert "a film shows one" in refused(monkeypatch, capsys, "film", f"ckpt={PRETRAINED}")


@needs_policy
def test_the_command_as_written_makes_both_files_without_a_display(tmp_path):
    """At 6 frames a second a cycle at 1.5 Hz has four; a cycle at 0.15 Hz lasts 6.67 s."""
    shown = {key: value for key, value in os.environ.items() if key not in ("DISPLAY", "WAYLAND_DISPLAY", "MPLBACKEND")}
    arguments = ["ckpt=pretrained", "env.freq=0.15,1.5", "films=[two_modes]", "out=here", "width=60", "fps=6", "settle=0"]
    done = subprocess.run(
        [sys.executable, "-m", "posture.film", *arguments],
        cwd=tmp_path,
        env=shown | {"GIT_PYTHON_REFRESH": "quiet"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert {path.name for path in (tmp_path / "here").iterdir()} == {"two_modes.mp4", "two_modes.gif"}
    frames, duration, codec = decoded_mp4(tmp_path / "here" / "two_modes.mp4")
    # Two panels of 60 px; 4.5 in where a panel has 3.6: 75 px, of which H.264 takes an even number.
    assert frames.shape[0] == 40 and frames.shape[2] == 120 and frames.shape[1] in (74, 76) and codec == "h264"
    assert duration == pytest.approx(1 / 0.15, abs=0.02)
    images, lengths, loops = decoded_gif(tmp_path / "here" / "two_modes.gif")
    assert images.shape == frames.shape and sum(lengths) == pytest.approx(6.67) and loops == 0
    for film_frames in (frames, images):
        moved = np.abs(np.diff(film_frames.astype(int), axis=0)).max(axis=(1, 2, 3))
        assert (moved > 30).all()  # each frame differs from the one before
        assert (film_frames.std(axis=(1, 2, 3)) > 20).all()  # and none is blank
        halves = film_frames[:, :, :60], film_frames[:, :, 60:]
        assert all((np.abs(np.diff(half.astype(int), axis=0)).max(axis=(1, 2, 3)) > 15).mean() > 0.9 for half in halves)


# -- a real trial -----------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def filmed():
    """Films of the shipped policy, and the trials they were made of."""
    if not PRETRAINED.is_dir():
        pytest.skip("no policies are shipped yet")
    config = configured("env.freq=[0.5,1.5]", "settle=4", "shortest=1.9", "fps=12", "width=120", "env.ramp.duration=8")
    model = run_dir.find_checkpoints("pretrained")[0]
    run, trials, rollout = run_dir.read_config(model.parent), [], film_trials.rollout
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(film_trials, "rollout", lambda *given: trials.append(rollout(*given)) or trials[-1])
        scenes = [make(config, model, run) for make in (film_trials.two_modes, film_trials.ramp)]
    return scenes, trials


def marks(stage):
    """Ball, head dot, and the middle of the drawn head [m]."""
    box = stage.body.layers[2].get_path().get_extents()
    return stage.ball.center, stage.head.center, ((box.x0 + box.x1) / 2, (box.y0 + box.y1) / 2)


def test_the_picture_shows_the_trial(filmed):
    (film, _), (trial, _) = filmed
    assert len(film) == 24 and film.fps == pytest.approx(12)  # one cycle at 0.5 Hz, 2 s
    # Both begin where a cycle does: 4 s is one at either frequency.
    for i in range(0, 24, 5):
        film.show(i)
        for world, (_, stage, *_) in enumerate(film._panels):
            ball, dot, head = marks(stage)
            now, freq = 4 + i / 12, (0.5, 1.5)[world]
            assert ball == pytest.approx((0.1 * (1 - math.cos(2 * math.pi * freq * now)), HEIGHT), abs=5e-4)
            head_x = np.interp(now, trial.time, trial.head_x[:, world])
            assert dot[0] == pytest.approx(head_x, abs=1e-9)
            # The body is drawn from its joint angles over flat feet: in the soft contact they tilt a little.
            assert head == pytest.approx((head_x, dot[1]), abs=0.006)


def test_the_ramp_shows_the_trial(filmed):
    (_, film), (_, trial) = filmed
    assert len(film) == 96
    for i in (50, 70, 95):
        film.show(i)
        now = i / 12
        ball, dot, head = marks(film._stage)
        # The integral of 0.036 Hz/s times t.
        assert ball == pytest.approx((0.1 * (1 - math.cos(2 * math.pi * 0.018 * now**2)), HEIGHT), abs=5e-4)
        assert dot[0] == pytest.approx(np.interp(now, trial.time, trial.head_x[:, 0]), abs=1e-9)
        assert head == pytest.approx(dot, abs=0.01)
        assert (film._freq.get_text(), film._clock.get_text()) == (f"{0.036 * now:.2f} Hz", f"{now:.1f} s")
        # Pearson's correlation of the 300 steps around now, by numpy.
        middle = round(now / trial.control_dt) - 1
        around = slice(middle - 150, middle + 150)
        r = np.corrcoef(trial.hip[around, 0], trial.ankle[around, 0])[0, 1]
        assert float(film._dot.get_ydata()[0]) == pytest.approx(r, abs=0.02)
        assert film._dot.get_xdata()[0] == pytest.approx(0.036 * now)


def test_pixels_show_the_target(filmed):
    """The ball's colour, found in the frame, is where the axes say that the target is."""
    (film, _), _ = filmed
    for i in (3, 12):
        frame = film[i]
        _, stage, *_ = film._panels[0]
        x, y = stage.ball.axes.transData.transform(stage.ball.center)
        near = np.abs(frame[len(frame) - 1 - int(y), int(x)] / 255 - to_rgb(TARGET_COLOUR)).max()
        assert near < 0.1
    with pytest.raises(IndexError):
        film[24]


def test_a_frame_does_not_depend_on_those_before(filmed):
    (film, _), _ = filmed
    first = film[5]
    film[17]
    np.testing.assert_array_equal(film[5], first)


# -- what is told about a motion --------------------------------------------------------------------------------------


def swaying(lag, freq=1.0, seconds=10.0, dt=0.02, fall_step=-1):
    """A stander whose ankle sways with its hip, `lag` [rad] behind it."""
    time = dt * np.arange(1, round(seconds / dt) + 1)
    hip, ankle = (np.radians(a) * np.sin(2 * math.pi * freq * time - b) for a, b in ((10, 0), (5, lag)))
    angle = np.stack([hip, ankle, hip, ankle], axis=-1)[:, None]
    still = np.zeros((len(time), 1))
    fields = dict.fromkeys(("target_x", "head_x", "head_vx", "cop_x", "torso_height", "foot_displacement"), still)
    trial = dict(
        fields,
        time=time,
        freq=[freq],
        **dict.fromkeys(("hip_k", "ankle_k", "load"), [0.0]),
        **dict.fromkeys(("joint_angle", "joint_velocity", "joint_torque"), angle),
        foot_flat=still == 0,
        fall_step=[fall_step],
        torque_limit=100.0,
        control_dt=dt,
    )
    if fall_step >= 0:
        trial["joint_angle"] = np.where(np.arange(len(time))[:, None, None] < fall_step, angle, np.nan)
    return Trajectory(**trial)


def filmed_sway(trial, freq=1.0):
    r = running_correlation(trial, 0, 50, 0.0, centred=False)
    motion = at_frames(trial, 0, freq, r, 4.0, np.arange(0, 2, 0.1))
    cycle = at_frames(trial, 0, freq, r, 4.0, np.linspace(0, 1 / freq, 41))
    return TwoModes([motion], [cycle], 60, HEIGHT, 0.2)


@pytest.mark.parametrize(
    ("lag", "told", "colour"),
    [
        (0.0, "in-phase   r = +1.00", BLUE),
        (math.pi, "anti-phase   r = \u22121.00", RED),
        (1.0, "in-phase   r = +0.54", BLUE),
    ],
)
def test_the_mode_is_told_by_the_running_correlation(lag, told, colour):
    """Of two sinusoids it is the cosine of their distance: cos 1 = 0.54."""
    film = filmed_sway(swaying(lag))
    film.show(7)
    title = film._panels[0][2]
    assert (title.get_text(), title.get_color()) == (told, colour)


def test_the_window_holds_a_whole_cycle():
    """A quarter of a cycle has a correlation of its own: of a sine and one an eighth behind it cos(pi / 4) on a whole."""
    trial = swaying(math.pi / 4, freq=0.25)
    r = running_correlation(trial, 0, 50, 0.0, centred=False)
    assert np.isnan(r[:199]).all()
    assert r[199:] == pytest.approx(math.sqrt(0.5), abs=1e-6)


def test_a_fall_is_told_and_the_last_pose_kept():
    """It falls 1 s after the film has begun, at 5 s of the trial, which is its 250th step."""
    film = filmed_sway(swaying(0.0, fall_step=249))
    motion, _, title, *_ = film._panels[0]
    assert motion.fall == pytest.approx(1.0)
    film.show(5)
    assert title.get_text().startswith("in-phase")
    film.show(15)
    assert (title.get_text(), title.get_color()) == ("fell", FALL_COLOUR)
    assert motion.hip[15] == pytest.approx(math.radians(10) * math.sin(2 * math.pi * 4.98))
    with pytest.raises(RunError, match="fell at the first step"):
        filmed_sway(swaying(0.0, fall_step=0))


def test_the_switch_appears_where_the_correlation_changes_sign():
    """A correlation that falls linearly with the frequency, from 1 at rest: (0.6 - f) / 0.6, zero at 0.6 Hz."""
    time = np.linspace(0, 10, 101)
    still, freq = np.zeros(101), time / 10
    motion = Motion(time, freq, still, still, still, still, still, (0.6 - freq) / 0.6, math.inf)
    film = Ramp(motion, np.full(101, np.nan), motion, 5.0, 60, HEIGHT, 0.2, 0.69)
    line, text = film._switch
    film.show(59)
    assert not text.get_visible() and film._mode.get_text() == "in-phase   r = +0.02"
    film.show(61)
    assert text.get_visible() and text.get_text() == "0.60 Hz" and line.get_xdata()[0] == pytest.approx(0.6)
    assert film._mode.get_color() == RED
