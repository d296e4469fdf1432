"""Stable-Baselines3's PPO on Gymnasium's vector environment, with our hyperparameters where it has them."""

from collections.abc import Callable
from functools import reduce

import numpy as np
import torch
from rsl_rl.utils import resolve_nn_activation
from stable_baselines3 import PPO
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.vec_env import VecNormalize
from tensordict import TensorDict

from posture.config.train import TrainConfig
from posture.evaluation.rollout import Policy
from posture.gymnasium.stable_baselines3 import StanderVecEnv


def build(config: TrainConfig) -> PPO:
    """An untrained model."""
    agent, algorithm = config.agent, config.agent.algorithm
    keys = config.env.model_dump()
    for key in config.env.without_effect():  # which `make_vec` refuses
        *groups, name = key.split(".")
        reduce(dict.__getitem__, groups, keys).pop(name, None)
    training_steps = config.training_steps if config.env.schedules else None
    envs = VecNormalize(
        StanderVecEnv(keys.pop("num_envs"), training_steps=training_steps, **keys),
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
