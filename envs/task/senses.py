"""What reaches the policy of its observations: late, noisy, and with earlier moments beside the newest (`env.sensing`)."""

import math
from typing import Any

import torch
import warp as wp

from envs.config import EnvConfig
from envs.engines.launch import Launch
from envs.task import senses_kernel
from envs.task.episodes import Episodes
from envs.task.observations import TERMS
from envs.task.senses_kernel import SenseArrays


class Senses:
    """The senses of N worlds. exact: (N, S) true values of all terms of all groups, in order, to be written before `sense`.

    sensed: (N, V) what the policy observes, group by group; sizes: number of its values in each group. drift: (N, S), in the
    units of `exact`. past: (N, L, S) readings of the last L control steps, that of step s at s mod L.
    """

    def __init__(self, config: EnvConfig, episodes: Episodes) -> None:
        n, device, sensing = len(episodes.world), episodes.world.device, config.sensing
        steps = sensing.delay_steps(config.control_dt)
        white: list[float] = []
        drift: list[float] = []
        source: list[int] = []
        lag: list[int] = []
        self.sizes: dict[str, int] = {}
        for group, terms in config.observations.items():
            is_exact = group in sensing.exact
            first, late = len(white), list[int]()
            for name in terms:
                size = len(TERMS[name].components)
                noise = None if is_exact else sensing.noise.get(name)
                white += [0.0] * size if noise is None else noise.of_values("white", size)
                drift += [0.0] * size if noise is None else noise.of_values("drift", size)
                late += [0 if is_exact or TERMS[name].is_own else steps] * size
            moments = 1 if is_exact else 1 + sensing.history
            for moment in range(moments):
                source += range(first, len(white))
                lag += [one + moment * sensing.history_step for one in late]
            self.sizes[group] = moments * len(late)

        def zeros(*shape: int) -> torch.Tensor:
            return torch.zeros(n, *shape, device=device)

        self.exact, self.drift = zeros(len(white)), zeros(len(white))
        self.past, self.sensed = zeros(max(lag, default=0) + 1, len(white)), zeros(len(source))
        self._constants = [
            torch.tensor(values, device=device, dtype=kind)
            for values, kind in ((white, torch.float32), (drift, torch.float32), (source, torch.int32), (lag, torch.int32))
        ]
        keep = math.exp(-config.control_dt / sensing.drift_time)
        arrays = self._arrays(episodes, keep)
        self._mask = torch.ones(n, dtype=torch.bool, device=device)
        self._sense = Launch(senses_kernel.sense, n, [wp.from_torch(self._mask)], [arrays], device)
        self._read = Launch(senses_kernel.read, n, [], [arrays], device)

    def sense(self, mask: torch.Tensor | None) -> None:
        """After a control step, or a reset of the worlds of `mask` (N,) bool: read `exact`, and make `sensed` from it."""
        if mask is None:
            self._mask.fill_(True)
        else:
            self._mask.copy_(mask)
        self._sense()

    def restore(self) -> None:
        """`sensed` from `past`, after it was changed."""
        self._read()

    def _arrays(self, episodes: Episodes, keep: float) -> Any:
        result = SenseArrays()
        result.keep, result.renew = keep, math.sqrt(1.0 - keep**2)
        for name in ("seeds", "world", "episode", "step"):
            setattr(result, name, wp.from_torch(getattr(episodes, name)))
        for name in ("exact", "drift", "past", "sensed"):
            setattr(result, name, wp.from_torch(getattr(self, name)))
        for name, tensor in zip(("white_sd", "drift_sd", "source", "lag"), self._constants, strict=True):
            setattr(result, name, wp.from_torch(tensor))
        return result
