"""What can be changed while the stander moves."""

from dataclasses import asdict, dataclass

from envs.config import EnvConfig


@dataclass(frozen=True)
class Knobs:
    """freq [Hz] of the target; hip_k, ankle_k [Nm/rad per joint]; load [kg]; amplitude [m]; tolerance [m] of the head."""

    freq: float
    hip_k: float
    ankle_k: float
    load: float
    amplitude: float
    tolerance: float

    def env(self, config: EnvConfig) -> EnvConfig:
        """`config` with this body and amplitude."""
        return config.model_copy(update={name: getattr(self, name) for name in ("hip_k", "ankle_k", "load", "amplitude")})

    @property
    def subject(self) -> tuple[float, ...]:
        """All but the frequency: what a least cost over frequency depends on."""
        values = asdict(self)
        del values["freq"]
        return tuple(values.values())
