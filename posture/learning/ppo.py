"""rsl-rl's PPO, leaner on a CPU and the same on every process of a shared training."""

from collections.abc import Generator
from typing import Any

import torch
from rsl_rl.algorithms import PPO
from rsl_rl.models import MLPModel
from rsl_rl.storage import RolloutStorage

from posture.learning import parallel


class ShuffledStorage(RolloutStorage):
    """The same mini-batches as rsl-rl's, which draws one order of the samples an iteration and uses it in every epoch.

    Gathering samples is the dearest part of PPO with a small network on a CPU; here it is done once an iteration, and
    mini-batches are slices.
    """

    def mini_batch_generator(self, num_mini_batches: int, num_epochs: int = 8) -> Generator[Any, None, None]:
        """Yield shuffled flat mini-batches, in the same order in each epoch."""
        size = self.num_envs * self.num_transitions_per_env // num_mini_batches
        order = torch.randperm(num_mini_batches * size, device=self.device)

        def shuffled(stored: Any) -> Any:
            return stored.flatten(0, 1)[order]

        observations, actions = shuffled(self.observations), shuffled(self.actions)
        values, returns, advantages = shuffled(self.values), shuffled(self.returns), shuffled(self.advantages)
        log_prob = shuffled(self.actions_log_prob)
        distribution = tuple(shuffled(parameter) for parameter in self.distribution_params)
        for _ in range(num_epochs):
            for first in range(0, num_mini_batches * size, size):
                part = slice(first, first + size)
                yield RolloutStorage.Batch(
                    observations=observations[part],
                    actions=actions[part],
                    values=values[part],
                    advantages=advantages[part],
                    returns=returns[part],
                    old_actions_log_prob=log_prob[part],
                    old_distribution_params=tuple(parameter[part] for parameter in distribution),
                )


class LeanPPO(PPO):
    """PPO with `ShuffledStorage`, whose processes, where there are several, also share what observations are scaled by."""

    def __init__(self, actor: MLPModel, critic: MLPModel, storage: RolloutStorage, **options: Any) -> None:
        shuffled = ShuffledStorage(
            storage.training_type,
            storage.num_envs,
            storage.num_transitions_per_env,
            storage.observations[0],
            storage.actions_shape,
            storage.device,
        )
        super().__init__(actor, critic, shuffled, **options)

    def update(self) -> dict[str, float]:
        """One iteration's learning; see `rsl_rl.algorithms.PPO.update`.

        Raises FloatingPointError, on every process alike, where a number that comes in or goes out is not finite: before
        learning where an observation or a reward is, and before anything can be saved where a loss or the policy is.
        """
        stored = self.storage
        given = {f"observation {name}": stored.observations[name] for name in sorted(stored.observations.keys())}
        self._check_finite(given | {"reward": stored.rewards, "value estimate": stored.values})
        losses: dict[str, float] = super().update()
        told = {f"{name} loss": torch.tensor(losses[name]) for name in sorted(losses)}
        for name, model in (("actor", self._raw_actor), ("critic", self._raw_critic)):
            told[f"weights of the {name}"] = torch.cat([weight.detach().flatten() for weight in model.parameters()])
        self._check_finite(told)
        if self.is_multi_gpu:
            for model in (self._raw_actor, self._raw_critic):
                if model.obs_normalization:
                    _pool(model.obs_normalizer)
        return losses

    def _check_finite(self, terms: dict[str, torch.Tensor]) -> None:
        """Raise FloatingPointError that names the terms with a NaN or an infinity on any process."""
        broken = torch.stack([(~torch.isfinite(term)).any().float().to(self.device) for term in terms.values()])
        if self.is_multi_gpu:
            torch.distributed.all_reduce(broken)
        names = [name for name, count in zip(terms, broken.tolist(), strict=True) if count]
        if names:
            raise FloatingPointError(f"training stopped, since these are not finite numbers: {', '.join(names)}")


def _pool(normalizer: Any) -> None:
    """Make running mean and variance those of all processes' samples together; rsl-rl leaves each with its own.

    Processes start equal and see equally many samples, so the pooled first and second moments are the means of theirs.
    """
    mean, spread = normalizer._mean.clone(), normalizer._var + normalizer._mean**2
    for moment in (mean, spread):
        parallel.average(moment)
    normalizer._mean.copy_(mean)
    normalizer._var.copy_((spread - mean**2).clamp(min=0.0))
    normalizer._std.copy_(normalizer._var.sqrt())
