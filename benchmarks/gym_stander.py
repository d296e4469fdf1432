"""The default task as a Gymnasium environment on MuJoCo's C engine, one stander per environment. For comparison only.

Body, step, actions, target, reward and terminations are those of `envs.task.head_tracking.HeadTrackingEnv`, with the numbers
of its configuration; tests/test_benchmarks.py compares the two. `Pool` runs many of them in a few processes.
"""

import math
import multiprocessing
from collections import deque
from collections.abc import Callable

import gymnasium
import mujoco
import numpy as np
from gymnasium import spaces

from envs.body.joints import ANKLES, FEET, HIPS, JOINTS
from envs.config import EnvConfig
from envs.engines.mujoco_c import build
from envs.task import rewards, terminations
from envs.task.observations import PAST, PAST_STEPS

FORK = "fork"
"""How processes start: with spawn each would import Newton again."""

Step = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, dict[int, np.ndarray]]


class StanderEnv(gymnasium.Env[np.ndarray, np.ndarray]):
    """One stander. Action (2,): hip and ankle torque over the torque limit. Observation: all groups of `env.observations`.

    Scheduled weights follow the number of steps since construction, over all episodes, as in `HeadTrackingEnv`. A frequency
    given as a range is drawn uniformly for each episode from Gymnasium's random numbers.
    """

    def __init__(self, config: EnvConfig, training_steps: int | None = None) -> None:
        terms = [term for group in config.observations.values() for term in group]
        unsupported = sorted(set(terms) - set(TERMS))
        if unsupported:
            raise ValueError(f"env.observations: {', '.join(unsupported)} not supported here; {', '.join(TERMS)} are")
        if config.ramp is not None or config.reward.joint_limit_weight:
            raise ValueError("env.ramp and env.reward.joint_limit_weight are not supported here: leave them null and 0")
        self.config = config
        self._terms = [TERMS[term] for term in terms]
        self.model, self.data = build(config)
        model = self.model
        hinges = [model.joint(name).id for name in JOINTS]
        self.angles, self.dofs = model.jnt_qposadr[hinges], model.jnt_dofadr[hinges]
        self.hat, self.feet = model.body("hat").id, [model.body(foot).id for foot in FEET]
        self.head, self.hat_com = model.geom("head").pos, model.body("hat").ipos
        self.steps, self.training_steps = 0, training_steps
        self.action = np.zeros(len(JOINTS))
        self.reset()
        self.action_space = spaces.Box(-1.0, 1.0, (2,))
        self.observation_space = spaces.Box(-np.inf, np.inf, self._observation().shape)

    def reset(self, *, seed: int | None = None, options: dict | None = None) -> tuple[np.ndarray, dict]:
        """Stand upright and at rest, with a new target."""
        super().reset(seed=seed)
        freq = self.config.freq
        self.freq = float(self.np_random.uniform(*freq)) if isinstance(freq, tuple) else freq
        length = self.config.episode_steps
        self.length = int(self.np_random.integers(length[0], length[1] + 1)) if isinstance(length, tuple) else length
        self.episode_step = 0
        self.action[:] = 0.0
        self.track = deque([0.0] * (PAST * PAST_STEPS + 1), PAST * PAST_STEPS + 1)
        mujoco.mj_resetData(self.model, self.data)
        mujoco.mj_kinematics(self.model, self.data)
        self.foot_start = self.data.xpos[self.feet]
        self._read()
        return self._observation(), {}

    def step(self, action: np.ndarray) -> tuple[np.ndarray, float, bool, bool, dict]:
        """One control step."""
        hip, ankle = np.clip(action, -1.0, 1.0)
        self.action[HIPS], self.action[ANKLES] = hip, ankle
        self.data.qfrc_applied[self.dofs] = self.config.torque_limit * self.action
        mujoco.mj_step(self.model, self.data, self.config.solver.substeps)
        mujoco.mj_kinematics(self.model, self.data)  # mj_step leaves the positions from before its last substep
        self.steps += 1
        self.episode_step += 1
        self._read()
        ended = self._ended()
        time_out = self.episode_step >= self.length and not ended
        return self._observation(), self._reward(ended), ended, time_out, {}

    # -- internal ----------------------------------------------------------------------------------------------------

    def _read(self) -> None:
        data, config = self.data, self.config
        self.attitude = data.xmat[self.hat].reshape(3, 3)
        self.spin = self.attitude @ data.qvel[3:6]  # MuJoCo's is in the body frame
        lever = self.attitude @ self.hat_com
        self.com_velocity = data.qvel[:3] + _cross(self.spin, lever)
        lever = self.attitude @ self.head
        self.head_x = float(data.qpos[0] + lever[0])
        self.head_vx = float(data.qvel[0] + _cross(self.spin, lever)[0])
        self.foot_displacement = [math.dist(*places) for places in zip(data.xpos[self.feet], self.foot_start, strict=True)]
        speed = 2.0 * math.pi * self.freq
        angle = speed * self.episode_step * config.control_dt
        self.target_x = config.amplitude * (1.0 - math.cos(angle))
        self.target_vx = config.amplitude * speed * math.sin(angle)
        self.target_ax = config.amplitude * speed**2 * math.cos(angle)
        self.track.appendleft(self.target_x)

    def _ended(self) -> bool:
        limits = self.config.termination
        return bool(
            terminations.fallen(self.data.qpos[2], limits.fall_height)
            or (limits.foot_motion is not None and max(self.foot_displacement) >= limits.foot_motion)
            or (limits.head_tolerance is not None and abs(self.target_x - self.head_x) >= limits.head_tolerance)
        )

    def _reward(self, ended: bool) -> float:
        config, terms = self.config, self.config.reward
        if ended and terms.ended is not None:
            return terms.scale * rewards.weight(terms.ended, self.steps, self.training_steps)
        energy, torque = rewards.effort(self.action, self.data.qvel[self.dofs], config)
        stay = rewards.closeness(sum(self.foot_displacement) / len(FEET), terms.stay_sharpness)
        tracking = rewards.closeness(self.target_x - self.head_x, terms.target_sharpness)
        return terms.scale * float(
            -terms.tolerance_weight * rewards.beyond(np.float64(self.target_x - self.head_x), terms.tolerance)
            + rewards.weight(terms.stay_weight, self.steps, self.training_steps) * stay
            + rewards.weight(terms.target_weight, self.steps, self.training_steps) * tracking
            + rewards.weight(terms.alive, self.steps, self.training_steps)
            + rewards.weight(config.energy_weight, self.steps, self.training_steps) * (energy + torque)
        )

    def _observation(self) -> np.ndarray:
        return np.concatenate([term(self) for term in self._terms]).astype(np.float32)


