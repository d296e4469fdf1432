"""Follow a moving target with the head: the task, as the vectorised environment that rsl-rl's runner trains on."""

from typing import Any

import torch
from rsl_rl.env import VecEnv
from tensordict import TensorDict

from envs.body.joints import ANKLE, ANKLES, BODIES, FEET, HIP, HIPS, JOINTS, KINDS
from envs.body.rotation import rotate
from envs.config import EnvConfig, as_plain
from envs.engines.factory import simulate
from envs.task import observations, rewards, target, terminations

CHECK_CAPACITY_EVERY = 100
"""Control steps between two looks at the solver's overflow flags, which on a GPU cost a wait."""


class HeadTrackingEnv(VecEnv):
    """N standers and their targets. Actions (N, 2): hip and ankle torque over the torque limit, clipped to [-1, 1].

    Tensors that terms and observations read (N worlds; after a reset they are those of the new episode):
        head_x, head_vx: (N,) head along x, 0 at the start [m], [m/s].
        target_x, target_vx, freq: (N,) [m], [m/s], [Hz].
        hat_pose, hat_velocity: (N, 7), (N, 6) of the HAT, see `Simulation.body_pose`, `body_velocity`.
        foot_position: (N, 2, 3) [m]. foot_displacement: (N, 2) distance from the start [m].
        action: (N, 4) normalised torque of each joint.
    """

    HAT = BODIES.index("hat")
    FOOT_BODIES = [BODIES.index(foot) for foot in FEET]

    def __init__(self, config: EnvConfig, seed: int, device: str, part: tuple[int, int] = (0, 1)) -> None:
        """The worlds `part[0]`, `part[0]` + `part[1]`, ... of the `config.num_envs`: one of `part[1]` equal parts, together
        the same as all in one."""
        unknown = sorted({term for terms in config.observations.values() for term in terms} - set(observations.TERMS))
        if unknown:
            raise ValueError(f"env.observations: unknown {unknown}; allowed are {sorted(observations.TERMS)}")
        self.config = config
        self.cfg = as_plain(config)
        self.num_envs = config.num_envs // part[1]
        self.num_actions = len(KINDS)
        low, high = config.episode_steps if isinstance(config.episode_steps, tuple) else 2 * (config.episode_steps,)
        self.max_episode_length = high
        self.device = device
        self.sim = simulate(config, self.num_envs, device)

        n, place = self.num_envs, self.sim.device
        shape = self.sim.geometry
        self._head = torch.tensor(shape.head, device=place)[None]
        self._hat_com = torch.tensor(shape.hat_com, device=place)[None]
        limits = torch.tensor(shape.joint_limits, device=place)
        self._limit_centre, self._limit_half = limits.mean(0), (limits[1] - limits[0]) / 2.0
        self.hat_pose = self.sim.body_pose[:, self.HAT]
        self.hat_velocity = self.sim.body_velocity[:, self.HAT]
        self.foot_position = self.sim.body_pose[:, self.FOOT_BODIES, :3]
        self._foot_start = self.foot_position.clone()

        self.steps = 0
        """Control steps each world has made in all, which schedules of weights count in."""
        self.episode_length_buf = torch.zeros(n, dtype=torch.long, device=place)
        self.episode = torch.zeros(n, dtype=torch.long, device=place)
        self.action = torch.zeros(n, len(JOINTS), device=place)
        worlds = torch.arange(part[0], config.num_envs, part[1], device=place)
        self._source = target.FrequencySource(config.freq, config.ramp, config.freq_draw, worlds, config.num_envs, seed)
        self.freq = self._source.draw(self.episode)
        self._lengths = target.LengthSource(low, high, worlds, seed)
        self._length = self._lengths.draw(self.episode)
        self._read()

    def step(self, actions: torch.Tensor) -> tuple[TensorDict, torch.Tensor, torch.Tensor, dict[str, Any]]:
        """One control step of every world; worlds whose episode ends are reset and return the new episode's observation.

        A world that diverges (an action that is NaN, physics that explodes) ends early in that step. Reward and log are
        then those of the state before it, so all that is returned is finite. `log` holds means over the worlds, and in
        /diverged the number of those worlds.
        """
        # 1. Act: one command for the left and the right joint of a kind.
        command = actions.clamp(-1.0, 1.0)
        self.action[:, HIPS] = command[:, HIP, None]
        self.action[:, ANKLES] = command[:, ANKLE, None]

        # 2. Physics.
        self.sim.step(self.config.torque_limit * self.action)
        # A world with such a command has diverged, and a torque that is no number was never applied.
        self.action.nan_to_num_(nan=0.0)
        self.steps += 1
        self.episode_length_buf += 1
        if self.steps % CHECK_CAPACITY_EVERY == 0:
            self.sim.check_capacity()

        # 3. Where head, feet and target are now.
        self._read()

        # 4. What ends here.
        ended = self._ended()
        time_out = (self.episode_length_buf >= self._length) & ~ended
        done = ended | time_out

        # 5. Reward.
        reward = self._reward(ended)
        log = {
            "/tracking_error_mm": 1e3 * (self.target_x - self.head_x).abs().mean(),
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
        """The groups of `env.observations`, each (N, size) with its terms side by side."""
        groups = {
            name: torch.cat([observations.TERMS[term](self) for term in terms], dim=-1)
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
        """All that the coming steps depend on, as copies: physics, episodes, last action, and the step count."""
        own = {name: getattr(self, name).clone() for name in ("episode_length_buf", "episode", "action", "freq")}
        return {"steps": self.steps, "simulation": self.sim.state_dict(), **own}

    def load_state_dict(self, state: dict[str, Any]) -> None:
        """Go on exactly where `state_dict` was taken."""
        self.steps = state["steps"]
        self.sim.load_state_dict(state["simulation"])
        for name in ("episode_length_buf", "episode", "action", "freq"):
            getattr(self, name).copy_(state[name])
        self._length = self._lengths.draw(self.episode)
        self._read()

    # -- inside ------------------------------------------------------------------------------------------------------

    def _read(self) -> None:
        """Refresh what is derived from the state of the body and from the time of the episode."""
        attitude = self.hat_pose[:, 3:]
        self.head_x = self.hat_pose[:, 0] + rotate(attitude, self._head)[:, 0]
        # The HAT's velocity is that of its centre of mass.
        lever = rotate(attitude, self._head - self._hat_com)
        self.head_vx = (self.hat_velocity[:, :3] + torch.linalg.cross(self.hat_velocity[:, 3:], lever))[:, 0]
        self.foot_position = self.sim.body_pose[:, self.FOOT_BODIES, :3]
        self.foot_displacement = (self.foot_position - self._foot_start).norm(dim=-1)
        time = self.episode_length_buf * self.config.control_dt
        angle = target.phase(time, self.freq, self._source.rate, self._source.duration)
        now = target.frequency(time, self.freq, self._source.rate, self._source.duration)
        self.target_x = target.position(angle, self.config.amplitude)
        self.target_vx = target.velocity(angle, now, self.config.amplitude)

    def _ended(self) -> torch.Tensor:
        limits = self.config.termination
        ended = self.sim.diverged | terminations.fallen(self.hat_pose[:, 2], limits.fall_height)
        if limits.foot_motion is not None:
            ended = ended | terminations.foot_moved(self.foot_displacement, limits.foot_motion)
        if limits.head_tolerance is not None:
            ended = ended | terminations.head_off_target(self.target_x - self.head_x, limits.head_tolerance)
        return ended

    def _reward(self, ended: torch.Tensor) -> torch.Tensor:
        config, terms = self.config, self.config.reward
        torque, velocity = config.torque_limit * self.action, self.sim.joint_velocity
        stay = rewards.closeness(self.foot_displacement.mean(-1), terms.stay_sharpness)
        tracking = rewards.closeness(self.target_x - self.head_x, terms.target_sharpness)
        energy = rewards.energy(torque, velocity, terms.energy_unit, config.torque_limit, config.control_dt)
        effort = rewards.torque_squared(torque if terms.torque_unit == "newton_metre" else self.action)
        reward = (
            rewards.weight(terms.stay_weight, self.steps) * stay
            + rewards.weight(terms.target_weight, self.steps) * tracking
            + rewards.weight(terms.alive, self.steps)
            + rewards.weight(config.energy_weight, self.steps) * (energy + effort)
        )
        if terms.joint_limit_weight:
            scaled = (self.sim.joint_angle - self._limit_centre) / self._limit_half
            reward = reward - terms.joint_limit_weight * rewards.joint_limit(scaled)
        if terms.ended is not None:
            reward = torch.where(ended, rewards.weight(terms.ended, self.steps), reward)
        return terms.scale * reward

    def _reset(self, mask: torch.Tensor) -> None:
        self.sim.reset(mask)
        self.episode_length_buf[mask] = 0
        self.episode += mask
        self.action[mask] = 0.0
        self.freq = torch.where(mask, self._source.draw(self.episode), self.freq)
        self._length = self._lengths.draw(self.episode)
        self._read()
