"""The trials: roll-outs of one policy in which the target's frequency changes, or the trunk is pushed."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import torch

from envs.task.head_tracking import HeadTrackingEnv
from posture.analysis.trajectory import Array, Trajectory
from posture.config.dynamics import DynamicsConfig, PerturbationConfig
from posture.config.train import TrainConfig
from posture.evaluation.rollout import Policy, rollout
from posture.evaluation.trial import AS_TRAINED, open_trial, trial_config


def opened(
    model: Path, run: TrainConfig, freq: Sequence[float], duration: float, config: DynamicsConfig
) -> tuple[HeadTrackingEnv, Policy]:
    """Worlds with targets of `freq`[i] [Hz], for trials of `duration` [s], and the policy of checkpoint `model`."""
    # Not read again: there may be more worlds than an evaluation has frequencies.
    evaluation = config.evaluation.model_copy(update={"freq": tuple(freq), "duration": duration, "transient": 0.0})
    trial = trial_config(run.env, evaluation, AS_TRAINED.model_copy(update={"ramp": "none"}), config.device)
    return open_trial(model, run, trial, config.device)


def following(model: Path, run: TrainConfig, freq: Array, config: DynamicsConfig) -> Trajectory:
    """`config.repeats` trials whose target has the frequency `freq`[t] [Hz] in control step t; that of the record is nan."""
    dt, worlds = run.env.control_dt, config.repeats
    env, policy = opened(model, run, worlds * [float(freq[0])], len(freq) * dt, config)
    device = env.sim.device

    def retarget(step: int) -> None:
        if step and freq[step] != freq[step - 1]:
            now = torch.full((worlds,), float(freq[step]), dtype=torch.float64, device=device)
            env.episodes.retarget(now, env.episodes.amplitude)

    start = torch.full((worlds,), float(freq[0]), dtype=torch.float64, device=device)
    trajectory = rollout(env, policy, start, len(freq) * dt, retarget)
    return replace(trajectory, freq=np.full(worlds, np.nan))


def constant(model: Path, run: TrainConfig, config: DynamicsConfig) -> Trajectory:
    """`config.repeats` trials at each frequency of `config.fluctuation`, those of one frequency together."""
    freq = [one for one in config.fluctuation.freq.values for _ in range(config.repeats)]
    env, policy = opened(model, run, freq, config.evaluation.duration, config)
    return rollout(env, policy, torch.tensor(freq, dtype=torch.float64), config.evaluation.duration)


def pushed_and_twin(model: Path, run: TrainConfig, config: DynamicsConfig) -> tuple[Trajectory, Trajectory]:
    """`config.repeats` trials at each frequency of `config.perturbation` with pushes, and the same without.

    Both have the same noise, which depends on the world, the episode and the control step alone.
    """
    push = config.perturbation
    freq = [one for one in push.freq.values for _ in range(config.repeats)]
    env, policy = opened(model, run, freq, push.duration, config)
    starts = push_starts(push, run.env.control_dt)
    ends = starts + round(push.time / run.env.control_dt)

    def trial(before_step: Callable[[int], None] | None) -> Trajectory:
        env.episodes.reseed(run.seed)
        return rollout(env, policy, torch.tensor(freq, dtype=torch.float64), push.duration, before_step)

    def push_trunk(step: int) -> None:
        if step in starts:
            env.sim.push.fill_(push.force)
        elif step in ends:
            env.sim.push.zero_()

    return trial(push_trunk), trial(None)


def push_starts(push: PerturbationConfig, dt: float) -> Array:
    """The control steps of `dt` [s] in which the pushes begin, (P,) int."""
    return np.round((push.first + push.every * np.arange(push.pushes)) / dt).astype(int)
