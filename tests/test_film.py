"""Films: decoded again, and what a picture shows against trigonometry by hand."""

import os
import sys

import imageio_ffmpeg
import numpy as np
import pytest
from hydra.core.global_hydra import GlobalHydra
from hydra.core.hydra_config import HydraConfig
from PIL import Image

from posture import film
from posture.film_scene import SideBySide
from posture.film_take import Take
from posture.film_writer import write
from tests.test_silhouette import by_hand

TINY = [
    "height=96",
    "fps=5",
    "shortest=1",
    "evaluation.transient=0",
    "phases.cycle=1",
    "phases.hold=0.4",
    "env.ramp.duration=2",
]
# At 0.5 Hz a cycle lasts 2 s: 10 frames. A cycle of phases: 5 frames and its end, then 2. The ramp: 2 s.
FILMS = {"side_by_side": (10, 120), "phases": (8, 120), "ramp": (10, 120)}


def main(*arguments):
    GlobalHydra.instance().clear()
    HydraConfig.instance().cfg = None
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "argv", ["posture.film", *arguments])
        film.main()


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    folder = tmp_path_factory.mktemp("film")
    with pytest.MonkeyPatch.context() as patch:
        patch.delenv("DISPLAY", raising=False)
        patch.chdir(folder)
        main("out=films", "env.freq=0.5,1.5", *TINY)
    return folder / "films"


def mp4(path):
    reader = imageio_ffmpeg.read_frames(path)
    meta = next(reader)
    width, height = meta["size"]
    return meta, np.stack([np.frombuffer(frame, np.uint8).reshape(height, width, 3) for frame in reader])


def gif(path):
    with Image.open(path) as image:
        frames, durations = [], []
        for number in range(image.n_frames):
            image.seek(number)
            durations.append(image.info["duration"])
            frames.append(np.asarray(image.convert("RGB")))
        return durations, image.info.get("loop"), np.stack(frames)


def test_nothing_else_is_left(made):
    assert sorted(os.listdir(made)) == sorted(f"{name}.{kind}" for name in FILMS for kind in ("gif", "mp4"))
    assert os.listdir(made.parent) == ["films"]


@pytest.mark.parametrize("name", FILMS)
def test_both_kinds_hold_the_film(made, name):
    count, width = FILMS[name]
    meta, video = mp4(made / f"{name}.mp4")
    durations, loop, pictures = gif(made / f"{name}.gif")
    assert meta["codec"] == "h264" and meta["fps"] == 5 and meta["duration"] == pytest.approx(count / 5, abs=0.05)
    assert video.shape == (count, 96, width, 3)
    # Pillow shows a frame that repeats the one before by holding that longer.
    assert sum(durations) == count * 200 and loop == 0 and pictures.shape[1:] == (96, width, 3)
    for frames in (video, pictures):
        assert all(frame.std() > 10 for frame in frames)  # not blank
    assert np.abs(np.diff(video[:6].astype(int), axis=0)).max(axis=(1, 2, 3)).min() > 40  # the body moves in each
    # Side by side and ramp lose little in either: what the GIF shows first is what the MP4 shows first.
    assert np.abs(video[0].astype(int) - pictures[0]).mean() < 6


def by_angles(hip, ankle, head_x):
    """A take of these angles [rad] whose head is at `head_x` [m]."""
    zero = np.zeros(len(hip))
    return Take(
        time=0.5 * np.arange(len(hip)), freq=zero + 0.5, target_x=head_x + 0.02, head_x=head_x, hip=hip, ankle=ankle,
        r=np.array([0.5, -0.5, np.nan]),
    )  # fmt: skip


def test_the_picture_shows_the_trajectory():
    hip, ankle, creep = np.array([0.0, -0.3, 0.1]), np.array([0.05, -0.1, 0.0]), np.array([0.0, 0.03, 0.05])
    heads = [by_hand(h, a)[2] for h, a in zip(hip, ankle, strict=True)]
    head_x = np.array([head[0] for head in heads]) + creep
    scene = SideBySide([by_angles(hip, ankle, head_x)], 1.7, 0.1, 96)
    (stage,) = scene.stages
    for frame in (2, 0, 1):
        scene.show(frame)
        assert np.ravel(stage.head.get_data()) == pytest.approx([head_x[frame], heads[frame][1]], abs=1e-9)
        assert stage.target.center == pytest.approx((head_x[frame] + 0.02, 1.7))
        joint, foot, _ = by_hand(hip[frame], ankle[frame])
        for dot, place in zip(stage.body[-2:], (joint, foot), strict=True):
            assert dot.center == pytest.approx(tuple(place + [creep[frame], 0]), abs=1e-9)
    assert stage.clock.get_text() == "0.5 s"
    assert stage.verdict.get_text() == "anti-phase (r = \N{MINUS SIGN}0.50)"
    scene.show(0)
    assert stage.verdict.get_text() == "in-phase (r = 0.50)"
    scene.show(2)
    assert stage.verdict.get_text() == ""


def test_a_fall_is_told():
    hip = np.array([0.0, -0.1, np.nan])
    scene = SideBySide([by_angles(hip, hip, hip)], 1.7, 0.1, 96)
    list(scene.frames())
    assert scene.stages[0].verdict.get_text() == "fallen"


def test_an_interrupted_film_leaves_nothing_or_the_old_one(tmp_path):
    def frames(stop):
        for number in range(6):
            if number == stop:
                raise KeyboardInterrupt
            yield np.full((96, 120, 3), 40 * number, np.uint8)

    paths = tmp_path / "a.mp4", tmp_path / "a.gif"
    with pytest.raises(KeyboardInterrupt):
        write(frames(3), 6, 5, *paths)
    assert list(tmp_path.iterdir()) == []
    write(frames(None), 6, 5, *paths)
    before = [path.read_bytes() for path in paths]
    with pytest.raises(KeyboardInterrupt):
        write(frames(3), 6, 5, *paths)
    assert [path.read_bytes() for path in paths] == before and len(list(tmp_path.iterdir())) == 2


@pytest.mark.parametrize(
    ("argument", "meant"),
    [
        ("env.freq=0.15,1.5", "env.freq=[0.15,1.5]"),
        ("env.freq=[0.15,1.5]", "env.freq=[0.15,1.5]"),
        ("env.freq=0.4", "env.freq=0.4"),
        ("ckpt=a,b", "ckpt=a,b"),
    ],
)
def test_frequencies_need_no_brackets(argument, meant):
    assert film.side_by_side(argument) == meant


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["env.freq=0"], "greater than 0"),
        (["env.freq=0.15,-1"], "greater than 0"),
        (["env.freq=11"], "less than or equal to 10"),
        (["env.freq=fast"], "number"),
        (["env.freq=0.1,0.2,0.3,0.4,0.5"], "at most 4"),
        (["env.freq=0.001"], "up to longest = 120 s"),
        (["ckpt=nowhere"], "no such file or folder"),
        (["ckpt=pretrained/none"], "no such policy"),
        (["out=/proc/films"], "cannot write"),
        (["fps=30"], "allowed are 1, 2, 4, 5, 10, 20, 25, 50"),
        (["height=97"], "multiple of 2"),
    ],
)
def test_bad_input_is_one_line(arguments, said, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(SystemExit) as stop:
        main(*arguments)
    told = capsys.readouterr().err.strip()
    assert stop.value.code == 2 and told.startswith("error: ") and "\n" not in told and said in told
    assert list(tmp_path.iterdir()) == []
