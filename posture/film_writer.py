"""Frames to MP4 and GIF. Each file is there whole, or not at all."""

from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import imageio_ffmpeg
import numpy as np
from numpy.typing import NDArray
from PIL import Image

from posture.atomic import replacing

Frame = NDArray[np.uint8]  # (height, width, 3) red, green, blue

COLOURS = 96  # of a GIF's palette, which all its frames share: what does not move then costs nothing
PALETTE_FRAMES = 8  # spread over the film, whose colours make the palette
QUALITY = "23"  # H.264's constant rate factor: lower is larger


def write(frames: Iterator[Frame], count: int, fps: int, mp4: Path, gif: Path) -> None:
    """Write `count` frames, all of one even size, at `fps` [1/s] as H.264 to `mp4`, and as a GIF that repeats for ever.

    Raises OSError where a file cannot be written.
    """
    chosen = set(np.linspace(0, count - 1, min(PALETTE_FRAMES, count)).astype(int).tolist())
    pictures: list[Image.Image] = []
    samples: list[Frame] = []
    first = next(frames)
    with replacing(mp4) as unfinished_mp4, replacing(gif) as unfinished_gif:
        encoder = imageio_ffmpeg.write_frames(
            unfinished_mp4,
            (first.shape[1], first.shape[0]),
            fps=fps,
            codec="libx264",
            quality=None,
            macro_block_size=2,
            ffmpeg_log_level="error",
            # The container is named, since the temporary name ends in .tmp; its index first, so that players can start.
            output_params=["-crf", QUALITY, "-preset", "medium", "-f", "mp4", "-movflags", "+faststart"],
        )
        with closing(encoder):
            encoder.send(None)
            for number, frame in enumerate(_chain(first, frames)):
                encoder.send(np.ascontiguousarray(frame))
                pictures.append(Image.fromarray(frame))
                if number in chosen:
                    samples.append(frame)
        palette = Image.fromarray(np.concatenate(samples)).quantize(
            COLOURS,
            method=Image.Quantize.MAXCOVERAGE,
            dither=Image.Dither.NONE,  # so that small coloured dots keep theirs
        )
        # Without dithering, whose noise would change from frame to frame.
        reduced = [picture.quantize(palette=palette, dither=Image.Dither.NONE) for picture in pictures]
        duration = 1000 // fps  # [ms] a frame
        reduced[0].save(
            unfinished_gif, "GIF", save_all=True, append_images=reduced[1:], duration=duration, loop=0, optimize=False
        )


def _chain(first: Frame, rest: Iterator[Frame]) -> Iterator[Frame]:
    yield first
    yield from rest
