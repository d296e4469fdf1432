"""Written files, decoded again: number, size, duration and content of the frames."""

import re
import subprocess

import numpy as np
import pytest
from imageio_ffmpeg import get_ffmpeg_exe
from PIL import Image

from posture.film.video import write_gif, write_mp4

WIDTH, HEIGHT, SIDE = 64, 48, 12


def moving_square(count):
    """An orange square on white that moves 2 px to the right per frame."""
    frames = []
    for i in range(count):
        frame = np.full((HEIGHT, WIDTH, 3), 255, np.uint8)
        frame[16 : 16 + SIDE, 2 * i : 2 * i + SIDE] = (230, 159, 0)
        frames.append(frame)
    return frames


def decode_mp4(path):
    """Frames (F, H, W, 3), duration [s] and codec."""
    info = subprocess.run([get_ffmpeg_exe(), "-i", str(path)], capture_output=True, text=True, check=False).stderr
    hours, minutes, seconds = re.search(r"Duration: (\d+):(\d+):([\d.]+)", info).groups()
    codec, width, height = re.search(r"Video: (\w+).*?, (\d+)x(\d+)", info).groups()
    raw = subprocess.run(
        [get_ffmpeg_exe(), "-loglevel", "error", "-i", str(path), "-f", "rawvideo", "-pix_fmt", "rgb24", "-"],
        capture_output=True,
        check=True,
    ).stdout
    frames = np.frombuffer(raw, np.uint8).reshape(-1, int(height), int(width), 3)
    return frames, 3600 * int(hours) + 60 * int(minutes) + float(seconds), codec


def decode_gif(path):
    """Frames (F, H, W, 3), their durations [s], and the number of loops, 0 for endless."""
    with Image.open(path) as image:
        frames, lengths = [], []
        for i in range(image.n_frames):
            image.seek(i)
            frames.append(np.asarray(image.convert("RGB")))
            lengths.append(image.info["duration"] / 1000)
        return np.stack(frames), lengths, image.info["loop"]


def left_edge(frame):
    """First column of the square, which has no blue."""
    return int(np.argmax(frame[16 + SIDE // 2, :, 2] < 128))


def test_mp4(tmp_path):
    write_mp4(moving_square(20), tmp_path / "a.mp4", 8.0)
    frames, duration, codec = decode_mp4(tmp_path / "a.mp4")
    assert frames.shape == (20, HEIGHT, WIDTH, 3) and codec == "h264"
    assert duration == pytest.approx(20 / 8, abs=0.01)
    assert [left_edge(frame) for frame in frames] == pytest.approx(list(range(0, 40, 2)), abs=1)


def test_gif(tmp_path):
    written = moving_square(16)
    write_gif(written, tmp_path / "a.gif", 24.0)
    frames, lengths, loops = decode_gif(tmp_path / "a.gif")
    assert frames.shape == (16, HEIGHT, WIDTH, 3) and loops == 0
    # 16 frames of 1/24 s last 66.67 hundredths of a second; a GIF has whole ones.
    assert sum(lengths) == pytest.approx(0.67) and set(lengths) == {0.04, 0.05}
    assert np.abs(frames.astype(int) - np.stack(written)).max() <= 8


def test_equal_frames_of_a_gif_are_merged(tmp_path):
    still = moving_square(1) * 10 + moving_square(3)[1:]
    write_gif(still, tmp_path / "a.gif", 10.0)
    frames, lengths, _ = decode_gif(tmp_path / "a.gif")
    assert lengths == pytest.approx([1.0, 0.1, 0.1]) and len(frames) == 3


class FailingFrames(list):
    """Frames; drawing the eleventh raises an error."""

    def __init__(self, frames, error):
        super().__init__(frames)
        self.error = error

    def __iter__(self):
        yield from list.__iter__(self[:10])
        raise self.error


@pytest.mark.parametrize("error", [KeyboardInterrupt(), ValueError()], ids=["Ctrl-C", "error"])
@pytest.mark.parametrize(("write", "name"), [(write_mp4, "a.mp4"), (write_gif, "a.gif")])
def test_failure_leaves_the_earlier_file(tmp_path, write, name, error):
    (tmp_path / name).write_bytes(b"an earlier film")
    with pytest.raises(type(error)):
        write(FailingFrames(moving_square(20), error), tmp_path / name, 10.0)
    assert [path.name for path in tmp_path.iterdir()] == [name]
    assert (tmp_path / name).read_bytes() == b"an earlier film"


def test_no_file_if_ffmpeg_fails(tmp_path):
    odd = [frame[:, :-1] for frame in moving_square(3)]
    with pytest.raises(OSError, match="not divisible by 2"):
        write_mp4(odd, tmp_path / "a.mp4", 10.0)
    assert list(tmp_path.iterdir()) == []
