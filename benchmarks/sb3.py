"""Stable-Baselines3's PPO on a `Pool` of Gymnasium environments, with our hyperparameters where it has them."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import torch
from gym_stander import Pool, StanderEnv
from rsl_rl.utils import resolve_nn_activation
from stable_baselines3 import PPO
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.vec_env import VecEnv, VecNormalize
from tensordict import TensorDict

from posture.config.train import TrainConfig
from posture.evaluation.rollout import Policy


class PoolVecEnv(VecEnv):
    """A `Pool` with the interface of SB3."""

    def __init__(self, config: TrainConfig, processes: int) -> None:
        one = StanderEnv(config.env)
        super().__init__(config.env.num_envs, one.observation_space, one.action_space)
        self._pool = Pool(config.env, self.num_envs, processes, config.seed, config.training_steps)

    def reset(self) -> np.ndarray:
        return self._pool.observation  # called once, when every world has just been reset

    def step_async(self, actions: np.ndarray) -> None:
        self._actions = actions

    def step_wait(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, list[dict[str, Any]]]:
        seen, gains, ended, timed_out, last = self._pool.step(self._actions)
        infos: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        for world, observation in last.items():
            infos[world] = {"terminal_observation": observation, "TimeLimit.truncated": bool(timed_out[world])}
        return seen, gains, ended | timed_out, infos

    def close(self) -> None:
        self._pool.close()

    # Abstract methods for single worlds. PPO only reads the render mode.

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        return [None for _ in self._get_indices(indices)]

    def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None:
        raise NotImplementedError

    def env_method(self, method_name: str, *arguments: Any, indices: Any = None, **keys: Any) -> Sequence[Any]:
        raise NotImplementedError

    def env_is_wrapped(self, wrapper_class: type, indices: Any = None) -> list[bool]:
        return [False for _ in self._get_indices(indices)]


def build(config: TrainConfig, processes: int) -> PPO:
    """An untrained model that steps its worlds in `processes` processes."""
    agent, algorithm = config.agent, config.agent.algorithm
    envs = VecNormalize(
        PoolVecEnv(config, processes),
        norm_obs=agent.actor.obs_normalization,
        norm_reward=False,
        clip_obs=np.inf,
        epsilon=1e-4,  # added to the variance; rsl-rl adds 0.01 to the standard deviation
    )
    return PPO(
        "MlpPolicy",
        envs,
        learning_rate=algorithm.learning_rate,
        n_steps=agent.num_steps_per_env,
        batch_size=agent.num_steps_per_env * envs.num_envs // algorithm.num_mini_batches,
        n_epochs=algorithm.num_learning_epochs,
        gamma=algorithm.gamma,
        gae_lambda=algorithm.lam,
        clip_range=algorithm.clip_param,
        clip_range_vf=algorithm.clip_param if algorithm.use_clipped_value_loss else None,
        ent_coef=algorithm.entropy_coef,
        vf_coef=algorithm.value_loss_coef,
        max_grad_norm=algorithm.max_grad_norm,
        policy_kwargs={
            "net_arch": {"pi": list(agent.actor.hidden_dims), "vf": list(agent.critic.hidden_dims)},
            "activation_fn": type(resolve_nn_activation(agent.actor.activation)),
            "log_std_init": float(np.log(agent.actor.distribution_cfg.init_std)),
        },
        seed=config.seed,
        device=config.device,
    )


def learn(model: PPO, over: Callable[[int, Policy], bool], config: TrainConfig) -> None:
    """Train until `over(samples, policy)`, called after each update, is true."""
    groups = list(config.env.observations)
    envs = model.get_vec_normalize_env()
    assert envs is not None

    def policy(observation: TensorDict) -> torch.Tensor:
        seen = torch.cat([observation[group] for group in groups], -1).cpu().numpy()
        actions, _ = model.predict(envs.normalize_obs(seen), deterministic=True)
        return torch.from_numpy(actions).to(config.device)

    class UntilOver(BaseCallback):
        spent = False

        def _on_rollout_start(self) -> None:
            self.spent = over(self.num_timesteps, policy)

        def _on_step(self) -> bool:
            return not self.spent

    model.learn(10**12, callback=UntilOver())
    model.get_env().close()
