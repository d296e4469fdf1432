"""Configuration of the reproduction (conf/reproduce.yaml) and of its report (conf/report.yaml)."""

import re
from typing import Annotated, Literal

from pydantic import AfterValidator, Field, model_validator

from envs.config import Amplitude, Freq, HipStiffness, Strict, check_once
from posture.config.checks import CommandConfig, Search, Share
from posture.config.published import read_published

NOT_OVERRIDDEN = ("experiment", "hydra", "out", "resume", "seed")
"""Keys of a training that the reproduction sets, or that have no place in it."""


def _override(text: str) -> str:
    key = re.match(r"\+{0,2}(\w+)([./@]\w[\w./@]*)?=", text)
    if key is None or key[1] in NOT_OVERRIDDEN:
        raise ValueError(
            f"{text!r}: allowed are keys of a training with their values, as in 'env.hip_k=60', "
            f"but not {', '.join(NOT_OVERRIDDEN)}"
        )
    return text


Experiment = Literal["frequency", "energy", "hip_stiffness", "map", "human", "as_published", "as_run"]
Stage = Literal["train", "evaluate", "report", "ship", "archive"]
Rho = Annotated[float, Field(gt=0, le=1)]
Step = Annotated[float, Field(ge=0.001, le=100)]


class ClaimRules(Strict):
    """Thresholds of the verdicts on the paper's claims; reasons in conf/report.yaml."""

    modes_share: Share
    measured_share: Share
    min_conditions: Annotated[int, Field(ge=2, le=100)]
    seeds_share: Share
    rho_reproduced: Rho
    rho_partly: Rho
    min_tracking_difference: Annotated[float, Field(gt=0, le=1)]
    high_freq_hz: Freq
    ankle_change_share: Share
    ankle_range_share: Share
    ramp_reproduced_hz: Freq
    ramp_partly_hz: Freq
    soft_hip_k: HipStiffness
    stiff_hip_k: HipStiffness
    amplitude_share: Share

    @model_validator(mode="after")
    def _consistent(self) -> "ClaimRules":
        for low, high in (
            ("rho_partly", "rho_reproduced"),
            ("ramp_reproduced_hz", "ramp_partly_hz"),
            ("soft_hip_k", "stiff_hip_k"),
        ):
            if getattr(self, low) > getattr(self, high):
                raise ValueError(f"{low} must not be above {high}, got {getattr(self, low):g} and {getattr(self, high):g}")
        paper = read_published()
        freqs, hip_k = sorted(paper.table_3.freq_hz)[:-1], paper.figure_13.hip_k_nm_per_rad
        if self.high_freq_hz not in freqs:
            raise ValueError(f"high_freq_hz = {self.high_freq_hz:g}: allowed are {', '.join(f'{freq:g}' for freq in freqs)}")
        if self.soft_hip_k <= min(hip_k):
            raise ValueError(f"soft_hip_k = {self.soft_hip_k:g}: allowed is more than Fig. 13's lowest, {min(hip_k):g}")
        if self.stiff_hip_k >= max(hip_k):
            raise ValueError(f"stiff_hip_k = {self.stiff_hip_k:g}: allowed is less than Fig. 13's highest, {max(hip_k):g}")
        return self


class Grid(Strict):
    """Conditions of sweeps for which the paper gives only the ends."""

    map_step_hz: Step
    load_step_kg: Step
    amplitudes_m: Annotated[tuple[Amplitude, ...], Field(min_length=2, max_length=100)]

    @model_validator(mode="after")
    def _consistent(self) -> "Grid":
        if list(self.amplitudes_m) != sorted(set(self.amplitudes_m)):
            raise ValueError(f"amplitudes_m must rise, got {list(self.amplitudes_m)}")
        return self


class TargetRules(Strict):
    """Margins of the targets."""

    switch_hz: Freq
    tracking: Annotated[float, Field(ge=0, le=1)]
    head_motion_share: Annotated[float, Field(ge=0, le=1)]
    cost_ratio: Annotated[float, Field(ge=1, le=1000)]
    modes_share: Share


class ShownFrequencies(Strict):
    """Conditions that figures show."""

    freq_hz: Annotated[tuple[Freq, ...], Field(min_length=1, max_length=10)]


class ReportConfig(Strict):
    """How the report judges and what it shows."""

    claims: ClaimRules
    grid: Grid
    targets: TargetRules
    figures: ShownFrequencies
    shipped_seed: Annotated[int, Field(ge=0, lt=2**31)]


class ReproduceConfig(CommandConfig):
    """Configuration of `posture.reproduce`."""

    experiments: Annotated[tuple[Experiment, ...], Field(min_length=1)]
    seeds: Annotated[int, Field(ge=1, le=1000)]
    stages: Annotated[tuple[Stage, ...], Field(min_length=1)]
    launcher: Literal["joblib", "basic", "submitit_local", "submitit_slurm"]
    parallel: Annotated[int, Field(ge=1, le=1024)]
    search: Search
    overrides: tuple[Annotated[str, AfterValidator(_override)], ...]
    report: ReportConfig

    def without_effect(self) -> dict[str, str]:
        """See `CommandConfig`."""
        keys = {  # by the stages of which one must run
            ("train", "evaluate"): ["experiments", "seeds"],
            ("train",): ["launcher", "parallel"],
            ("report", "ship"): ["search"],
            ("report",): [f"report.{key}" for key in ReportConfig.model_fields.keys() - {"shipped_seed"}],
            ("ship",): ["report.shipped_seed"],
        }
        unused = {
            key: f"without {' or '.join(stages)} in stages"
            for stages, own in keys.items()
            if not set(stages) & set(self.stages)
            for key in own
        }
        return unused if self.launcher == "joblib" else {"parallel": f"with launcher={self.launcher}"} | unused

    @model_validator(mode="after")
    def _consistent(self) -> "ReproduceConfig":
        check_once(self.experiments, "experiments")
        return self
