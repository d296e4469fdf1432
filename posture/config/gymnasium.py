"""Configuration of Gymnasium's environment; values, units and sources in conf/gymnasium.yaml and conf/env/."""

from envs.config import EnvConfig, Steps, Strict


class GymnasiumConfig(Strict):
    """The environment, and the control steps of each world in the training; None: weights have their final values."""

    env: EnvConfig
    training_steps: Steps | None
