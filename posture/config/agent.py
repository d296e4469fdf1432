"""Configuration of rsl-rl: networks, algorithm and roll-out; values in conf/agent/."""

from typing import Annotated, Literal

from pydantic import Field, model_validator

from envs.config import Steps, Strict
from posture.config.checks import Share, Small


class ObsGroups(Strict):
    """Which of the environment's observation groups each network sees."""

    actor: Annotated[tuple[str, ...], Field(min_length=1)]
    critic: Annotated[tuple[str, ...], Field(min_length=1)]


class AlgorithmConfig(Strict):
    """rsl-rl's PPO, with its own key names."""

    class_name: Literal["PPO"]
    num_learning_epochs: Annotated[int, Field(ge=1, le=1000)]
    num_mini_batches: Annotated[int, Field(ge=1, le=1_000_000)]
    clip_param: Small
    gamma: Share
    lam: Annotated[float, Field(ge=0, le=1)]
    value_loss_coef: Annotated[float, Field(ge=0, le=1000)]
    entropy_coef: Annotated[float, Field(ge=0, le=1000)]
    learning_rate: Small
    max_grad_norm: Annotated[float, Field(gt=0, le=1e6)]
    optimizer: Literal["adam", "adamw", "sgd", "rmsprop"]
    use_clipped_value_loss: bool
    schedule: Literal["adaptive", "fixed"]
    desired_kl: Small
    normalize_advantage_per_mini_batch: bool


class DistributionConfig(Strict):
    """rsl-rl's Gaussian action distribution with a standard deviation that does not depend on the state."""

    class_name: Literal["GaussianDistribution"]
    init_std: Annotated[float, Field(ge=1e-6, le=1e6)]
    std_range: tuple[Annotated[float, Field(ge=1e-6, le=1e6)], Annotated[float, Field(ge=1e-6, le=1e6)]]
    std_type: Literal["log", "scalar"]

    @model_validator(mode="after")
    def _ordered(self) -> "DistributionConfig":
        if not self.std_range[0] <= self.init_std <= self.std_range[1]:
            raise ValueError(f"init_std = {self.init_std:g} must lie within std_range {list(self.std_range)}")
        return self


class CriticConfig(Strict):
    """rsl-rl's MLPModel, or its RNNModel: an MLP after a recurrent layer."""

    class_name: Literal["MLPModel", "RNNModel"]
    hidden_dims: Annotated[tuple[Annotated[int, Field(ge=1, le=4096)], ...], Field(min_length=1, max_length=16)]
    activation: Literal["elu", "selu", "relu", "crelu", "lrelu", "tanh", "sigmoid", "softplus", "gelu", "swish", "mish"]
    obs_normalization: bool
    rnn_type: Literal["lstm", "gru"] | None = None
    rnn_hidden_dim: Annotated[int, Field(ge=1, le=4096)] | None = None
    rnn_num_layers: Annotated[int, Field(ge=1, le=16)] | None = None

    @model_validator(mode="after")
    def _recurrent(self) -> "CriticConfig":
        for name in ("rnn_type", "rnn_hidden_dim", "rnn_num_layers"):
            if (getattr(self, name) is None) == (self.class_name == "RNNModel"):
                raise ValueError(f"{name}: RNNModel needs it, MLPModel has none")
        return self


class ActorConfig(CriticConfig):
    """rsl-rl's MLPModel with an action distribution."""

    distribution_cfg: DistributionConfig


class StdFloorConfig(Strict):
    """The lower bound of the actions' standard deviation, a share of the torque limit.

    It is `std_range[0]` up to the share `begin` of the training, and then falls geometrically to `end`.
    """

    begin: Annotated[float, Field(ge=0, lt=1)]
    end: Annotated[float, Field(ge=1e-6, le=1e6)]


class AgentConfig(Strict):
    """Configuration of rsl-rl's OnPolicyRunner."""

    logger: Literal["tensorboard", "wandb", "none"]
    num_steps_per_env: Annotated[int, Field(ge=1, le=100_000)]
    save_interval: Steps
    obs_groups: ObsGroups
    algorithm: AlgorithmConfig
    actor: ActorConfig
    critic: CriticConfig
    std_floor: StdFloorConfig | None
    average_from: Annotated[float, Field(ge=0, lt=1)] | None

    @model_validator(mode="after")
    def _falls(self) -> "AgentConfig":
        highest = self.actor.distribution_cfg.std_range[0]
        if self.std_floor is not None and self.std_floor.end > highest:
            raise ValueError(
                f"std_floor.end = {self.std_floor.end:g} must not exceed std_range[0] = {highest:g} of the actor"
            )
        return self
