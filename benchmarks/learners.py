"""Speed of learning: ours, and Stable-Baselines3's PPO, both in the same environment; SB3 by its Gymnasium interface.

    python benchmarks/learners.py [--learners ours sb3] [--worlds N] [--budget 600] [--every 30] [--device cpu]
                                  [--csv benchmarks/learners.csv] [--curves benchmarks/learners_curves.csv] [overrides ...]

Each learner trains on the default task for `--budget` seconds, in its own process, one after the other. Every `--every`
seconds the clock is stopped and the deterministic policy is evaluated in our environment, as conf/evaluation says. The cost
ratio is cost over least cost, averaged over the frequencies without a fall.

Writes one row per learner: training samples/s, the time until the cost ratio was first at most 1.25 without a fall (empty
if never), the best cost ratio without a fall (empty if it always fell), the falls in the last evaluation, the number of
processes that step worlds, and torch's threads in each. The curves have one row per evaluation.

SB3 gets our number of worlds, horizon, epochs, mini-batches, discount, clipping, networks, observation normalisation and
initial learning rate. It cannot adapt the learning rate to the KL divergence, nor bound the standard deviation.
Overrides are Hydra's, e.g. env.physics=mujoco.
"""

import argparse
import contextlib
import statistics
import tempfile
import time
from pathlib import Path
from typing import Any

import torch
from shared import compose, hardware, in_new_process, missing, write
from torch import distributed

from envs.task.head_tracking import HeadTrackingEnv
from posture.analysis.coordination import measure_trajectory
from posture.config.train import TrainConfig
from posture.evaluation.rollout import Policy, rollout
from posture.evaluation.trial import AS_TRAINED, trial_config, with_theory
from posture.learning import parallel
from posture.learning.learner import Learner

GOOD = 1.25
"""A policy counts as learned at this cost ratio: within 25 % of the least cost."""
FOREVER = 10**9
"""More iterations than any budget allows."""
NEEDS = ("gymnasium", "stable-baselines3")
Row = dict[str, Any]


