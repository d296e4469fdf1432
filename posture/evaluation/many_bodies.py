"""A policy in trials of many bodies and targets, in batches, with the least cost of each."""

import os
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from multiprocessing import get_context
from pathlib import Path

import torch

from envs.body.segments import Segments, read_segments
from envs.config import EnvConfig
from envs.engines.interface import SUBJECT
from envs.task.bodies import COLUMNS, Table
from envs.task.head_tracking import HeadTrackingEnv
from posture.analysis.coordination import measure_trajectory
from posture.analysis.results import LeastCost, Result
from posture.config.eval import EvaluationConfig
from posture.config.train import TrainConfig
from posture.evaluation.rollout import rollout
from posture.evaluation.trial import AS_TRAINED, open_trial, origin, trial_config
from posture.theory.prediction import predict

BATCH = 256
"""Trials at the same time; the record of 100 s of one takes a megabyte."""


def evaluate_many(model: Path, run: TrainConfig, rows: Table, evaluation: EvaluationConfig, device: str) -> list[Result]:
    """The results of checkpoint `model`, one for each of the `rows`, whose columns are `envs.task.bodies.COLUMNS`.

    Without the theory: see `least_costs_of`. The frequencies of `evaluation` are not used.
    """
    results: list[Result] = []
    for first in range(0, len(rows), BATCH):
        part = rows[first : first + BATCH]
        wanted = evaluation.model_copy(update={"freq": tuple(part[:, 0].tolist())})
        changes = AS_TRAINED.model_copy(update={"ramp": "none", "physics": "sagittal"})
        env, policy = open_trial(model, run, trial_config(run.env, wanted, changes, device), device)
        take(env, part)
        trajectory = rollout(env, policy, torch.tensor(part[:, 0]), evaluation.duration)
        results += measure_trajectory(
            trajectory,
            transient_s=evaluation.transient,
            tolerance_m=part[:, COLUMNS.index("tolerance")],
            still_joint_deg=evaluation.still_joint_deg,
        )
    own = origin(run, AS_TRAINED, model.parent.name)
    amplitudes = rows[:, COLUMNS.index("amplitude")].tolist()
    return [
        replace(result, origin=replace(own, amplitude_m=amplitude))
        for result, amplitude in zip(results, amplitudes, strict=True)
    ]


def take(env: HeadTrackingEnv, rows: Table) -> None:
    """Give the worlds of `env` the bodies of `rows`, and from their next episode on its targets but for the frequency."""
    columns = {name: torch.tensor(rows[:, i], device=env.sim.device) for i, name in enumerate(COLUMNS)}
    env.sim.set_subject(**{name: columns[name].float() for name in SUBJECT})
    env.episodes.amplitude.copy_(columns["amplitude"])
    env.episodes.tolerance.copy_(columns["tolerance"])


def least_costs_of(rows: Table, env: EnvConfig, duration: float) -> list[LeastCost]:
    """The motion of least cost of each row; nan where no motion keeps the limits."""
    with ProcessPoolExecutor(os.cpu_count(), get_context("spawn")) as pool:
        return list(pool.map(_Least(read_segments(env), env, duration), rows.tolist(), chunksize=32))


def with_least_cost(results: Sequence[Result], least: Sequence[LeastCost]) -> list[Result]:
    """`results` with the motion of least cost of each, and the cost over it."""
    return [replace(row, least=best, cost_ratio=row.cost / best.cost) for row, best in zip(results, least, strict=True)]


class _Least:
    """The motion of least cost of a row, for another process."""

    def __init__(self, body: Segments, env: EnvConfig, duration: float) -> None:
        self._body, self._env, self._duration = body, env, duration

    def __call__(self, row: Sequence[float]) -> LeastCost:
        values = dict(zip(COLUMNS, row, strict=True))
        own = {name: values[name] for name in (*SUBJECT, "amplitude")}
        env = self._env.model_copy(update=own)
        return predict(self._body, env, values["freq"], values["tolerance"], self._duration).least
