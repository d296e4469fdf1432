"""Follow a moving target with the head: the task, as the vectorised environment that rsl-rl's runner trains on."""

from typing import Any

import torch
from rsl_rl.env import VecEnv
from tensordict import TensorDict

from envs.body.joints import ANKLE, ANKLES, BODIES, FEET, HIP, HIPS, JOINTS, KINDS
from envs.body.rotation import rotate
from envs.config import EnvConfig, Weight, as_plain
from envs.engines.factory import simulate
from envs.task import observations, rewards, target, terminations
from envs.task.observations import PAST, PAST_STEPS, TaskState

CHECK_CAPACITY_EVERY = 100
"""Control steps between two checks of the solver's overflow flags: on a GPU each check waits for the device."""
_SAVED = ("episode_length_buf", "episode", "action", "freq", "track")
"""Tensors of the environment that later steps depend on."""


class HeadTrackingEnv(VecEnv):
    """N standers and their targets. Actions (N, 2): hip and ankle torque over the torque limit, clipped to [-1, 1].

    state: `TaskState` after the last step; in worlds that were reset, of the new episode.
    freq: (N,) frequency of the target at the start of the episode [Hz], float64.
    track: (N, PAST * PAST_STEPS + 1) target positions of the present and the last control steps, the newest first [m].
    steps: control steps that each world has made in all. training_steps: their number in the whole training, which schedules
    of weights refer to; None outside a training, where weights have their final values.
    """

    HAT = BODIES.index("hat")
    FOOT_BODIES = [BODIES.index(foot) for foot in FEET]

    def __init__(
        self,
        config: EnvConfig,
        seed: int,
        device: str,
        part: tuple[int, int] = (0, 1),
        training_steps: int | None = None,
    ) -> None:
        """Worlds `part[0]`, `part[0] + part[1]`, ... of the `config.num_envs`: one of `part[1]` equal parts, which together
        behave as one environment with all worlds."""
        self.config = config
        self.cfg = as_plain(config)
        self.num_envs = config.num_envs // part[1]
        self.num_actions = len(KINDS)
        low, high = config.episode_steps if isinstance(config.episode_steps, tuple) else 2 * (config.episode_steps,)
        self.max_episode_length = high
        self.device = device
        self.sim = simulate(config, self.num_envs, device)
        self.steps = 0
        self.training_steps = training_steps

        n, sim_device = self.num_envs, self.sim.device
        geometry = self.sim.geometry
        self._head = torch.tensor(geometry.head, device=sim_device)[None]
        self._hat_com = torch.tensor(geometry.hat_com, device=sim_device)[None]
        limits = torch.tensor(geometry.joint_limits, device=sim_device)
        self._limit_centre, self._limit_half = limits.mean(0), (limits[1] - limits[0]) / 2.0
        self._foot_start = self.sim.body_pose[:, self.FOOT_BODIES, :3].clone()

        self.episode_length_buf = torch.zeros(n, dtype=torch.long, device=sim_device)
        self.episode = torch.zeros(n, dtype=torch.long, device=sim_device)
        self.action = torch.zeros(n, len(JOINTS), device=sim_device)
        self.track = torch.zeros(n, PAST * PAST_STEPS + 1, device=sim_device)
        worlds = torch.arange(part[0], config.num_envs, part[1], device=sim_device)
        self._source = target.FrequencySource(config.freq, config.ramp, config.freq_draw, worlds, config.num_envs, seed)
        self.freq = self._source.draw(self.episode)
        self._lengths = target.LengthSource(low, high, worlds, seed)
        self._length = self._lengths.draw(self.episode)
        self.state = self._read()

    def step(self, actions: torch.Tensor) -> tuple[TensorDict, torch.Tensor, torch.Tensor, dict[str, Any]]:
        """One control step of every world; worlds whose episode ends are reset and return the new episode's observation.

        A world that diverges (an action that is NaN, physics that explodes) ends its episode early in that step. Its reward
        and log are those of the state before the step, so all returned values are finite. `log` holds means over the worlds;
        /diverged is the number of worlds that diverged.
        """
        # 1. Act: one command for the left and the right joint of a kind.
        command = actions.clamp(-1.0, 1.0)
        self.action[:, HIPS] = command[:, HIP, None]
        self.action[:, ANKLES] = command[:, ANKLE, None]

        # 2. Physics.
        self.sim.step(self.config.torque_limit * self.action)
        # A world with a NaN command has diverged: its torque was not applied.
        self.action.nan_to_num_(nan=0.0)
        self.steps += 1
        self.episode_length_buf += 1
        if self.steps % CHECK_CAPACITY_EVERY == 0:
            self.sim.check_capacity()

        # 3. Where head, feet and target are now.
        self.track.copy_(self.track.roll(1, dims=1))
        self.state = self._read()

        # 4. Terminations and time-outs.
        ended = self._ended()
        time_out = (self.episode_length_buf >= self._length) & ~ended
        done = ended | time_out

        # 5. Reward.
        reward = self._reward(ended)
        log = {
            "/tracking_error_mm": 1e3 * (self.state.target_x - self.state.head_x).abs().mean(),
            "/cost": (self.action**2).sum(-1).mean(),
            "/ended": ended.float().mean(),
            "/diverged": self.sim.diverged.float().sum(),
        }

        # 6. New episodes.
        if bool(done.any()):
            self._reset(done)

        # 7. Observe.
        return self.get_observations(), reward, done, {"time_outs": time_out, "log": log}

    def get_observations(self) -> TensorDict:
        """The groups of `env.observations`, each (N, size) with its terms side by side; a group without terms is (N, 0)."""
        nothing = self.action[:, :0]
        groups = {
            name: torch.cat([nothing, *(observations.TERMS[term].function(self.state) for term in terms)], dim=-1)
            for name, terms in self.config.observations.items()
        }
        return TensorDict(groups, batch_size=[self.num_envs], device=self.sim.device)

    def follow(self, freq: torch.Tensor) -> None:
        """From its next episode on, world i follows a target of the constant frequency `freq`[i] [Hz], (N,)."""
        self._source.fix(freq.to(self.sim.device))

    def warm_up(self) -> None:
        """Compile the kernels of a step and, on a GPU, capture its graph, without moving anything."""
        before = self.state_dict()
        self.sim.step(torch.zeros_like(self.action))
        self.load_state_dict(before)

    def reset_all(self) -> TensorDict:
        """Begin a new episode in every world."""
        self._reset(torch.ones(self.num_envs, dtype=torch.bool, device=self.sim.device))
        return self.get_observations()

    def state_dict(self) -> dict[str, Any]:
        """A copy of everything that later steps depend on: physics, episodes, last action and training progress."""
        own = {name: getattr(self, name).clone() for name in _SAVED}
        progress = {"steps": self.steps, "training_steps": self.training_steps}
        return {**progress, "simulation": self.sim.state_dict(), **own}

    def load_state_dict(self, state: dict[str, Any]) -> None:
        """Restore the state of a `state_dict` exactly."""
        self.steps = state["steps"]
        # Earlier versions did not save the length of the training.
        self.training_steps = state.get("training_steps", self.training_steps)
        self.sim.load_state_dict(state["simulation"])
        for name in _SAVED:
            getattr(self, name).copy_(state[name])
        self._length = self._lengths.draw(self.episode)
        self.state = self._read()

    def _read(self) -> TaskState:
        """The task's state from that of the body and the time of the episode."""
        sim = self.sim
        hat_pose, hat_velocity = sim.body_pose[:, self.HAT], sim.body_velocity[:, self.HAT]
        attitude = hat_pose[:, 3:]
        # The HAT's velocity is that of its centre of mass.
        lever = rotate(attitude, self._head - self._hat_com)
        foot_pose = sim.body_pose[:, self.FOOT_BODIES]
        target_x, target_vx, target_ax, target_freq = (value.float() for value in self._target())
        self.track[:, 0] = target_x
        return TaskState(
            hat_pose=hat_pose,
            hat_velocity=hat_velocity,
            foot_pose=foot_pose,
            foot_displacement=(foot_pose[..., :3] - self._foot_start).norm(dim=-1),
            joint_angle=sim.joint_angle,
            joint_velocity=sim.joint_velocity,
            joint_force=sim.joint_force,
            sole_force=sim.sole_force,
            sole_position=sim.sole_position,
            action=self.action,
            head_x=hat_pose[:, 0] + rotate(attitude, self._head)[:, 0],
            head_vx=(hat_velocity[:, :3] + torch.linalg.cross(hat_velocity[:, 3:], lever))[:, 0],
            target_x=target_x,
            target_vx=target_vx,
            target_ax=target_ax,
            target_freq=target_freq,
            target_past=self.track[:, PAST_STEPS::PAST_STEPS],
        )

    def _target(self) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor, torch.Tensor]:
        """Position [m], velocity [m/s], acceleration [m/s2] and frequency [Hz] of the target, (N,) float64 each."""
        time = self.episode_length_buf.double() * self.config.control_dt
        phase = target.phase(time, self.freq, self._source.rate, self._source.duration)
        now = target.frequency(time, self.freq, self._source.rate, self._source.duration)
        rate = self._source.rate * (time < self._source.duration)
        amplitude = self.config.amplitude
        return (
            target.position(phase, amplitude),
            target.velocity(phase, now, amplitude),
            target.acceleration(phase, now, rate, amplitude),
            now,
        )

    def _ended(self) -> torch.Tensor:
        """The worlds whose episode ends early, (N,) bool."""
        limits, state = self.config.termination, self.state
        ended = self.sim.diverged | terminations.fallen(state.hat_pose[:, 2], limits.fall_height)
        if limits.foot_motion is not None:
            ended = ended | terminations.foot_moved(state.foot_displacement, limits.foot_motion)
        if limits.head_tolerance is not None:
            ended = ended | terminations.head_off_target(state.target_x - state.head_x, limits.head_tolerance)
        return ended

    def _reward(self, ended: torch.Tensor) -> torch.Tensor:
        """The reward of every world, (N,); see envs/task/rewards.py."""

        def weight(value: Weight) -> float:
            return rewards.weight(value, self.steps, self.training_steps)

        config, terms, state = self.config, self.config.reward, self.state
        stay = rewards.closeness(state.foot_displacement.mean(-1), terms.stay_sharpness)
        tracking = rewards.closeness(state.target_x - state.head_x, terms.target_sharpness)
        energy, torque = rewards.effort(state.action, state.joint_velocity, config)
        reward = (
            weight(terms.stay_weight) * stay
            + weight(terms.target_weight) * tracking
            + weight(terms.alive)
            + weight(config.energy_weight) * (energy + torque)
        )
        if terms.tolerance_weight:
            reward = reward - terms.tolerance_weight * rewards.beyond(state.target_x - state.head_x, terms.tolerance)
        if terms.joint_limit_weight:
            scaled = (state.joint_angle - self._limit_centre) / self._limit_half
            reward = reward - terms.joint_limit_weight * rewards.joint_limit(scaled)
        if terms.ended is not None:
            reward = torch.where(ended, weight(terms.ended), reward)
        return terms.scale * reward

    def _reset(self, mask: torch.Tensor) -> None:
        self.sim.reset(mask)
        self.episode_length_buf[mask] = 0
        self.episode += mask
        self.action[mask] = 0.0
        self.track[mask] = 0.0
        self.freq = torch.where(mask, self._source.draw(self.episode), self.freq)
        self._length = self._lengths.draw(self.episode)
        self.state = self._read()
