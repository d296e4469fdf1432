"""rsl-rl's PPO, faster on a CPU, with checks for numbers that are not finite."""

from collections.abc import Generator
from typing import Any

import torch
from rsl_rl.algorithms import PPO
from rsl_rl.models import MLPModel
from rsl_rl.storage import RolloutStorage


class ShuffledStorage(RolloutStorage):
    """rsl-rl's roll-out storage, with the same mini-batches as slices of samples that are shuffled once per iteration.

    rsl-rl draws one order of the samples per iteration and uses it in every epoch, but gathers the samples again each time.
    With a small network on a CPU that gathering is the slowest part of PPO.
    """

    def mini_batch_generator(self, num_mini_batches: int, num_epochs: int = 8) -> Generator[Any, None, None]:
        """Yield shuffled flat mini-batches, in the same order in each epoch."""
        size = self.num_envs * self.num_transitions_per_env // num_mini_batches
        order = torch.randperm(num_mini_batches * size, device=self.device)

        def shuffled(stored: Any) -> Any:
            return stored.flatten(0, 1)[order]

        samples = {
            "observations": shuffled(self.observations),
            "actions": shuffled(self.actions),
            "values": shuffled(self.values),
            "returns": shuffled(self.returns),
            "advantages": shuffled(self.advantages),
            "old_actions_log_prob": shuffled(self.actions_log_prob),
        }
        distribution = [shuffled(parameter) for parameter in self.distribution_params]
        for _ in range(num_epochs):
            for first in range(0, num_mini_batches * size, size):
                part = slice(first, first + size)
                yield RolloutStorage.Batch(
                    **{name: values[part] for name, values in samples.items()},
                    old_distribution_params=tuple(parameter[part] for parameter in distribution),
                )


class LeanPPO(PPO):
    """PPO with `ShuffledStorage` and checks for numbers that are not finite."""

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
        """Learn from one iteration's samples; see `rsl_rl.algorithms.PPO.update`.

        Raises FloatingPointError, in every process, if a number is not finite: before learning if it is among the
        observations, rewards or value estimates, and before anything is saved if it is a loss or a weight.
        """
        stored, networks = self.storage, {"actor": self._raw_actor, "critic": self._raw_critic}
        inputs = {f"observation {name}": stored.observations[name] for name in sorted(stored.observations.keys())}
        self._check_finite(inputs | {"reward": stored.rewards, "value estimate": stored.values})
        losses: dict[str, float] = super().update()
        results = {f"{name} loss": torch.tensor(losses[name]) for name in sorted(losses)}
        for name, model in networks.items():
            results[f"weights of the {name}"] = torch.cat([weight.detach().flatten() for weight in model.parameters()])
        self._check_finite(results)
        return losses

    def _check_finite(self, values: dict[str, torch.Tensor]) -> None:
        """Raise FloatingPointError that names the values with a NaN or an infinity in any process."""
        broken = torch.stack([(~torch.isfinite(value)).any().float().to(self.device) for value in values.values()])
        if self.is_multi_gpu:
            torch.distributed.all_reduce(broken)
        names = [name for name, count in zip(values, broken.tolist(), strict=True) if count]
        if names:
            raise FloatingPointError(f"training stopped, since these are not finite numbers: {', '.join(names)}")
