"""Films: the drawn artists against the trial and formulas, the frames as pixels, and the command."""

import math
import os
import subprocess
import sys

import numpy as np
import pytest
from matplotlib.colors import to_rgb

from posture.analysis.trajectory import Trajectory
from posture.config.errors import RunError
from posture.config.film import FilmConfig
from posture.drawing.silhouette import TARGET_COLOUR
from posture.drawing.style import BLUE, FALL_COLOUR, RED
from posture.film import trials
from posture.film.__main__ import with_frequency_list
from posture.film.pictures import RampFilm, TwoModesFilm
from posture.film.sampling import SampledTrial, running_correlation, sample
from posture.storage import run_dir
from posture.storage.run_dir import PRETRAINED
from tests.commands import refused
from tests.conftest import composed
from tests.posture.film.test_video import decode_gif, decode_mp4

pytestmark = pytest.mark.usefixtures("elsewhere")

HEIGHT = 1.7  # of the target [m], paper Table 1


def configured(*overrides):
    return composed("film", FilmConfig, overrides)


@pytest.mark.parametrize(
    ("argv", "expected"),
    [
        (["ckpt=a", "env.freq=0.15,1.5"], ["ckpt=a", "env.freq=[0.15,1.5]"]),
        (["env.freq=[0.15,1.5]"], ["env.freq=[0.15,1.5]"]),
        (["env.freq=0.7"], ["env.freq=0.7"]),
        (["films=[ramp]", "out=a,b"], ["films=[ramp]", "out=a,b"]),
        (["-m", "env.freq=0.15,1.5"], ["-m", "env.freq=0.15,1.5"]),
    ],
)
def test_frequencies_separated_by_commas_become_a_list_but_not_in_a_sweep(argv, expected):
    assert with_frequency_list(argv) == expected


def test_one_or_several_frequencies():
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
        (
            ["shortest=61"],
            "shortest = 61: whole cycles of 0.15 Hz for that long last 66.6667 s; allowed is up to longest = 60 s",
        ),
        (["films=[ramp,ramp]"], "films: ramp appears 2 times"),
        (["env.ramp.duration=90"], "env.ramp.duration = 90: allowed is up to longest = 60 s"),
        (["ckpt=nowhere"], "nowhere: no such file or folder"),
        (["ckpt=pretrained/none"], "pretrained/none: no such policy"),
        ([f"ckpt={PRETRAINED}"], "allowed is one"),
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


@pytest.mark.skipif(sys.platform == "win32", reason="POSIX only")
@pytest.mark.parametrize(
    ("ffmpeg", "expected"),
    [
        ("missing/ffmpeg", "missing/ffmpeg with the encoder libx264: No such file or directory"),
        ("data.txt", "data.txt with the encoder libx264: Permission denied"),
        ("old.sh", "old.sh with the encoder libx264: ffmpeg failed: Unknown encoder 'libx264'"),
        (None, "No ffmpeg exe could be found"),
    ],
)
def test_unusable_ffmpeg_is_refused_before_drawing(monkeypatch, capsys, tmp_path, ffmpeg, expected):
    (tmp_path / "data.txt").write_text("no program")
    (tmp_path / "old.sh").write_text("#!/bin/sh\necho \"Unknown encoder 'libx264'\" >&2; exit 1\n")
    (tmp_path / "old.sh").chmod(0o755)
    if ffmpeg is None:
        monkeypatch.setattr("imageio_ffmpeg._utils._get_ffmpeg_exe", lambda: None)
    else:
        monkeypatch.setenv("IMAGEIO_FFMPEG_EXE", str(tmp_path / ffmpeg))
    monkeypatch.setattr("posture.film.trials.two_modes", lambda *_: pytest.fail("drawn"))
    line = refused(monkeypatch, capsys, "film", "films=[two_modes]", "out=film")
    assert expected in line and "install ffmpeg" in line and not (tmp_path / "film").exists()


