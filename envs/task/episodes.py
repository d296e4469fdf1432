"""The episodes of N worlds: how far each is, what its target does, and where head and feet are; a Warp kernel for each
change of them."""

import math
from typing import Any

import torch
import warp as wp

from envs.body.joints import BODIES, FEET, JOINTS
from envs.config import EnvConfig
from envs.engines.interface import Simulation
from envs.engines.launch import Launch
from envs.task.observations import PAST, PAST_STEPS
from envs.task.target import Course, motion, uniform

# Else the compiler contracts products and sums, and results depend on the processor.
wp.set_module_options({"fuse_fp": False})

FOOT_BODIES = [BODIES.index(foot) for foot in FEET]
_HAT = wp.constant(BODIES.index("hat"))
_LEFT_FOOT, _RIGHT_FOOT = (wp.constant(index) for index in FOOT_BODIES)


@wp.struct
class Worlds:
    """The arrays of `Episodes`, and the constants of all worlds.

    head, hat_com: head centre and centre of mass in the frame of the HAT [m].
    freq_seed, length_seed: of the two sequences of random numbers. length_low, length_range: lengths are low, low + 1, ...,
    low + range - 1.
    """

    control_dt: wp.float64
    head: wp.vec3
    hat_com: wp.vec3
    freq_seed: wp.uint64
    length_seed: wp.uint64
    length_low: wp.float64
    length_range: wp.float64
    world: wp.array[wp.int64]
    freq_low: wp.array[wp.float64]
    freq_range: wp.array[wp.float64]
    ramp_rate: wp.array[wp.float64]
    ramp_duration: wp.array[wp.float64]
    amplitude: wp.array[wp.float64]
    body_pose: wp.array2d[wp.transform]
    body_velocity: wp.array2d[wp.spatial_vector]
    foot_start: wp.array2d[wp.vec3]
    episode: wp.array[wp.int64]
    step: wp.array[wp.int64]
    length: wp.array[wp.int64]
    freq: wp.array[wp.float64]
    phase_offset: wp.array[wp.float64]
    action: wp.array2d[float]
    track: wp.array2d[float]
    target_x: wp.array[float]
    target_vx: wp.array[float]
    target_ax: wp.array[float]
    target_freq: wp.array[float]
    head_x: wp.array[float]
    head_vx: wp.array[float]
    foot_displacement: wp.array2d[float]


@wp.func
def _read(worlds: Worlds, i: int) -> None:
    """Where target, head and feet of world `i` are."""
    course = Course()
    course.freq = worlds.freq[i]
    course.rate = worlds.ramp_rate[i]
    course.duration = worlds.ramp_duration[i]
    course.amplitude = worlds.amplitude[i]
    course.offset = worlds.phase_offset[i]
    target = motion(course, wp.float64(worlds.step[i]) * worlds.control_dt)
    worlds.target_x[i] = target.position
    worlds.target_vx[i] = target.velocity
    worlds.target_ax[i] = target.acceleration
    worlds.target_freq[i] = target.frequency
    worlds.track[i, 0] = target.position

    hat = worlds.body_pose[i, _HAT]
    attitude = wp.transform_get_rotation(hat)
    velocity = worlds.body_velocity[i, _HAT]
    worlds.head_x[i] = wp.transform_get_translation(hat)[0] + wp.quat_rotate(attitude, worlds.head)[0]
    # The HAT's velocity is that of its centre of mass.
    lever = wp.quat_rotate(attitude, worlds.head - worlds.hat_com)
    worlds.head_vx[i] = velocity[0] + wp.cross(wp.spatial_bottom(velocity), lever)[0]
    left = wp.transform_get_translation(worlds.body_pose[i, _LEFT_FOOT])
    right = wp.transform_get_translation(worlds.body_pose[i, _RIGHT_FOOT])
    worlds.foot_displacement[i, 0] = wp.length(left - worlds.foot_start[i, 0])
    worlds.foot_displacement[i, 1] = wp.length(right - worlds.foot_start[i, 1])


@wp.func
def _draw_length(worlds: Worlds, i: int) -> None:
    number = uniform(worlds.length_seed, wp.uint64(worlds.world[i]), wp.uint64(worlds.episode[i]))
    worlds.length[i] = wp.int64(worlds.length_low + wp.floor(worlds.length_range * number))


@wp.kernel(enable_backward=False)
def _begin(begins: wp.array[wp.bool], worlds: Worlds) -> None:
    i = wp.tid()
    if not begins[i]:
        return
    worlds.episode[i] = worlds.episode[i] + wp.int64(1)
    worlds.step[i] = wp.int64(0)
    worlds.phase_offset[i] = wp.float64(0.0)
    number = uniform(worlds.freq_seed, wp.uint64(worlds.world[i]), wp.uint64(worlds.episode[i]))
    worlds.freq[i] = worlds.freq_low[i] + worlds.freq_range[i] * number
    _draw_length(worlds, i)
    for joint in range(worlds.action.shape[1]):
        worlds.action[i, joint] = 0.0
    for past in range(worlds.track.shape[1]):
        worlds.track[i, past] = 0.0
    _read(worlds, i)


