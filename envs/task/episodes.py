"""The episodes of N worlds: how far each is, what its target does, and where head and feet are."""

import math
from typing import Any

import torch
import warp as wp

from envs.body.joints import BODIES, FEET, JOINTS
from envs.config import EnvConfig
from envs.engines.interface import SUBJECT, Simulation
from envs.engines.launch import Launch
from envs.task import episodes_kernel
from envs.task.bodies import COLUMNS, Table
from envs.task.episodes_kernel import EpisodeArrays
from envs.task.observations import PAST, PAST_STEPS

FOOT_BODIES = [BODIES.index(foot) for foot in FEET]


class Episodes:
    """Episodes of N worlds. All attributes are tensors of N worlds that every call below changes in place.

    A world's frequency and length are drawn from (seed, number of the world, number of the episode) alone. `stratified`:
    world i of N draws from the i-th of N equal parts of the range. The distribution over episodes stays uniform, and so does
    that over samples: otherwise frequencies at which episodes end early are rare in the samples, though they need the most.

    episode, step, length: (N,) int64, number of the episode, control steps made in it and after which it is over.
    freq: (N,) float64, frequency of the target at the start of the episode [Hz].
    phase_offset: (N,) float64, added to the target's phase until the end of the episode [rad].
    amplitude: (N,) float64 of the target [m]. tolerance: (N,) of the head around it, `env.reward.tolerance` [m].
    effort_scale: (N,) see `envs.task.bodies.effort_scale`.
    action: (N, 4) torque of the last step over its limit. command, activation: (N, 4) of the same step, see
    `envs.task.actuation`; where actuation is ideal, command is action itself.
    track: (N, PAST * PAST_STEPS + 1) target positions of the present and the last control steps, the newest first [m].
    target_x, target_vx, target_ax, target_freq, head_x, head_vx, foot_displacement: see `TaskState`.
    """

    def __init__(
        self, config: EnvConfig, sim: Simulation, world: torch.Tensor, seed: int, bodies: Table | None = None
    ) -> None:
        """For the worlds with the numbers `world` (N,) int64 out of `config.num_envs`.

        bodies: rows of `envs.task.bodies.COLUMNS` and `effort_scale`, of which each episode draws one. What is of the body
        is written to `sim`.
        """
        n, device = len(world), sim.device

        def zeros(*shape: int, dtype: torch.dtype = torch.float32) -> torch.Tensor:
            return torch.zeros(n, *shape, dtype=dtype, device=device)

        self._config = config
        self.world = world
        self.seeds = torch.zeros(2, dtype=torch.long, device=device)
        self.freq_low, self.freq_range, self.ramp_rate, self.ramp_duration = (zeros(dtype=torch.float64) for _ in range(4))
        self.amplitude = torch.full_like(self.freq_low, config.amplitude)
        self.tolerance = torch.full((n,), config.reward.tolerance, device=device)
        self.effort_scale = torch.ones_like(self.tolerance)
        self.bodies = torch.zeros(1, len(COLUMNS) + 1, dtype=torch.float64, device=device)
        self.first_row, self.num_rows = torch.zeros_like(world), torch.zeros_like(world)
        if bodies is not None:
            self.bodies = torch.as_tensor(bodies, device=device)
            parts = config.num_envs if config.freq_draw == "stratified" else 1
            self.num_rows.fill_(len(bodies) // parts)
            self.first_row.copy_(world % parts * self.num_rows)
        self.foot_start = sim.body_pose[:, FOOT_BODIES, :3].clone()
        self.episode = torch.zeros_like(world)
        self.step, self.length = zeros(dtype=torch.long), zeros(dtype=torch.long)
        self.freq, self.phase_offset = zeros(dtype=torch.float64), zeros(dtype=torch.float64)
        self.action, self.activation = zeros(len(JOINTS)), zeros(len(JOINTS))
        self.command = self.action if config.actuation.is_ideal else zeros(len(JOINTS))
        self.track = zeros(PAST * PAST_STEPS + 1)
        self.target_x, self.target_vx, self.target_ax, self.target_freq = (zeros() for _ in range(4))
        self.head_x, self.head_vx, self.foot_displacement = zeros(), zeros(), zeros(len(FEET))
        self._set_range()

        arrays = self._kernel_argument(sim)
        self._mask = zeros(dtype=torch.bool)
        self._begin = Launch(episodes_kernel.begin, n, [wp.from_torch(self._mask)], [arrays], device)
        self._advance = Launch(episodes_kernel.advance, n, [], [arrays], device)
        self._restore = Launch(episodes_kernel.restore, n, [], [arrays], device)
        self.reseed(seed)
        self.begin(torch.ones_like(self._mask))

    def advance(self) -> None:
        """After a control step of the physics: one more step of each episode."""
        self._advance()

    def begin(self, mask: torch.Tensor) -> None:
        """A new episode in the worlds of `mask` (N,) bool, after the simulation has put them upright."""
        self._mask.copy_(mask)
        self._begin()

    def restore(self) -> None:
        """Compute what follows from episode, step, freq, phase_offset and the simulation, after they were changed."""
        self._restore()

    def follow(self, freq: torch.Tensor) -> None:
        """From its next episode on, world i follows a target of the constant `freq`[i] [Hz], (N,). A ramp ends at once, and
        the body stays as it is."""
        self.freq_low.copy_(freq)
        self.freq_range.zero_()
        self.ramp_rate.zero_()
        self.num_rows.zero_()

    def reseed(self, seed: int) -> None:
        """Continue, from the next episode on, with the episodes of new worlds with this `seed`."""
        # The lengths have other random numbers than the frequencies.
        self.seeds.copy_(torch.tensor([seed, ~seed]))
        self.episode.fill_(-1)

    def retarget(self, freq: torch.Tensor, amplitude: torch.Tensor) -> None:
        """From now on, world i follows a target of the constant `freq`[i] [Hz] and `amplitude`[i] [m], (N,); its phase does
        not jump. Raises ValueError where a ramp is configured."""
        if self._config.ramp is not None:
            raise ValueError("the target of a ramp cannot be changed while it moves")
        time = self.step.double() * self._config.control_dt
        self.phase_offset += 2.0 * math.pi * (self.freq - freq) * time
        self.freq.copy_(freq)
        self.amplitude.copy_(amplitude)
        self.follow(freq)

    @property
    def phase(self) -> torch.Tensor:
        """Phase of the target without a ramp [rad], (N,) float64."""
        return 2.0 * math.pi * self.freq * self.step.double() * self._config.control_dt + self.phase_offset

    def _set_range(self) -> None:
        """The range of frequencies that each world draws from, and the ramp."""
        config = self._config
        low, high = config.freq if isinstance(config.freq, tuple) else (config.freq, config.freq)
        if config.ramp is not None:
            low = high = config.ramp.start
            self.ramp_rate.fill_(config.ramp.rate)
            self.ramp_duration.fill_(config.ramp.duration)
        parts = config.num_envs if config.freq_draw == "stratified" else 1
        width = (high - low) / parts
        self.freq_low.copy_(low + width * (self.world % parts).double())
        self.freq_range.fill_(width)

    def _kernel_argument(self, sim: Simulation) -> Any:
        result = EpisodeArrays()
        result.control_dt = self._config.control_dt
        result.head, result.hat_com = (wp.vec3(*map(float, point)) for point in (sim.geometry.head, sim.geometry.hat_com))
        shortest, longest = self._config.episode_bounds
        result.length_low, result.length_range = float(shortest), float(longest - shortest + 1)
        tensors = vars(self) | {name: getattr(sim, name) for name in ("body_pose", "body_velocity", *SUBJECT)}
        for name, field in EpisodeArrays.vars.items():  # type: ignore[attr-defined]
            if name in tensors:
                setattr(result, name, wp.from_torch(tensors[name], dtype=field.type.dtype))
        return result
