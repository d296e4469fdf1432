"""Follow a moving target with the head: the task, as the vectorised environment that rsl-rl's runner trains on."""

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
import torch
from rsl_rl.env import VecEnv
from tensordict import TensorDict

from envs.body.joints import BODIES, KINDS
from envs.config import EnvConfig, Weight, as_plain
from envs.engines.cuda_graph import CudaGraph
from envs.engines.factory import simulate
from envs.engines.interface import SUBJECT
from envs.task import bodies, observations, rewards, terminations
from envs.task.actuation import Actuation
from envs.task.episodes import FOOT_BODIES, Episodes
from envs.task.observations import PAST_STEPS, TaskState
from envs.task.senses import Senses

_SAVED = {"episode_length_buf": "step"} | {
    name: name
    for name in (
        *("episode", "action", "command", "activation", "freq", "track", "phase_offset"),
        *("amplitude", "tolerance", "effort_scale"),
    )
}
"""Tensors of `Episodes` that later steps depend on, by their names in a saved state."""

SENSED = ("now", "drift", "past")
"""Tensors of `Senses` that are saved, too."""

LOG = ("/tracking_error_mm", "/cost", "/ended", "/diverged")
"""What a step measures, under the names that rsl-rl's logger shows."""


class HeadTrackingEnv(VecEnv):
    """N standers and their targets. Actions (N, 2): hip and ankle torque over the torque limit, clipped to [-1, 1].

    state: `TaskState` after the last step; in worlds that were reset, of the new episode. Its tensors change in place.
    episodes: `Episodes`, with the time and the target of each world. episode_length_buf: its steps, under rsl-rl's name.
    infeasible_share: share of the ranges that is not drawn, because the body could not follow the target.
    steps: () int64, control steps that each world has made in all. training_steps: their number in the whole training, which
    schedules of weights refer to; None outside a training, where weights have their final values.

    On a GPU a step makes the host wait for nothing: resets, draws, time-outs and schedules are computed there, in a CUDA
    graph.
    """

    def __init__(
        self,
        config: EnvConfig,
        seed: int,
        device: str,
        part: tuple[int, int] = (0, 1),
        training_steps: int | None = None,
        least_costs: bodies.LeastCosts | None = None,
    ) -> None:
        """Worlds `part[0]`, `part[0] + part[1]`, ... of the `config.num_envs`: one of `part[1]` equal parts, which together
        behave as one environment with all worlds. least_costs: of what `config.ranges` allows; None: all of it is drawn, and
        effort counts equally for all."""
        self.config = config
        self.cfg = as_plain(config)
        self.num_envs = config.num_envs // part[1]
        self.num_actions = len(KINDS)
        _, self.max_episode_length = config.episode_bounds
        self.device = device
        self.sim = simulate(config, self.num_envs, device)
        self.training_steps = training_steps
        self._graph: CudaGraph | None = None

        sim_device = self.sim.device
        limits = torch.tensor(self.sim.geometry.joint_limits, device=sim_device)
        self._limit_centre, self._limit_half = limits.mean(0), (limits[1] - limits[0]) / 2.0
        self.steps = torch.zeros((), dtype=torch.long, device=sim_device)
        worlds = torch.arange(part[0], config.num_envs, part[1], device=sim_device)
        self.infeasible_share, table = 0.0, None
        if config.ranges.given:
            rows, least, self.infeasible_share = bodies.table(config, seed, least_costs)
            table = np.column_stack([rows, bodies.effort_scale(config, least)])
        self._drawn = [name for name in config.ranges.given if name in SUBJECT]
        self.episodes = Episodes(config, self.sim, worlds, seed, table)
        self.sim.apply_drawn(self._drawn)
        self.episode_length_buf = self.episodes.step
        self.state = self._task_state()
        self._actuation = None if config.actuation.is_ideal else Actuation(config, self.episodes)
        self._senses = None if config.sensing.is_exact else Senses(config, self.episodes)
        self._observe()

    def step(self, actions: torch.Tensor) -> tuple[TensorDict, torch.Tensor, torch.Tensor, dict[str, Any]]:
        """One control step of every world; worlds whose episode ends are reset and return the new episode's observation.

        A world that diverges (an action that is NaN, physics that explodes) ends its episode early in that step. Its reward
        and log are those of the state before the step, so all returned values are finite. `log` holds means over the worlds;
        /diverged is the number of worlds that diverged.
        """
        if self._graph is None and self.sim.device.type == "cuda":
            self.warm_up()
        # One command for the left and the right joint of a kind.
        command = actions.clamp(-1.0, 1.0)
        torch.cat((command, command), dim=-1, out=self.state.command)
        if self.sim.replays_graph:
            self._move()
        *groups, reward, done, time_out, log = self._rest_of_step() if self._graph is None else self._graph()
        observation = self._named(dict(zip(self.config.observations, groups, strict=True)))
        return observation, reward, done, {"time_outs": time_out, "log": dict(zip(LOG, log.unbind(), strict=True))}

    def get_observations(self) -> TensorDict:
        """The groups of `env.observations`, each (N, size) with its terms side by side; a group without terms is (N, 0).

        Where `env.sensing` is not exact, they are as sensed after the last step or reset.
        """
        return self._named(self._as_sensed(self._exact()))

    def follow(self, freq: torch.Tensor) -> None:
        """From its next episode on, world i follows a target of the constant frequency `freq`[i] [Hz], (N,)."""
        self.episodes.follow(freq)

    def warm_up(self) -> None:
        """Compile the kernels of a step and, on a GPU, capture its graph, without moving anything."""
        before = self.state_dict()
        if self.sim.replays_graph:
            self._move()
        self._rest_of_step()
        self.load_state_dict(before)
        if self.sim.device.type == "cuda":
            self._graph = CudaGraph(self._rest_of_step, self.sim.device)

    def reset_all(self) -> TensorDict:
        """Begin a new episode in every world."""
        self._reset(torch.ones(self.num_envs, dtype=torch.bool, device=self.sim.device))
        self._observe()
        return self.get_observations()

    def state_dict(self) -> dict[str, Any]:
        """A copy of everything that later steps depend on: physics, episodes, last action and training progress."""
        own = {name: getattr(self.episodes, attribute).clone() for name, attribute in _SAVED.items()}
        if self._senses is not None:
            own |= {name: getattr(self._senses, name).clone() for name in SENSED}
        progress = {"steps": int(self.steps), "training_steps": self.training_steps}
        return {**progress, "simulation": self.sim.state_dict(), **own}

    def load_state_dict(self, state: dict[str, Any]) -> None:
        """Restore the state of a `state_dict` exactly."""
        self.steps.fill_(state["steps"])
        # Earlier versions saved less. The command was the action, and the offset of the phase 0.
        training_steps = state.get("training_steps", self.training_steps)
        if training_steps != self.training_steps:
            self.training_steps, self._graph = training_steps, None
        state = {name: getattr(self.episodes, name) for name in ("amplitude", "tolerance", "effort_scale")} | state
        state = {"phase_offset": torch.zeros_like(self.episodes.freq), "command": state["action"]} | state
        state = {"activation": torch.zeros_like(self.episodes.activation)} | state
        self.sim.load_state_dict(state["simulation"])
        for name, attribute in _SAVED.items():
            getattr(self.episodes, attribute).copy_(state[name])
        self.sim.apply_drawn(self._drawn)
        self.episodes.restore()
        if self._senses is not None:
            for name in SENSED:
                getattr(self._senses, name).copy_(state[name])
            self._senses.restore()

    def _task_state(self) -> TaskState:
        """Views of the tensors of simulation and episodes."""
        sim, episodes, hat = self.sim, self.episodes, BODIES.index("hat")
        return TaskState(
            hat_pose=sim.body_pose[:, hat],
            hat_velocity=sim.body_velocity[:, hat],
            foot_pose=sim.body_pose[:, FOOT_BODIES[0] :: FOOT_BODIES[1] - FOOT_BODIES[0]],
            foot_displacement=episodes.foot_displacement,
            joint_angle=sim.joint_angle,
            joint_velocity=sim.joint_velocity,
            joint_force=sim.joint_force,
            sole_force=sim.sole_force,
            sole_position=sim.sole_position,
            action=episodes.action,
            command=episodes.command,
            head_x=episodes.head_x,
            head_vx=episodes.head_vx,
            target_x=episodes.target_x,
            target_vx=episodes.target_vx,
            target_ax=episodes.target_ax,
            target_freq=episodes.target_freq,
            **{name: getattr(sim, name) for name in SUBJECT},
            amplitude=episodes.amplitude,
            tolerance=episodes.tolerance,
            target_past=episodes.track[:, PAST_STEPS::PAST_STEPS],
        )

    def _rest_of_step(self) -> list[torch.Tensor]:
        """A control step once `state.command` is set. On a GPU it is captured: its Python code runs once.

        Returns the groups of observations, reward, done and time-outs, (N,), and the values of `LOG`.
        """
        if not self.sim.replays_graph:
            self._move()
        self.episodes.advance()
        ended = self._ended()
        time_out = (self.episodes.step >= self.episodes.length) & ~ended
        done = ended | time_out
        reward = self._reward(ended)
        log = (
            1e3 * (self.state.target_x - self.state.head_x).abs().mean(),
            self.state.action.square().sum(-1).mean(),
            ended.float().mean(),
            self.sim.diverged.float().sum(),
        )
        self._reset(done)
        return [*self._observe(), reward, done, time_out, torch.stack(log)]

    def _move(self) -> None:
        """A control step of actuators and physics."""
        if self._actuation is not None:
            self._actuation.actuate()
        self.sim.step(self.config.torque_limit * self.state.action)
        # A world with a NaN command has diverged: its torque was not applied.
        self.state.action.nan_to_num_(nan=0.0)
        self.steps += 1

    def _observe(self, mask: torch.Tensor | None = None) -> list[torch.Tensor]:
        """The groups of observations after a step, or after a reset of the worlds of `mask` (N,) bool."""
        groups = self._exact()
        if self._senses is not None:
            torch.cat([groups[name] for name in self._senses.sizes], dim=-1, out=self._senses.exact)
            self._senses.sense(mask)
        return list(self._as_sensed(groups).values())

    def _as_sensed(self, groups: dict[str, torch.Tensor]) -> dict[str, torch.Tensor]:
        """Exact `groups` as the policy observes them after the last step or reset."""
        if self._senses is None:
            return groups
        sensed = torch.split(self._senses.sensed.clone(), list(self._senses.sizes.values()), dim=-1)
        return groups | dict(zip(self._senses.sizes, sensed, strict=True))

    def _exact(self) -> dict[str, torch.Tensor]:
        groups, nothing = self.config.observations, self.state.action[:, :0]
        names = dict.fromkeys(name for terms in groups.values() for name in terms)
        values = {name: observations.TERMS[name].function(self.state) for name in names}
        return {name: torch.cat([nothing, *(values[term] for term in terms)], dim=-1) for name, terms in groups.items()}

    def _named(self, groups: dict[str, torch.Tensor]) -> TensorDict:
        return TensorDict(groups, batch_size=[self.num_envs], device=self.sim.device)

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

        weight: Callable[[Weight], float | torch.Tensor] = rewards.weight
        if self.training_steps is not None:
            weight = partial(rewards.weight_at, self.steps.double() / max(1, self.training_steps))

        config, terms, state = self.config, self.config.reward, self.state
        stay = rewards.closeness(state.foot_displacement.mean(-1), terms.stay_sharpness)
        distance, velocity = state.target_x - state.head_x, state.joint_velocity
        scaled = (state.joint_angle - self._limit_centre) / self._limit_half
        if terms.as_run:
            distance = distance.abs().sum() * (config.num_envs / self.num_envs)
            scaled = rewards.one_late(scaled, 0.1 * velocity)
            velocity = rewards.velocity_as_run(velocity, state.joint_force)
        tracking = rewards.closeness(distance, terms.target_sharpness)
        energy, torque = rewards.effort(state.action, velocity, config)
        effort = energy + torque
        if config.ranges.given and terms.effort_exponent != 0.0:
            effort = effort * self.episodes.effort_scale ** weight(terms.effort_exponent)
        reward = (
            weight(terms.stay_weight) * stay
            + weight(terms.target_weight) * tracking
            + weight(terms.alive)
            + weight(config.energy_weight) * effort
        )
        if terms.tolerance_weight:
            reward = reward - terms.tolerance_weight * rewards.beyond(state.target_x - state.head_x, state.tolerance)
        if terms.joint_limit_weight:
            reward = reward - terms.joint_limit_weight * rewards.joint_limit(scaled)
        if terms.ended is not None:
            reward = torch.where(ended, weight(terms.ended), reward)
        return terms.scale * reward

    def _reset(self, mask: torch.Tensor) -> None:
        self.sim.reset(mask)
        self.episodes.begin(mask)
        if self._drawn:
            self.sim.apply_drawn(self._drawn)