@wp.kernel(enable_backward=False)
def _advance(worlds: Worlds) -> None:
    i = wp.tid()
    worlds.step[i] = worlds.step[i] + wp.int64(1)
    last = worlds.track.shape[1] - 1
    for past in range(last):
        worlds.track[i, last - past] = worlds.track[i, last - past - 1]
    _read(worlds, i)


@wp.kernel(enable_backward=False)
def _restore(worlds: Worlds) -> None:
    i = wp.tid()
    _draw_length(worlds, i)
    _read(worlds, i)


class Episodes:
    """Episodes of N worlds. All attributes are tensors of N worlds that every call below changes in place.

    A world's frequency and length are drawn from (seed, number of the world, number of the episode) alone. `stratified`:
    world i of N draws from the i-th of N equal parts of the range. The distribution over episodes stays uniform, and so does
    that over samples: otherwise frequencies at which episodes end early are rare in the samples, though they need the most.

    episode, step, length: (N,) int64, number of the episode, control steps made in it and after which it is over.
    freq: (N,) float64, frequency of the target at the start of the episode [Hz].
    phase_offset: (N,) float64, added to the target's phase until the end of the episode [rad].
    amplitude: (N,) float64 of the target [m].
    action: (N, 4) of the last step. track: (N, PAST * PAST_STEPS + 1) target positions of the present and the last control
    steps, the newest first [m].
    target_x, target_vx, target_ax, target_freq, head_x, head_vx, foot_displacement: see `TaskState`.
    """

    def __init__(self, config: EnvConfig, sim: Simulation, world: torch.Tensor, seed: int) -> None:
        """For the worlds with the numbers `world` (N,) int64 out of `config.num_envs`."""
        n, device = len(world), sim.device

        def zeros(*shape: int, dtype: torch.dtype = torch.float32) -> torch.Tensor:
            return torch.zeros(n, *shape, dtype=dtype, device=device)

        self._config = config
        self.world = world
        self.freq_low, self.freq_range, self.ramp_rate, self.ramp_duration = (zeros(dtype=torch.float64) for _ in range(4))
        self.amplitude = torch.full_like(self.freq_low, config.amplitude)
        self.foot_start = sim.body_pose[:, FOOT_BODIES, :3].clone()
        self.episode = torch.full_like(world, -1)
        self.step, self.length = zeros(dtype=torch.long), zeros(dtype=torch.long)
        self.freq, self.phase_offset = zeros(dtype=torch.float64), zeros(dtype=torch.float64)
        self.action, self.track = zeros(len(JOINTS)), zeros(PAST * PAST_STEPS + 1)
        self.target_x, self.target_vx, self.target_ax, self.target_freq = (zeros() for _ in range(4))
        self.head_x, self.head_vx, self.foot_displacement = zeros(), zeros(), zeros(len(FEET))
        self._set_range()

        worlds = self._kernel_argument(sim, seed)
        self._begins = zeros(dtype=torch.bool)
        self._begin = Launch(_begin, n, [wp.from_torch(self._begins)], [worlds], device)
        self._advance = Launch(_advance, n, [], [worlds], device)
        self._restore = Launch(_restore, n, [], [worlds], device)
        self.begin(torch.ones_like(self._begins))

    def advance(self) -> None:
        """After a control step of the physics: one more step of each episode."""
        self._advance()

    def begin(self, mask: torch.Tensor) -> None:
        """A new episode in the worlds of `mask` (N,) bool, after the simulation has put them upright."""
        self._begins.copy_(mask)
        self._begin()

    def restore(self) -> None:
        """Compute what follows from episode, step, freq, phase_offset and the state of the simulation, which were changed."""
        self._restore()

    def follow(self, freq: torch.Tensor) -> None:
        """From its next episode on, world i follows a target of the constant `freq`[i] [Hz], (N,)."""
        self.freq_low.copy_(freq)
        self.freq_range.zero_()
        self.ramp_rate.zero_()

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

    def _kernel_argument(self, sim: Simulation, seed: int) -> Any:
        result = Worlds()
        result.control_dt = self._config.control_dt
        result.head, result.hat_com = (wp.vec3(*map(float, point)) for point in (sim.geometry.head, sim.geometry.hat_com))
        # The lengths have other random numbers than the frequencies.
        result.freq_seed, result.length_seed = seed % 2**64, ~seed % 2**64
        shortest, longest = self._config.episode_bounds
        result.length_low, result.length_range = float(shortest), float(longest - shortest + 1)
        tensors = vars(self) | {"body_pose": sim.body_pose, "body_velocity": sim.body_velocity}
        for name, field in Worlds.vars.items():
            if name in tensors:
                setattr(result, name, wp.from_torch(tensors[name], dtype=field.type.dtype))
        return result