TERMS: dict[str, Callable[[StanderEnv], object]] = {
    "torso_height": lambda env: env.data.qpos[2:3],
    "torso_velocity": lambda env: env.com_velocity,
    "torso_angular_velocity": lambda env: env.spin,
    "torso_pitch": lambda env: (math.atan2(env.attitude[0, 2], env.attitude[2, 2]),),
    "torso_motion": lambda env: (env.com_velocity[0], env.com_velocity[2], env.spin[1]),
    "joint_angle": lambda env: env.data.qpos[env.angles],
    "joint_velocity": lambda env: env.data.qvel[env.dofs],
    "hip_ankle_angle": lambda env: env.data.qpos[env.angles].reshape(2, 2).mean(0),
    "hip_ankle_velocity": lambda env: env.data.qvel[env.dofs].reshape(2, 2).mean(0),
    "foot_position": lambda env: env.data.xpos[env.feet].ravel(),
    "feet_place": lambda env: env.data.xpos[env.feet].mean(0)[::2],
    "head": lambda env: (env.head_x, env.head_vx),
    "last_action": lambda env: env.action,
    "last_command": lambda env: env.action[:2],
    "target": lambda env: (env.target_x,),
    "target_velocity": lambda env: (env.target_vx,),
    "target_acceleration": lambda env: (env.target_ax,),
    "target_frequency": lambda env: (env.freq,),
    "target_history": lambda env: env.target_x - np.array(env.track)[PAST_STEPS::PAST_STEPS],
    "target_error": lambda env: (env.target_x - env.head_x,),
}
"""The supported terms of envs/task/observations.py, by name."""


def shares(config: EnvConfig, worlds: int) -> list[EnvConfig]:
    """The configuration of each of `worlds` environments. Stratified draws give each its part of the frequency range."""
    if not isinstance(config.freq, tuple) or config.freq_draw != "stratified":
        return [config] * worlds
    edges = np.linspace(*config.freq, worlds + 1).tolist()
    return [config.model_copy(update={"freq": part}) for part in zip(edges, edges[1:], strict=False)]


class Pool:
    """Many `StanderEnv` in a few processes; a world is reset when its episode ends.

    Gymnasium's AsyncVectorEnv starts one process per world, which is slow when there are more worlds than cores.
    """

    def __init__(self, config: EnvConfig, worlds: int, processes: int, seed: int, training_steps: int | None = None) -> None:
        context, self._pipes, self._first = multiprocessing.get_context(FORK), [], []
        configs = shares(config, worlds)
        for places in np.array_split(np.arange(worlds), processes):
            ours, theirs = context.Pipe()
            own = [(configs[place], seed + int(place)) for place in places]
            context.Process(target=_work, args=(theirs, own, training_steps), daemon=True).start()
            self._pipes.append(ours)
            self._first.append(int(places[0]))
        self.observation = np.concatenate([pipe.recv() for pipe in self._pipes])

    def step(self, actions: np.ndarray) -> Step:
        """Actions (N, 2) -> observation (N, size), reward (N,), ended (N,), timed out (N,), last observations by world.

        A world whose episode is over returns the first observation of the next episode; its last one is in the dictionary.
        """
        for pipe, part in zip(self._pipes, np.split(actions, self._first[1:]), strict=True):
            pipe.send(part)
        *arrays, last = zip(*(pipe.recv() for pipe in self._pipes), strict=True)
        final = {first + i: seen for first, part in zip(self._first, last, strict=True) for i, seen in part.items()}
        return *(np.concatenate(parts) for parts in arrays), final

    def close(self) -> None:
        """End the processes."""
        for pipe in self._pipes:
            pipe.send(None)


def _work(pipe, configs_and_seeds: list[tuple[EnvConfig, int]], training_steps: int | None) -> None:
    """Main loop of a process of a `Pool`; receiving None ends it."""
    envs = [StanderEnv(config, training_steps) for config, _ in configs_and_seeds]
    pipe.send(np.stack([env.reset(seed=seed)[0] for env, (_, seed) in zip(envs, configs_and_seeds, strict=True)]))
    while (actions := pipe.recv()) is not None:
        observations, gains, ended, timed_out, _ = map(list, zip(*map(StanderEnv.step, envs, actions), strict=True))
        last = {}
        for place in np.flatnonzero(np.logical_or(ended, timed_out)):
            last[int(place)] = observations[place]
            observations[place] = envs[place].reset()[0]
        pipe.send((np.stack(observations), np.array(gains), np.array(ended), np.array(timed_out), last))


def _cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Cross product of two vectors, ten times as fast as np.cross."""
    return np.array((a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]))
