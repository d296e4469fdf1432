"""Films of a policy as MP4 and GIF, without a display or a GPU: the body from the side, its target and its mode.

python -m posture.film                                   # the shipped policy: slow and fast side by side, and the ramp
python -m posture.film ckpt=runs/<run> env.freq=0.15,1.5 # one film of both frequencies, no sweep
python -m posture.film 'films=[ramp]' 'formats=[mp4]'
"""

import re
import sys
import time
from collections.abc import Sequence
from pathlib import Path

from posture.cli import entry
from posture.config.film import FilmConfig
from posture.storage import run_dir


def film(config: FilmConfig, folder: Path) -> None:
    """Roll out the policy that `ckpt` names, and write each film in each format to `folder`."""
    model = run_dir.find_checkpoint(config.ckpt)
    run = run_dir.read_config(model.parent)
    from posture.film.video import write_gif, write_mp4  # here, because it is slow to import

    run_dir.writable(folder, *(f"{name}.{kind}" for name in config.films for kind in config.formats))
    from posture.film.trials import ramp, two_modes

    for name in config.films:
        frames = {"two_modes": two_modes, "ramp": ramp}[name](config, model, run)
        for kind in config.formats:
            start, path = time.perf_counter(), folder / f"{name}.{kind}"
            {"mp4": write_mp4, "gif": write_gif}[kind](frames, path, frames.fps)
            length, size = len(frames) / frames.fps, path.stat().st_size / 1e6
            seconds = time.perf_counter() - start
            print(f"{path}: {length:.2f} s, {len(frames)} frames, {size:.2f} MB; drawn in {seconds:.1f} s", flush=True)


def check(configs: Sequence[FilmConfig], in_sweep: bool) -> None:
    """Raise ConfigError if there is no policy for one of the jobs, or no ffmpeg that can write its films."""
    for ckpt in {config.ckpt: None for config in configs}:
        run_dir.find_checkpoint(ckpt)
    if any("mp4" in config.formats for config in configs):
        from posture.film.video import check_ffmpeg

        check_ffmpeg()


def with_frequency_list(argv: Sequence[str]) -> list[str]:
    """`argv` with `env.freq=0.15,1.5` written as a list. Hydra would read it as a sweep, which it stays with -m."""
    if {"-m", "--multirun"} & set(argv):
        return list(argv)
    return [re.sub(r"^(\+{0,2}env\.freq=)([^\[(]*,.*)$", r"\1[\2]", argument) for argument in argv]


def main() -> None:
    """The command `python -m posture.film`."""
    sys.argv[1:] = with_frequency_list(sys.argv[1:])
    entry.run("film", FilmConfig, film, check)


if __name__ == "__main__":
    main()
