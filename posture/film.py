"""Films of a trained policy as MP4 and GIF, without a display or a GPU.

python -m posture.film                                     # the shipped policy at a slow and a fast target, and in a ramp
python -m posture.film ckpt=runs/<run> env.freq=0.15,1.5   # side by side
python -m posture.film ckpt=latest env.freq=0.4 env.load=4 env.ramp=null
"""

import math
import re
import sys
import time
from pathlib import Path

import numpy as np
import torch

from posture import cli, run_dir
from posture.config import ConfigError, EnvChanges
from posture.film_config import FilmConfig


def film(config: FilmConfig, _: Path) -> None:
    """Roll out the policy and write the films: `side_by_side` of steady motion, `phases` of a cycle, and `ramp`.

    Prints each file with its size."""
    models = run_dir.find_checkpoints(config.ckpt)
    if len(models) > 1:
        raise ConfigError(f"ckpt: {config.ckpt} holds {len(models)} policies; a film shows one, for example {models[0]}")
    (model,) = models
    run, content = run_dir.read_config(model.parent), run_dir.load(model, config.device)
    home = Path(run_dir.folder_for(str(run_dir.RUNS), None)) / "film" if config.out is None else Path(config.out)
    out = run_dir.writable(home)
    # Only now, so that bad input is answered before physics takes seconds to import.
    from envs.head_tracking import HeadTrackingEnv
    from posture.evaluation import trial_config
    from posture.film_phases import Phases
    from posture.film_scene import Rise, Scene, SideBySide
    from posture.film_take import take
    from posture.film_writer import write
    from posture.policy import load_policy
    from posture.progress import preparing
    from posture.ramp import ramp_frequency
    from posture.rollout import rollout
    from posture.trajectory import Trajectory

    window = int(config.paper["experiment_4a"]["window_steps"])
    target_height = float(config.paper["table_1"]["target_height_m"])
    still = math.radians(config.evaluation.still_joint_deg)

    def rolled_out(changes: EnvChanges, freq: tuple[float, ...], duration: float) -> tuple[Trajectory, float]:
        evaluation = config.evaluation.model_copy(update={"freq": freq, "duration": duration, "transient": 0.0})
        trial = trial_config(run.env, evaluation, changes, config.device)
        with preparing():
            env = HeadTrackingEnv(trial, run.seed, config.device)
            policy = load_policy(content, run, model, env.sim.device)
            env.warm_up()
        fixed = None if trial.ramp else torch.tensor(freq, dtype=torch.float64)
        return rollout(env, policy, fixed, duration), trial.amplitude

    def written(scene: Scene, name: str, began: float) -> None:
        mp4, gif = out / f"{name}.mp4", out / f"{name}.gif"
        try:
            write(scene.frames(), scene.count, config.fps, mp4, gif)
        except OSError as error:
            print(f"error: {name}: {error}", file=sys.stderr)
            sys.exit(1)
        for path in (mp4, gif):
            print(f"{path}  {path.stat().st_size / 1e6:.2f} MB")
        print(f"{scene.count} frames in {time.perf_counter() - began:.1f} s", flush=True)

    began = time.perf_counter()
    dt, slowest = run.env.control_dt, min(config.env.freq)
    period = 1 / slowest
    start = math.ceil(max(config.evaluation.transient / period, 1.0)) * period
    length = math.ceil(config.shortest / period - 1e-9) * period
    # Whole cycles, at least as long as the paper's window: over a part of one the correlation would swing.
    steps = [round(math.ceil(window * dt * freq) / (freq * dt)) for freq in config.env.freq]
    trajectory, amplitude = rolled_out(config.env.changes, config.env.freq, start + length + dt * max(steps))
    count = max(2, round(length * config.fps))
    # The frame after the last is the first again, so that the film repeats without a seam.
    instants = start + length * np.arange(count) / count
    takes = [
        take(trajectory, world, np.full(count, freq), instants, steps[world], still)
        for world, freq in enumerate(config.env.freq)
    ]
    written(SideBySide(takes, target_height, amplitude, config.height), "side_by_side", began)

    began = time.perf_counter()
    moving = max(4, round(config.phases.cycle * config.fps))
    phase = np.arange(moving + 1) / moving
    takes = []
    for world, freq in enumerate(config.env.freq):
        cycle = (math.ceil(start * freq - 1e-9) + phase) / freq  # the first that begins after the transient
        takes.append(take(trajectory, world, np.full(len(cycle), freq), cycle, steps[world], still))
    hold = round(config.phases.hold * config.fps)
    written(Phases(takes, target_height, amplitude, config.height, moving, hold), "phases", began)

    ramp = config.env.ramp
    if ramp is not None:
        began = time.perf_counter()
        changes = config.env.changes.model_copy(update={"ramp": ramp})
        trajectory, amplitude = rolled_out(changes, (slowest,), ramp.duration + dt * window)
        instants = np.arange(max(2, round(ramp.duration * config.fps))) / config.fps
        rising = ramp_frequency(instants, ramp.start, ramp.rate, ramp.duration)
        shown = take(trajectory, 0, rising, instants, window, still)
        written(Rise(shown, target_height, amplitude, config.height, window * dt), "ramp", began)


def side_by_side(argument: str) -> str:
    """A command-line argument `env.freq=a,b` as the list that it means here; Hydra would take it for a sweep."""
    return re.sub(r"^(env\.freq=)([^\[\]()]*,[^\[\]()]*)$", r"\1[\2]", argument)


def main() -> None:
    """`python -m posture.film`."""
    sys.argv[1:] = [side_by_side(argument) for argument in sys.argv[1:]]
    cli.run("film", FilmConfig, film)


if __name__ == "__main__":
    main()
