"""Frames to a file: H.264 in MP4 by the ffmpeg of imageio-ffmpeg, GIF by Pillow. Files are written atomically.

A frame is RGB, (height, width, 3) uint8. All frames of a film have the same size, even in both directions for MP4.
"""

from __future__ import annotations

import os
import subprocess
import tempfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from imageio_ffmpeg import get_ffmpeg_exe
from numpy.typing import NDArray
from PIL import Image

from posture.config.errors import ConfigError
from posture.storage.atomic import replacing

Frame = NDArray[np.uint8]

QUALITY = "23"  # of H.264, constant rate factor: 0 is lossless, 51 the worst
COLOURS = 64  # of a GIF, one palette for all frames
PALETTE_FRAMES = 8  # number of frames that the palette is computed from


def check_ffmpeg() -> None:
    """Raise ConfigError where `write_mp4` would fail: no ffmpeg, or one that cannot encode H.264."""
    ffmpeg = os.environ.get("IMAGEIO_FFMPEG_EXE") or "ffmpeg"
    with tempfile.TemporaryDirectory() as folder:
        try:
            write_mp4([np.zeros((16, 16, 3), np.uint8)], Path(folder) / "black.mp4", 1.0)
        except (OSError, RuntimeError) as error:
            reason = str(getattr(error, "strerror", None) or error).removeprefix(f"{folder}{os.sep}black.mp4: ")
            raise ConfigError(
                f"MP4 needs {ffmpeg} with the encoder libx264: {reason}; install ffmpeg (python -m pip install "
                "imageio-ffmpeg, apt, brew or conda), name one by IMAGEIO_FFMPEG_EXE, or write formats=[gif] only"
            ) from None


def write_mp4(frames: Sequence[Frame], path: Path, fps: float) -> None:
    """Write `frames` at `fps` frames per second, in a form that every browser plays. Raises OSError if ffmpeg fails."""
    height, width, _ = frames[0].shape
    source = ["-f", "rawvideo", "-pix_fmt", "rgb24", "-s", f"{width}x{height}", "-r", f"{fps:.9g}", "-i", "-"]
    coded = ["-c:v", "libx264", "-preset", "slow", "-crf", QUALITY, "-pix_fmt", "yuv420p"]
    with replacing(path) as temporary, tempfile.TemporaryFile() as messages:
        command = [get_ffmpeg_exe(), "-loglevel", "error", "-y", *source, *coded, "-movflags", "+faststart", "-f", "mp4"]
        # In a new session Ctrl-C does not reach the encoder; this process stops it.
        encoder = subprocess.Popen(
            [*command, str(temporary)],
            stdin=subprocess.PIPE,
            stderr=messages,
            stdout=subprocess.DEVNULL,
            start_new_session=True,
        )
        assert encoder.stdin is not None
        try:
            for frame in frames:
                encoder.stdin.write(frame.tobytes())
            encoder.stdin.close()
            failed = encoder.wait() != 0
        except BrokenPipeError:
            failed = True
        finally:
            encoder.kill()
            encoder.wait()
        if failed:
            messages.seek(0)
            raise OSError(f"{path}: ffmpeg failed: {' '.join(messages.read().decode(errors='replace').split())[:300]}")


def write_gif(frames: Sequence[Frame], path: Path, fps: float) -> None:
    """Write `frames` at `fps` frames per second, as an endless loop. Equal frames in sequence become one."""
    sample = np.concatenate([frames[i] for i in range(0, len(frames), max(len(frames) // PALETTE_FRAMES, 1))])
    palette = Image.fromarray(sample).quantize(COLOURS, method=Image.Quantize.MEDIANCUT)
    images = [Image.fromarray(frame).quantize(palette=palette, dither=Image.Dither.NONE) for frame in frames]
    # GIF durations are hundredths of a second; the end times are rounded, so that rounding errors do not add up.
    ends = np.round(100 / fps * np.arange(len(images) + 1))
    durations = [int(10 * step) for step in np.diff(ends)]
    with replacing(path) as temporary:
        images[0].save(
            temporary, format="GIF", save_all=True, append_images=images[1:], duration=durations, loop=0, optimize=True
        )
