"""Configuration of Gymnasium's environment; values, units and sources in conf/gymnasium.yaml and conf/env/."""

from pydantic import model_validator

from envs.config import EnvConfig, Steps, Strict


class GymnasiumConfig(Strict):
    """The environment, and the control steps of each world in the training; None: weights have their final values."""

    env: EnvConfig
    training_steps: Steps | None

    @model_validator(mode="after")
    def _consistent(self) -> "GymnasiumConfig":
        if not any(self.env.observations.values()):
            raise ValueError("env.observations: all groups are empty; allowed is at least one term")
        if self.training_steps is not None and not self.env.schedules:
            raise ValueError(
                "training_steps: has no effect where no weight is a schedule; with env='head_tracking' some are"
            )
        return self
