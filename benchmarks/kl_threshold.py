"""How far a policy changes in an iteration, by the KL threshold of the authors' learner and by those of rsl-rl.

python benchmarks/kl_threshold.py [--iterations 100] [--worlds 512] [--threshold 0.002 0.004]

4 minutes for each row; docs/learning.md has its result.

Both learners adapt their learning rate to the KL divergence between two policies, in each mini-batch. rl_games, which the
authors use, compares the policy with itself when it last saw this mini-batch, one epoch earlier; rsl-rl compares it with the
policy that took the samples. What is printed of both is rsl-rl's measure in the last epoch: the change in a whole iteration.
"""

import argparse
import tempfile
from collections.abc import Generator
from pathlib import Path
from typing import Any

import torch
from shared import compose

from envs.task.head_tracking import HeadTrackingEnv
from posture.learning.learner import Learner

SETTLED = 10
"""Iterations before the first one that counts."""


def measure(learner: Learner, one_epoch: bool) -> list[float]:
    """Let `learner` compare with the policy of one epoch earlier if `one_epoch`.

    Returns a list to which each batch of a last epoch adds the KL divergence from the policy that took the samples [nat].
    """
    changes: list[float] = []
    mini_batches = learner.alg.storage.mini_batch_generator

    def measured(count: int, epochs: int) -> Generator[Any, None, None]:
        earlier: dict[int, tuple[torch.Tensor, ...]] = {}
        for number, batch in enumerate(mini_batches(count, epochs)):
            first = batch.old_distribution_params
            if one_epoch:
                batch.old_distribution_params = earlier.get(number % count, first)
            yield batch
            now = tuple(values.detach().clone() for values in learner.alg.actor.output_distribution_params)
            earlier[number % count] = now
            if number >= (epochs - 1) * count:
                changes.append(float(learner.alg.actor.get_kl_divergence(first, now).mean()))

    learner.alg.storage.mini_batch_generator = measured
    return changes


def row(threshold: float, one_epoch: bool, iterations: int, worlds: int) -> str:
    """One training: its mean change in an iteration, a KL divergence [nat], after the first `SETTLED` ones."""
    config = compose("experiment=as_published", f"env.num_envs={worlds}", f"agent.algorithm.desired_kl={threshold}")
    torch.set_num_threads(config.threads)
    torch.manual_seed(config.seed)
    with tempfile.TemporaryDirectory() as folder:
        env = HeadTrackingEnv(config.env, config.seed, "cpu")
        learner = Learner(env, config.agent, Path(folder), "cpu")
        changes = measure(learner, one_epoch)
        learner.train(iterations)
    counted = changes[SETTLED * config.agent.algorithm.num_mini_batches :]
    return f"{'rl_games' if one_epoch else 'rsl-rl'} {threshold}: {sum(counted) / len(counted):.4f} an iteration"


def main() -> None:
    """Print a row for the authors' measure and threshold, and one for each threshold of rsl-rl."""
    published, own = (
        compose(chosen).agent.algorithm.desired_kl for chosen in ("agent=ppo_paper", "experiment=as_published")
    )
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--iterations", type=int, default=100)
    parser.add_argument("--worlds", type=int, default=512)
    parser.add_argument("--threshold", type=float, nargs="+", default=[published, own])
    asked = parser.parse_args()
    cases = [(published, True), *((threshold, False) for threshold in asked.threshold)]
    print("\n".join([row(*case, asked.iterations, asked.worlds) for case in cases]))


if __name__ == "__main__":
    main()
