"""One stander to play with: settings in, state out, one control step at a time; independent of browser and clock."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import torch

from envs.body.joints import ANKLES, BODIES, HIPS
from envs.body.segments import Segments, read_segments
from envs.config import Person
from posture.analysis.trajectory import Array
from posture.config.body import factor
from posture.config.play import SETTINGS, STIFFNESS, PlayConfig
from posture.evaluation.rollout import MIN_LOAD_N
from posture.play.environment import PlayEnv, Settings
from posture.play.measures import History, Measures, Trail, measure
from posture.play.policies import Controller, PolicyChoice
from posture.play.theory_worker import LeastCost, TheoryRequest, TheoryWorker, least_cost

FALL_SHOWN_S = 1.5
"""[s] from a fall to the next start."""
TRAIL_EVERY_S = 0.25
FEET = [BODIES.index(name) for name in ("foot_left", "foot_right")]


@dataclass(frozen=True, eq=False)
class State:
    """The state of one moment, for the page to draw.

    pose: frames of `envs.body.joints.BODIES`, position [m] and quaternion x y z w, (5, 7). head, target: along x [m].
    force: of the ground on the left and right foot [N], (2, 3); point: where it acts in the world [m], (2, 3). cop: centre
    of pressure in the foot frame [m], nan if the feet carry no load.
    """

    pose: Array
    head: float
    target: float
    force: Array
    point: Array
    cop: float


class Session:
    """settings, state, history, trail; policy: name of the present one; ramping: 1 up, -1 down, 0 not; fallen, falls;
    time [s]. `paused` and `push_force` [N] may be set."""

    fallen: bool
    history: History
    trail: Trail
    _time_to_restart: float
    _push_steps: int
    _controller: Controller

    def __init__(self, config: PlayConfig, policies: Sequence[PolicyChoice], body: Segments, worker: TheoryWorker) -> None:
        """Start with the first of `policies`, for whose body `body` are the segments. Raises ConfigError if it cannot be
        loaded, or cannot have the body of `config`."""
        self._config, self._policies, self._worker = config, {p.name: p for p in policies}, worker
        self._segments = policies[0].env.body, body
        given: dict[str, Any] = {name: getattr(config, name) for name in SETTINGS if getattr(config, name) is not None}
        own = self._settings_of(policies[0], config.freq)
        self.settings = replace(self._with_body(own, config.body.apply_to(own.body)), **given)
        self._asked_body = self.settings.body
        self._theory = TheoryRequest(worker, least_cost)
        self.paused, self.falls, self.time, self.push_force = False, 0, 0.0, config.push.force
        self._use(policies[0])
        slowest = math.ceil(1 / (config.sliders.freq[0] * self.dt))
        self.history = History(2 * max(config.window_steps, slowest))
        self.reset()

    @torch.no_grad()
    def step(self) -> None:
        """Advance by one control step, unless paused. After a fall the stander lies for a while, then it is reset."""
        if self._asked_body != self.settings.body:
            self._change_body()
        if self.paused:
            return
        self.time += self.dt
        if self.fallen:
            self._time_to_restart -= self.dt
            if self._time_to_restart <= 0:
                self.reset()
            return
        self._advance_ramp()
        self._env.apply(self.settings)
        self._env.sim.push.fill_(self.push_force if self._push_steps > 0 else 0.0)
        self._push_steps = max(0, self._push_steps - 1)
        done = self._env.step(self._controller.act(self._env, self.settings))[2]
        if bool(done):
            # The environment has reset itself; `state` stays the last one before the fall.
            self.fallen, self._time_to_restart, self.ramping = True, FALL_SHOWN_S, 0
            self.falls += 1
            return
        self._read_state()
        self._record()

    def set(self, **values: float) -> None:
        """Change settings; the target's phase is kept. Raises ValueError outside the range of a slider."""
        for name, value in values.items():
            low, high, _ = self.slider(name)
            if not low <= value <= high:
                raise ValueError(f"{name} = {value:g}: allowed is {low:g}..{high:g}")
        if "freq" in values:
            self.ramping = 0
        changes: dict[str, Any] = values
        self.settings = replace(self.settings, **changes)

    def set_body(self, body: Person | None) -> None:
        """Have another body from the next step on, upright and at rest, with joints scaled to it; None: the paper's.

        Raises ConfigError if such joints are not allowed; then nothing changes.
        """
        self._policies[self.policy].env_with(body)
        self._asked_body = body

    @property
    def body(self) -> Person | None:
        """The body from the next step on."""
        return self._asked_body

    def slider(self, name: str) -> tuple[float, float, float]:
        """From, to and step of the slider of a setting, with the present body."""
        return self._config.sliders.for_body(name, self.settings.body)

    def ramp(self, direction: int) -> None:
        """Raise (1) or lower (-1) the frequency at `ramp_rate` up to the end of its slider; the same again stops it."""
        self.ramping = 0 if self.ramping == direction or self.fallen else direction

    def push(self) -> None:
        """Push the trunk forward from the next step on."""
        self._push_steps = max(1, round(self._config.push.duration / self.dt))

    @torch.no_grad()
    def reset(self) -> None:
        """Stand upright and at rest, with the target at its rear end. Settings stay; history and trail are cleared."""
        self.ramping, self.fallen, self._time_to_restart, self._push_steps = 0, False, 0.0, 0
        self.trail = Trail()
        self._env.reset_all()
        self._controller.reset()
        self.history.clear()
        self._read_state()

    @torch.no_grad()
    def choose(self, name: str) -> None:
        """Continue with another policy, with the body that the policy was made for, and from the present state if it has the
        present body and control step.

        Raises ConfigError if it cannot be loaded; then nothing changes.
        """
        previous, before, choice = self._env, self.__dict__.copy(), self._policies[name]
        try:
            self.settings = self._settings_of(choice, self.settings.freq)
            self._asked_body = self.settings.body
            self._use(choice)
            config = self._env.config
            if (config.body, config.control_dt) == (previous.config.body, previous.config.control_dt):
                self._env.continue_from(previous)
                self._env.apply(self.settings)
            else:
                self.reset()
        except Exception:
            self.__dict__.update(before)
            raise

    @property
    def policies(self) -> tuple[str, ...]:
        """Names of the policies that can be chosen."""
        return tuple(self._policies)

    @property
    def dt(self) -> float:
        """A control step [s]."""
        return self._env.config.control_dt

    @property
    def sole(self) -> tuple[float, float]:
        """Ends of the sole, the bounds of the centre of pressure, in the foot frame [m]."""
        return self._env.sim.geometry.heel_x, self._env.sim.geometry.toe_x

    @property
    def load_at(self) -> tuple[float, float] | None:
        """See `EnvConfig.load_at`."""
        return self._env.config.load_at

    @property
    def message(self) -> str:
        """The controller's message, or which settings the policy was not trained on; empty if there is nothing to say."""
        names = self._policies[self.policy].not_trained_on(self.settings)
        unmet = ", ".join(SETTINGS.get(name, name).partition(" [")[0] for name in names)
        return self._controller.message or (f"outside what this policy was trained on: {unmet}" if names else "")

    @property
    def foot_drift(self) -> float:
        """How far forward the feet have moved [m]."""
        return self._env.foot_drift

    def measures(self) -> Measures:
        """Mode, cost and tracking over the window that ends now."""
        still = math.radians(self._config.evaluation.still_joint_deg)
        return measure(self.history, self.dt, self._config.window_steps, still, self.settings.tolerance)

    def theory(self) -> LeastCost | None:
        """The torque-optimal stander with these settings; None while it is being computed."""
        low, high, _ = self._config.sliders.freq
        freqs = np.linspace(low, high, self._config.theory_freqs)
        env, tolerance = self.settings.apply_to(self._env.config), self.settings.tolerance
        if not self._theory.ready((env, tolerance), self._segments[1], env, tolerance, freqs):
            return None
        if isinstance(self._theory.result, Exception):
            raise self._theory.result
        return self._theory.result

    def _settings_of(self, choice: PolicyChoice, freq: float) -> Settings:
        """The body, amplitude and tolerance that a policy was trained with, within the ranges of the sliders."""
        values: dict[str, Any] = {name: getattr(choice.env, name) for name in ("hip_k", "ankle_k", "load", "amplitude")}
        trained = choice.run.env.head_tolerance if choice.run else None
        values["tolerance"] = self._config.evaluation.tolerance if trained is None else trained
        return self._within_sliders(Settings(freq, **values, body=choice.env.body))

    def _within_sliders(self, settings: Settings) -> Settings:
        """`settings` with each value but the frequency within the range of its slider."""
        ranges = {name: self._config.sliders.for_body(name, settings.body)[:2] for name in SETTINGS if name != "freq"}
        values: dict[str, Any] = {name: float(np.clip(getattr(settings, name), *ends)) for name, ends in ranges.items()}
        return replace(settings, **values)

    def _with_body(self, settings: Settings, body: Person | None) -> Settings:
        """`settings` with another body, and stiffness scaled to it."""
        if body == settings.body:
            return settings
        ratio = {name: factor(name, body) / factor(name, settings.body) for name in STIFFNESS}
        scaled: dict[str, Any] = {name: getattr(settings, name) * ratio[name] for name in STIFFNESS}
        return self._within_sliders(replace(settings, **scaled, body=body))

    def _change_body(self) -> None:
        self.settings = self._with_body(self.settings, self._asked_body)
        choice, controller = self._policies[self.policy], self._controller
        self._use(choice, None if choice.model is None else controller)
        self.reset()

    def _use(self, choice: PolicyChoice, controller: Controller | None = None) -> None:
        """Make the environment of `choice`, with the body of the settings, and its controller, unless that is given."""
        env = choice.env_with(self.settings.body)
        if self._segments[0] != env.body:
            self._segments = env.body, read_segments(env)
        self._env = PlayEnv(env, self.settings)
        self._controller = controller or choice.load(self._config.lqr, self._worker, self._segments[1])
        self.policy = choice.name

    def _advance_ramp(self) -> None:
        if not self.ramping:
            return
        low, high, _ = self._config.sliders.freq
        freq = self.settings.freq + self.ramping * self._config.ramp_rate * self.dt
        self.settings = replace(self.settings, freq=min(max(freq, low), high))
        if not low < freq < high:
            self.ramping = 0

    def _read_state(self) -> None:
        env = self._env
        pose = env.sim.body_pose[0].numpy().astype(np.float64)
        force = env.sim.sole_force[0].numpy().astype(np.float64)
        end = env.sim.sole_position[0].numpy().astype(np.float64)
        load = force[..., 2]
        share = load / np.maximum(load.sum(1, keepdims=True), MIN_LOAD_N)
        local = (share[..., None] * end).sum(1)
        self.state = State(
            pose=pose,
            head=float(env.state.head_x),
            target=float(env.state.target_x),
            force=force.sum(1),
            point=np.stack([pose[foot, :3] + _rotate(pose[foot, 3:], local[side]) for side, foot in enumerate(FEET)]),
            cop=float(local[:, 0] @ load.sum(1) / load.sum()) if load.sum() > MIN_LOAD_N else math.nan,
        )

    def _record(self) -> None:
        joint, state = self._env.sim.joint_angle[0], self.state
        hip, ankle = (float(joint[kind].mean()) for kind in (HIPS, ANKLES))
        cost = float((self._env.state.action**2).sum())
        self.history.append(self.time, self.settings.freq, hip, ankle, state.target, state.head, state.cop, cost)
        if int(self.time / TRAIL_EVERY_S) != int((self.time - self.dt) / TRAIL_EVERY_S):
            self.trail.add(self.measures(), self.ramping)


def _rotate(quaternion: Array, vector: Array) -> Array:
    """`vector` (3,) rotated by `quaternion` x y z w (4,)."""
    axis, w = quaternion[:3], quaternion[3]
    twice = 2.0 * np.cross(axis, vector)
    return np.asarray(vector + w * twice + np.cross(axis, twice))