def test_command_writes_both_files_without_a_display(tmp_path):
    """One cycle at 0.5 Hz lasts 2 s, 12 frames at 6 frames per second."""
    environ = {key: value for key, value in os.environ.items() if key not in ("DISPLAY", "WAYLAND_DISPLAY", "MPLBACKEND")}
    tiny = ["films=[two_modes]", "width=60", "fps=6", "settle=4", "shortest=1.9"]
    arguments = ["ckpt=pretrained", "env.freq=0.5,1.5", "out=here", *tiny]
    done = subprocess.run(
        [sys.executable, "-m", "posture.film", *arguments],
        cwd=tmp_path,
        env=environ | {"GIT_PYTHON_REFRESH": "quiet"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert {path.name for path in (tmp_path / "here").iterdir()} == {"two_modes.mp4", "two_modes.gif"}
    frames, duration, codec = decode_mp4(tmp_path / "here" / "two_modes.mp4")
    # Two panels of 60 px; the height is 60 * 4.5 / 3.6 = 75 px, rounded to an even number.
    assert frames.shape[0] == 12 and frames.shape[2] == 120 and frames.shape[1] in (74, 76) and codec == "h264"
    assert duration == pytest.approx(2.0, abs=0.02)
    images, lengths, loops = decode_gif(tmp_path / "here" / "two_modes.gif")
    assert images.shape == frames.shape and sum(lengths) == pytest.approx(2.0) and loops == 0
    for film_frames in (frames, images):
        moved = np.abs(np.diff(film_frames.astype(int), axis=0)).max(axis=(1, 2, 3))
        assert (moved > 30).all() and (film_frames.std(axis=(1, 2, 3)) > 20).all()
        halves = film_frames[:, :, :60], film_frames[:, :, 60:]
        assert all((np.abs(np.diff(half.astype(int), axis=0)).max(axis=(1, 2, 3)) > 15).mean() > 0.9 for half in halves)


@pytest.fixture(scope="module")
def filmed():
    """Both films of the shipped policy, and their trials."""
    config = configured("env.freq=[0.5,1.5]", "settle=4", "shortest=1.9", "fps=12", "width=120", "env.ramp.duration=8")
    model = run_dir.find_checkpoint("pretrained")
    run, trajectories, rollout = run_dir.read_config(model.parent), [], trials.rollout
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(trials, "rollout", lambda *args: trajectories.append(rollout(*args)) or trajectories[-1])
        films = [make(config, model, run) for make in (trials.two_modes, trials.ramp)]
    return films, trajectories


def positions(view):
    """Target, head dot, and centre of the drawn head [m]."""
    box = view.body.layers[2].get_path().get_extents()
    return view.ball.center, view.head.center, ((box.x0 + box.x1) / 2, (box.y0 + box.y1) / 2)


def test_two_modes_film_shows_the_trial(filmed):
    (film, _), (trial, _) = filmed
    assert len(film) == 24 and film.fps == pytest.approx(12)  # one cycle at 0.5 Hz, 2 s
    # Both start with a cycle: at 4 s one begins at either frequency.
    for i in range(0, 24, 5):
        film.show(i)
        for world, (_, view, *_) in enumerate(film.panels):
            ball, dot, head = positions(view)
            now, freq = 4 + i / 12, (0.5, 1.5)[world]
            assert ball == pytest.approx((0.1 * (1 - math.cos(2 * math.pi * freq * now)), HEIGHT), abs=5e-4)
            head_x = np.interp(now, trial.time, trial.head_x[:, world])
            assert dot[0] == pytest.approx(head_x, abs=1e-9)
            # The body is drawn with flat feet, but in the simulated soft contact they tilt a little.
            assert head == pytest.approx((head_x, dot[1]), abs=0.006)


def test_ramp_film_shows_the_trial(filmed):
    (_, film), (_, trial) = filmed
    assert len(film) == 96
    for i in (50, 70, 95):
        film.show(i)
        now = i / 12
        ball, dot, head = positions(film.view)
        # The phase is the integral of 2 pi 0.036 Hz/s t.
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


def test_pixel_at_the_target_has_its_colour(filmed):
    (film, _), _ = filmed
    for i in (3, 12):
        frame = film[i]
        ball = film.panels[0][1].ball
        x, y = ball.axes.transData.transform(ball.center)
        assert frame[len(frame) - 1 - int(y), int(x)] / 255 == pytest.approx(to_rgb(TARGET_COLOUR), abs=0.1)
    with pytest.raises(IndexError):
        film[24]


def test_frames_are_independent_of_each_other(filmed):
    (film, _), _ = filmed
    first = film[5]
    film[17]
    np.testing.assert_array_equal(film[5], first)


def swaying_trial(lag, freq=1.0, seconds=10.0, dt=0.02, fall_step=-1):
    """Hip and ankle move sinusoidally, the ankle `lag` [rad] behind the hip."""
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


def film_of(trial, freq=1.0):
    r = running_correlation(trial, 0, 50, 0.0, centred=False)
    motion = sample(trial, 0, freq, r, 4.0, np.arange(0, 2, 0.1))
    cycle = sample(trial, 0, freq, r, 4.0, np.linspace(0, 1 / freq, 41))
    return TwoModesFilm([motion], [cycle], 60, 0.2)


@pytest.mark.parametrize(
    ("lag", "title", "colour"),
    [
        (0.0, "in-phase   r = +1.00", BLUE),
        (math.pi, "anti-phase   r = \u22121.00", RED),
        (1.0, "in-phase   r = +0.54", BLUE),
    ],
)
def test_title_shows_the_mode_by_the_running_correlation(lag, title, colour):
    """The correlation of two sinusoids is the cosine of their phase difference: cos 1 = 0.54."""
    film = film_of(swaying_trial(lag))
    film.show(7)
    text = film.panels[0][2]
    assert (text.get_text(), text.get_color()) == (title, colour)


def test_window_is_a_whole_cycle_of_a_slow_target():
    """Over a cycle the correlation of sinusoids an eighth of a cycle apart is cos(pi / 4), over part of one it varies."""
    trial = swaying_trial(math.pi / 4, freq=0.25)
    r = running_correlation(trial, 0, 50, 0.0, centred=False)
    assert np.isnan(r[:199]).all()
    assert r[199:] == pytest.approx(math.sqrt(0.5), abs=1e-6)


def test_fall_is_shown_and_the_last_pose_kept():
    """The fall is at step 250 of the trial, 5 s, which is 1 s after the start of the film."""
    film = film_of(swaying_trial(0.0, fall_step=249))
    motion, _, title, *_ = film.panels[0]
    assert motion.fall == pytest.approx(1.0)
    film.show(5)
    assert title.get_text().startswith("in-phase")
    film.show(15)
    assert (title.get_text(), title.get_color()) == ("fell", FALL_COLOUR)
    assert motion.hip[15] == pytest.approx(math.radians(10) * math.sin(2 * math.pi * 4.98))
    with pytest.raises(RunError, match="fell at the first step"):
        film_of(swaying_trial(0.0, fall_step=0))


def test_transition_is_marked_where_the_correlation_changes_sign():
    """The correlation (0.6 - f) / 0.6 changes sign at 0.6 Hz."""
    time = np.linspace(0, 10, 101)
    still, freq = np.zeros(101), time / 10
    motion = SampledTrial(time, freq, still, still, still, still, still, (0.6 - freq) / 0.6, math.inf)
    film = RampFilm(motion, np.full(101, np.nan), motion, 5.0, 60, 0.2, 0.69)
    line, text = film._switch
    film.show(59)
    assert not text.get_visible() and film._mode.get_text() == "in-phase   r = +0.02"
    film.show(61)
    assert text.get_visible() and text.get_text() == "0.60 Hz" and line.get_xdata()[0] == pytest.approx(0.6)
    assert film._mode.get_color() == RED
