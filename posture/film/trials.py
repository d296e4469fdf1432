"""The trials that are filmed: a policy rolled out, and the films of it."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import torch

from envs.config import EnvConfig, Ramp
from posture.analysis.ramp import ramp_frequency
from posture.analysis.trajectory import Trajectory
from posture.config.eval import EnvChanges
from posture.config.film import FilmConfig
from posture.config.published import read_published
from posture.config.train import TrainConfig
from posture.evaluation.rollout import rollout
from posture.evaluation.trial import open_trial, trial_config
from posture.film.pictures import Film, RampFilm, TwoModesFilm
from posture.film.sampling import running_correlation, sample

CYCLE_POINTS = 101  # number of points of the angles over a cycle


def two_modes(config: FilmConfig, model: Path, run: TrainConfig) -> Film:
    """The frequencies side by side, each from the start of a cycle on, for whole cycles of the slowest."""
    slowest, length = min(config.env.freq), config.two_modes_duration
    count = max(round(length * config.fps), 2)
    # The correlation at the first frame needs a whole cycle before it.
    starts = [math.ceil(max(config.settle, 1 / slowest) * freq) / freq for freq in config.env.freq]
    trial, env = _roll_out(config, model, run, None, max(starts) + length)
    steps, still = _window(run)
    motions, cycles = [], []
    for world, (freq, start) in enumerate(zip(config.env.freq, starts, strict=True)):
        r = running_correlation(trial, world, steps, still, centred=False)
        motions.append(sample(trial, world, freq, r, start, length * np.arange(count) / count))
        cycles.append(sample(trial, world, freq, r, start, np.linspace(0.0, 1 / freq, CYCLE_POINTS)))
    return TwoModesFilm(motions, cycles, config.width, 2 * env.amplitude, env.body)


def ramp(config: FilmConfig, model: Path, run: TrainConfig) -> Film:
    """The whole ramp of Exp. 4a. The trial is half a window longer, for the centred correlation at the end."""
    schedule = config.env.ramp
    steps, still = _window(run)
    window = steps * run.env.control_dt
    trial, env = _roll_out(config, model, run, schedule, schedule.duration + window / 2)
    time = np.linspace(0.0, schedule.duration, max(round(schedule.duration * config.fps), 2), endpoint=False)
    centred, trailing = (running_correlation(trial, 0, steps, still, centred=centred) for centred in (True, False))
    freq = ramp_frequency(time, schedule.start, schedule.rate, schedule.duration)
    motion = sample(trial, 0, freq, centred, 0.0, time)
    trace = sample(trial, 0, math.nan, centred, 0.0, trial.time)
    trailing = np.interp(time, trial.time, trailing)
    paper_hz = read_published().experiment_4a.transition_hz
    return RampFilm(motion, trailing, trace, window, config.width, 2 * env.amplitude, paper_hz, env.body)


def _roll_out(
    config: FilmConfig, model: Path, run: TrainConfig, schedule: Ramp | None, duration: float
) -> tuple[Trajectory, EnvConfig]:
    """The deterministic policy for `duration` [s]: along a ramp, or at each of the frequencies, one world each. And the
    environment of that trial."""
    freq = config.env.freq if schedule is None else (schedule.start,)
    evaluation = run.evaluation.model_copy(update={"freq": freq, "duration": duration, "transient": 0.0})
    changes = EnvChanges(**config.env.model_dump(exclude={"freq", "ramp"}), ramp=schedule or "none")
    trial = trial_config(run.env, evaluation, changes, config.device)
    env, policy = open_trial(model, run, trial, config.device)
    return rollout(env, policy, torch.tensor(freq, dtype=torch.float64) if schedule is None else None, duration), trial


def _window(run: TrainConfig) -> tuple[int, float]:
    """Window of the running correlation [control steps], and the motion [rad] below which a joint counts as still."""
    return read_published().experiment_4a.window_steps, math.radians(run.evaluation.still_joint_deg)
