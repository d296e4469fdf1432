"""The trials that are filmed: a policy rolled out, and the films made of it."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import torch

from envs.config import Ramp as RampConfig
from envs.task.head_tracking import HeadTrackingEnv
from posture.analysis.ramp import ramp_frequency
from posture.analysis.trajectory import Trajectory
from posture.config.eval import EnvChanges
from posture.config.film import FilmConfig
from posture.config.published import read_published
from posture.config.train import TrainConfig
from posture.evaluation.rollout import rollout
from posture.evaluation.trial import trial_config
from posture.film.motion import at_frames, running_correlation
from posture.film.scene import Film, Ramp, TwoModes
from posture.learning.networks import load_policy
from posture.learning.progress import preparing
from posture.storage import checkpoint

CYCLE_POINTS = 101  # at which the angles over a cycle are drawn


def two_modes(config: FilmConfig, model: Path, run: TrainConfig) -> Film:
    """The frequencies side by side, from a start of a cycle of each on: whole cycles of the slowest."""
    slowest = min(config.env.freq)
    length = math.ceil(config.shortest * slowest - 1e-9) / slowest
    count = max(round(length * config.fps), 2)
    # The correlation over a cycle needs one before the first frame.
    starts = [math.ceil(max(config.settle, 1 / slowest) * freq) / freq for freq in config.env.freq]
    trial = _rolled_out(config, model, run, None, max(starts) + length)
    steps, still = _window(config, run)
    motions, cycles = [], []
    for world, (freq, start) in enumerate(zip(config.env.freq, starts, strict=True)):
        r = running_correlation(trial, world, steps, still, centred=False)
        motions.append(at_frames(trial, world, freq, r, start, length * np.arange(count) / count))
        cycles.append(at_frames(trial, world, freq, r, start, np.linspace(0.0, 1 / freq, CYCLE_POINTS)))
    return TwoModes(motions, cycles, config.width, *_target(config, run))


def ramp(config: FilmConfig, model: Path, run: TrainConfig) -> Film:
    """Exp. 4a, the whole ramp. The trial goes on for half a window, which the centred correlation at its end needs."""
    told = config.env.ramp
    steps, still = _window(config, run)
    window = steps * run.env.control_dt
    trial = _rolled_out(config, model, run, told, told.duration + window / 2)
    time = np.linspace(0.0, told.duration, max(round(told.duration * config.fps), 2), endpoint=False)
    centred, trailing = (running_correlation(trial, 0, steps, still, centred=yes) for yes in (True, False))
    freq = ramp_frequency(time, told.start, told.rate, told.duration)
    motion = at_frames(trial, 0, freq, centred, 0.0, time)
    trace = at_frames(trial, 0, math.nan, centred, 0.0, trial.time)
    late = np.interp(time, trial.time, trailing)
    paper_hz = read_published().experiment_4a.transition_hz
    return Ramp(motion, late, trace, window, config.width, *_target(config, run), paper_hz)


def _rolled_out(config: FilmConfig, model: Path, run: TrainConfig, told: RampConfig | None, duration: float) -> Trajectory:
    """The deterministic policy for `duration` [s]: along a ramp, or at each of the frequencies, a world each."""
    content = checkpoint.load(model, config.device)
    freq = config.env.freq if told is None else (told.start,)
    trial = run.evaluation.model_copy(update={"freq": freq, "duration": duration, "transient": 0.0})
    changes = EnvChanges(**config.env.model_dump(exclude={"freq", "ramp"}), ramp=told)
    with preparing():
        env = HeadTrackingEnv(trial_config(run.env, trial, changes, config.device), run.seed, config.device)
        policy = load_policy(content, run, model, env.sim.device)
        env.warm_up()
    return rollout(env, policy, torch.tensor(freq, dtype=torch.float64) if told is None else None, duration)


def _window(config: FilmConfig, run: TrainConfig) -> tuple[int, float]:
    """Of the running correlation: its steps, and the motion [rad] below which a joint is still."""
    return read_published().experiment_4a.window_steps, math.radians(run.evaluation.still_joint_deg)


def _target(config: FilmConfig, run: TrainConfig) -> tuple[float, float]:
    """Height of the target, and how far it goes [m]."""
    return read_published().table_1.target_height_m, 2 * (config.env.amplitude or run.env.amplitude)
