"""Configuration of the export; values and units in conf/export.yaml."""

from typing import Annotated, Literal

from pydantic import Field, model_validator

from envs.config import Ramp
from posture.config.checks import CommandConfig, PathText, check_engine
from posture.config.eval import EnvChanges, EvaluationConfig


class ExportConfig(CommandConfig):
    """Configuration of `posture.export`."""

    what: Annotated[tuple[Literal["trajectories", "policy"], ...], Field(min_length=1, max_length=2)]
    ckpt: PathText
    device: str
    in_degrees: bool
    env: EnvChanges
    evaluation: EvaluationConfig

    def without_effect(self) -> dict[str, str]:
        """See `CommandConfig`."""
        if "trajectories" not in self.what:
            return dict.fromkeys(("in_degrees", "device", "env", "evaluation"), "without trajectories in what")
        unused = EvaluationConfig.model_fields.keys() - {"freq", "duration"}
        ramp = {"evaluation.freq": "beside env.ramp"} if isinstance(self.env.ramp, Ramp) else {}
        return {f"evaluation.{key}": "on an export" for key in unused} | ramp

    @model_validator(mode="after")
    def _consistent(self) -> "ExportConfig":
        check_engine(self.env.physics, self.device)
        twice = sorted({freq for freq in self.evaluation.freq if self.evaluation.freq.count(freq) > 1})
        if twice:
            raise ValueError(f"evaluation.freq: {twice[0]:g} Hz is listed twice; allowed is each frequency once")
        return self
