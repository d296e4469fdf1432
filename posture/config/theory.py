"""Configuration of the theory's tables and map; values, units and sources in conf/theory.yaml."""

from typing import Annotated

from pydantic import Field, model_validator

from envs.config import AnkleStiffness, EnvConfig, Freq, HipStiffness, Load, RewardConfig, Strict
from posture.config.checks import CommandConfig, Search, Tolerance
from posture.config.eval import EvaluationConfig, one_body

MAX_VALUES = 10_000
"""Points of a table or of the map; each is an optimisation that takes some milliseconds."""


USED = {
    "amplitude", "body", "hip_k", "ankle_k", "load", "load_at", "energy_weight", "control_dt", "joint_damping",
    "joint_armature", "torque_limit", "reward", "termination",
}  # fmt: skip
"""Keys of `env` that the theory depends on."""
USED_REWARD = {"target_weight", "target_sharpness", "torque_unit", "energy_unit", "tolerance", "tolerance_weight", "as_run"}


class StiffnessSweep(Strict):
    """Hip stiffness swept at one frequency."""

    freq: Freq
    hip_k: Annotated[tuple[HipStiffness, ...], Field(min_length=1, max_length=1000)]


class LoadSweep(Strict):
    """Load swept, from .. to, at one frequency."""

    freq: Freq
    load: tuple[Load, Load]
    step: Annotated[float, Field(gt=0, le=50)]


class ModeMapGrid(Strict):
    """Hip stiffness by frequency, from .. to."""

    hip_k: Annotated[tuple[HipStiffness, ...], Field(min_length=1, max_length=1000)]
    freq: tuple[Freq, Freq]
    step: Annotated[float, Field(gt=0, le=10)]


class Around(Strict):
    """Values of each parameter at which the transition is computed, the others as configured; tolerances as large
    as the amplitude are left out. Without any value there is no such table."""

    ankle_k: Annotated[tuple[AnkleStiffness, ...], Field(max_length=1000)]
    load: Annotated[tuple[Load, ...], Field(max_length=1000)]
    tolerance: Annotated[tuple[Tolerance, ...], Field(max_length=1000)]


class TheoryConfig(CommandConfig):
    """Configuration of `posture.theory`."""

    env: EnvConfig
    evaluation: EvaluationConfig
    tolerance: Tolerance | None
    search: Search
    experiment_3: StiffnessSweep
    experiment_4b: LoadSweep
    figure_13: ModeMapGrid
    around: Around

    @property
    def head_tolerance(self) -> float:
        """[m] the head may be from its target; where the task has no tolerance, what evaluation counts as lost."""
        return next(value for value in self._tolerances.values() if value is not None)

    @property
    def _tolerances(self) -> dict[str, float | None]:
        """The keys that may give the tolerance, in order of precedence; None where a key gives none."""
        reward = self.env.reward
        return {
            "tolerance": self.tolerance,
            "env.reward.tolerance": reward.tolerance if reward.tolerance_weight else None,
            "env.termination.head_tolerance": self.env.termination.head_tolerance,
            "evaluation.tolerance": self.evaluation.tolerance,
        }

    def without_effect(self) -> dict[str, str]:
        """See `CommandConfig`."""
        env = [f"env.{key}" for key in EnvConfig.model_fields.keys() - USED]
        reward = [f"env.reward.{key}" for key in RewardConfig.model_fields.keys() - USED_REWARD]
        evaluation = [f"evaluation.{key}" for key in ("transient", "still_joint_deg", "figures")]
        limits = ["env.termination.fall_height", "env.termination.foot_motion"]
        tolerances = list(self._tolerances)
        first = next(i for i, value in enumerate(self._tolerances.values()) if value is not None)
        return dict.fromkeys([*env, *reward, *limits, *evaluation, *tolerances[first + 1 :]], "on the theory")

    @model_validator(mode="after")
    def _consistent(self) -> "TheoryConfig":
        for name, (low, high) in (("experiment_4b.load", self.experiment_4b.load), ("figure_13.freq", self.figure_13.freq)):
            if not low <= high:
                raise ValueError(f"{name}: a range goes from low to high, got {[low, high]}")
        for name, (low, high), step, rows in (
            ("experiment_4b", self.experiment_4b.load, self.experiment_4b.step, 1),
            ("figure_13", self.figure_13.freq, self.figure_13.step, len(self.figure_13.hip_k)),
        ):
            if ((high - low) / step + 1) * rows > MAX_VALUES:
                raise ValueError(f"{name}.step: {step:g} makes more than {MAX_VALUES:,} values; take a larger one")
        one_body(self.env, "the theory is of one body")
        if self.head_tolerance >= self.env.amplitude:
            raise ValueError(
                f"tolerance: {self.head_tolerance:g} m leaves the head no motion to make; allowed is less than "
                f"env.amplitude = {self.env.amplitude:g} m"
            )
        return self
