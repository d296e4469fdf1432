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
    """The senses of N worlds, for all groups of observations that are not exact.

    exact: (N, S) true values of all terms of these groups, in order, to be written before `sense`. sensed: (N, V) what the
    policy observes of them, group by group; sizes: number of its values in each group. drift: (N, S), in the
    units of `exact`. now: (1,) number of readings so far; past: (N, L S) the last L of them, number n from (n mod L) S on.
    """

    def __init__(self, config: EnvConfig, episodes: Episodes) -> None:
        n, device, sensing = len(episodes.world), episodes.world.device, config.sensing
        steps = sensing.delay_steps(config.control_dt)
        white: list[float] = []
        drift: list[float] = []
        source: list[int] = []  # of each observed value, the reading
        lag: list[int] = []  # and how many control steps it is late
        self.sizes: dict[str, int] = {}
        for group, terms in config.observations.items():
            if group in sensing.exact:
                continue
            first, late = len(white), list[int]()
            for name in terms:
                size = len(TERMS[name].components)
                noise = sensing.noise.get(name)
                white += [0.0] * size if noise is None else noise.of_values("white", size)
                drift += [0.0] * size if noise is None else noise.of_values("drift", size)
                late += [0 if TERMS[name].is_own else steps] * size
            for moment in range(1 + sensing.history):
                source += range(first, len(white))
                lag += [one + moment * sensing.history_step for one in late]
            self.sizes[group] = (1 + sensing.history) * len(late)

        def zeros(*shape: int) -> torch.Tensor:
            return torch.zeros(n, *shape, device=device)

        self.exact, self.drift = zeros(len(white)), zeros(len(white))
        self.past, self.sensed = zeros((max(lag, default=0) + 1) * len(white)), zeros(len(source))
        self.now = torch.zeros(1, dtype=torch.long, device=device)
        offset = [reading - late * len(white) for reading, late in zip(source, lag, strict=True)]
        self._offset = torch.tensor(offset, device=device)
        self._deviations = [torch.tensor(values, dtype=torch.float32, device=device) for values in (white, drift)]
        keep = math.exp(-config.control_dt / sensing.drift_time)
        arrays = self._arrays(episodes, keep)
        self._mask = torch.ones(n, dtype=torch.bool, device=device)
        self._sense = Launch(senses_kernel.sense, n, [wp.from_torch(self._mask)], [arrays], device)

    def sense(self, mask: torch.Tensor | None) -> None:
        """After a control step, or a reset of the worlds of `mask` (N,) bool: read `exact`, and make `sensed` from it."""
        if mask is None:
            self._mask.fill_(True)
            self.now += 1
        else:
            self._mask.copy_(mask)
        self._sense()
        self.restore()

    def restore(self) -> None:
        """`sensed` from `past`, after it was changed."""
        places = (self.now * self.exact.shape[1] + self._offset) % self.past.shape[1]
        torch.index_select(self.past, 1, places, out=self.sensed)

    def _arrays(self, episodes: Episodes, keep: float) -> Any:
        result = SenseArrays()
        result.keep, result.renew = keep, math.sqrt(1.0 - keep**2)
        for name in ("seeds", "world", "episode", "step"):
            setattr(result, name, wp.from_torch(getattr(episodes, name)))
        for name in ("now", "exact", "drift", "past"):
            setattr(result, name, wp.from_torch(getattr(self, name)))
        for name, tensor in zip(("white_sd", "drift_sd"), self._deviations, strict=True):
            setattr(result, name, wp.from_torch(tensor))
        return result