def main() -> None:
    """Measure, print and write the rows."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--learners", nargs="+", choices=list(_LEARNERS), default=list(_LEARNERS))
    parser.add_argument("--worlds", type=int, help="instead of env.num_envs")
    parser.add_argument("--budget", type=float, default=600.0, help="seconds of training for each learner")
    parser.add_argument("--every", type=float, default=30.0, help="seconds of training between two evaluations")
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--csv", type=Path, default=Path(__file__).with_name("learners.csv"))
    parser.add_argument("--curves", type=Path, default=Path(__file__).with_name("learners_curves.csv"))
    parser.add_argument("overrides", nargs="*", default=[])
    arguments = parser.parse_args()
    overrides = [f"device={arguments.device}", *arguments.overrides]
    if arguments.worlds:
        overrides.append(f"env.num_envs={arguments.worlds}")
    compose(*overrides)  # to report bad input before the first learner starts
    rows, curves = [], []
    for learner in arguments.learners:
        if learner == "sb3" and (lacking := missing(*NEEDS)):
            print(f"sb3: {lacking}")
            continue
        row, curve = in_new_process(measure, learner, tuple(overrides), arguments.budget, arguments.every)
        print(row)
        rows.append(row)
        curves.extend(curve)
    write(rows, arguments.csv)
    write(curves, arguments.curves)


def measure(learner: str, overrides: tuple[str, ...], budget: float, every: float) -> tuple[Row, list[Row]]:
    """The row of a learner and its curve."""
    config = compose(*overrides)
    torch.set_num_threads(config.threads)
    torch.manual_seed(config.seed)
    judge = Judge(learner, config, budget, every)
    processes = _LEARNERS[learner](config, judge)
    safe = [row for row in judge.curve if not row["falls"]]
    good = (row["seconds"] for row in safe if row["cost_ratio_mean"] <= GOOD)
    last = judge.curve[-1]
    row = {
        "learner": learner,
        "samples_per_s": round(last["samples"] / last["seconds"]),
        "budget_s": budget,
        "time_to_125_s": next(good, None),
        "best_cost_ratio": min((row["cost_ratio_mean"] for row in safe), default=None),
        "falls": last["falls"],
        "threads": torch.get_num_threads(),
        "processes": processes,
    }
    return row | hardware(config.device), judge.curve


class Judge:
    """Evaluates a policy during training and ends the training when the budget is spent. Evaluations do not count."""

    def __init__(self, learner: str, config: TrainConfig, budget: float, every: float) -> None:
        self._learner, self._config, self._budget, self._every = learner, config, budget, every
        trial = trial_config(config.env, config.evaluation, AS_TRAINED, config.device)
        self._env = HeadTrackingEnv(trial, config.seed, config.device)
        self._env.warm_up()
        self.curve: list[Row] = []
        """One row per evaluation."""

    def start(self) -> None:
        """Start the clock."""
        self._since, self._due = time.perf_counter(), self._every

    def over(self, samples: int, policy: Policy) -> bool:
        """Whether the budget is spent; called after each update."""
        if self._config.device.startswith("cuda"):
            torch.cuda.synchronize()
        now = time.perf_counter()
        seconds = now - self._since
        if seconds < min(self._due, self._budget):
            return False
        ratio, falls = self._evaluate(policy)
        row = {"learner": self._learner, "seconds": round(seconds, 1), "samples": samples}
        self.curve.append(row | {"cost_ratio_mean": ratio, "falls": falls})
        print(self.curve[-1], flush=True)
        self._due = seconds + self._every
        self._since += time.perf_counter() - now
        return seconds >= self._budget

    def _evaluate(self, policy: Policy) -> tuple[float | None, int]:
        evaluation = self._config.evaluation
        freq = torch.tensor(evaluation.freq, dtype=torch.float64)
        rows = measure_trajectory(
            rollout(self._env, policy, freq, evaluation.duration),
            transient_s=evaluation.transient,
            tolerance_m=evaluation.tolerance,
            still_joint_deg=evaluation.still_joint_deg,
        )
        valid = [row.cost_ratio for row in with_theory(rows, self._env.config, evaluation) if row.valid]
        return (round(statistics.mean(valid), 4) if valid else None), len(rows) - len(valid)


class _TimeUpError(Exception):
    """The budget is spent."""


class _JudgedLearner(Learner):
    """Our learner, evaluated where rsl-rl saves, after each iteration. A process without a judge follows the first."""

    judge: Judge | None

    def save(self, path: str, infos: dict[str, Any] | None = None) -> None:
        over = [False]
        if self.judge is not None:
            samples = (self.current_learning_iteration + 1) * self.cfg["num_steps_per_env"] * self.env.config.num_envs
            over = [self.judge.over(samples, self.get_inference_policy(self.device))]
            self.alg.train_mode()
        if parallel.size() > 1:
            distributed.broadcast_object_list(over)
        if over[0]:
            raise _TimeUpError


def _ours(config: TrainConfig, judge: Judge) -> int:
    with parallel.worker_processes(config.processes, config.device, _share, config, None):
        _share(config, judge)
    return config.processes


def _share(config: TrainConfig, judge: Judge | None) -> None:
    """One process of our training: posture/train.py without run folder, resume and evaluation."""
    part = parallel.rank(), parallel.size()
    torch.set_num_threads(config.threads)
    torch.manual_seed(config.seed + part[0])
    env = HeadTrackingEnv(config.env, config.seed, config.device, part, config.training_steps)
    env.warm_up()
    with tempfile.TemporaryDirectory() as folder:
        learner = _JudgedLearner(env, config.agent, Path(folder), config.device)
        learner.judge = judge
        if judge is not None:
            judge.start()
        with contextlib.suppress(_TimeUpError):
            learner.train(FOREVER)
        learner.logger.stop_logging_writer()


def _sb3(config: TrainConfig, judge: Judge) -> int:
    from sb3 import build, learn  # imported here because it is optional

    model = build(config)
    judge.start()
    learn(model, judge.over, config)
    return 1


_LEARNERS = {"ours": _ours, "sb3": _sb3}


if __name__ == "__main__":
    main()
