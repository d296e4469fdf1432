"""One stander to play with: knobs in, state out, a control step at a time. Knows neither browser nor clock."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import torch

from envs.body.joints import ANKLES, BODIES, HIPS
from envs.body.segments import Segments
from posture.analysis.trajectory import Array
from posture.config.play import KNOBS, PlayConfig
from posture.evaluation.rollout import MIN_LOAD_N
from posture.play.history import History
from posture.play.knobs import Knobs
from posture.play.measures import Measures, Trail, measure
from posture.play.pilot import Candidate, Pilot, board
from posture.play.push import Pusher
from posture.play.steered import SteeredEnv
from posture.play.theory import Asked, Least, Office, least

LYING_S = 1.5
"""[s] a fall is shown before the next start."""
TRAIL_EVERY_S = 0.25
FEET = [BODIES.index(name) for name in ("foot_left", "foot_right")]


@dataclass(frozen=True, eq=False)
class State:
    """What is seen of one moment.

    pose: frames of `envs.body.joints.BODIES`, position [m] and quaternion x y z w, (5, 7). head, target: along x [m].
    force: of the
    ground on left and right foot [N], (2, 3); at: where it acts in the world [m], (2, 3). cop: centre of pressure in the
    foot's frame [m], nan without load.
    """

    pose: Array
    head: float
    target: float
    force: Array
    at: Array
    cop: float


class Session:
    """Attributes to read: knobs, state, history, trail, ramping (1 up, -1 down, 0 not), fallen, falls, time [s], note.

    paused and force, that of a push [N], may be set.
    """

    fallen: bool
    history: History
    trail: Trail
    _lying: float
    _pushed: int
    _pilot: Pilot

    def __init__(self, config: PlayConfig, pilots: Sequence[Candidate], body: Segments, office: Office) -> None:
        """The first of `pilots` begins. Raises ConfigError where it cannot be loaded."""
        self._config, self._pilots, self._body, self._office = config, {c.name: c for c in pilots}, body, office
        self._ranges = {name: getattr(config.sliders, name) for name in KNOBS}
        first = pilots[0]
        self.knobs = self._as_trained(first, config.freq)
        given = {name: getattr(config, name) for name in KNOBS if getattr(config, name) is not None}
        self.knobs = replace(self.knobs, **given)
        self._theory = Asked(office, least)
        self.paused, self.falls, self.time, self.force = False, 0, 0.0, config.push.force
        self._start(first)
        self.reset()

    # -- what happens to it ------------------------------------------------------------------------------------------

    @torch.no_grad()
    def step(self) -> None:
        """One control step; none while paused. After a fall it lies for a while, and then stands upright again."""
        if self.paused:
            return
        self.time += self.dt
        if self.fallen:
            self._lying -= self.dt
            if self._lying <= 0:
                self.reset()
            return
        self._ramp()
        self._env.turn(self.knobs)
        if self._pushed > 0:
            self._pusher.push(self._env, self.force * self.dt)
            self._pushed -= 1
        done = self._env.step(self._pilot.act(self._env, self.knobs))[2]
        if bool(done):
            # The environment stands upright again; what is shown stays what was last before the fall.
            self.fallen, self._lying, self.ramping = True, LYING_S, 0
            self.falls += 1
            return
        self._look()
        self._remember()

    def set(self, **values: float) -> None:
        """Turn knobs; the target's phase is kept. Raises ValueError beyond the range of a slider."""
        for name, value in values.items():
            low, high, _ = self._ranges[name]
            if not low <= value <= high:
                raise ValueError(f"{name} = {value:g}: allowed is {low:g}..{high:g}")
        if "freq" in values:
            self.ramping = 0
        self.knobs = replace(self.knobs, **values)

    def ramp(self, direction: int) -> None:
        """Let the frequency rise (1) or fall (-1) by `ramp_rate`, to the end of its slider; again: hold it."""
        self.ramping = 0 if self.ramping == direction or self.fallen else direction

    def push(self) -> None:
        """Push the trunk forward, from the next step on."""
        self._pushed = max(1, round(self._config.push.duration / self.dt))

    @torch.no_grad()
    def reset(self) -> None:
        """Stand upright and at rest, target at its rear end; the knobs stay. What was measured is forgotten."""
        self.ramping, self.fallen, self._lying, self._pushed = 0, False, 0.0, 0
        self.trail = Trail()
        self._env.reset_all()
        self._pilot = self._boarded()
        self.history.clear()
        self._look()

    @torch.no_grad()
    def choose(self, name: str) -> None:
        """Let another pilot go on from here, with the body that it was made for. Raises ConfigError, and all stays."""
        before, candidate = self._env, self._pilots[name]
        kept = self.__dict__.copy()
        self.knobs = self._as_trained(candidate, self.knobs.freq)
        try:
            self._start(candidate)
        except Exception:
            self.__dict__.update(kept)
            raise
        self._env.take_over(before)
        self._env.turn(self.knobs)

    # -- what can be read --------------------------------------------------------------------------------------------

    @property
    def dt(self) -> float:
        """A control step [s]."""
        return self._env.config.control_dt

    @property
    def sole(self) -> tuple[float, float]:
        """Ends of the sole, which bound the centre of pressure, in the foot's frame [m]."""
        return self._env.sim.geometry.heel_x, self._env.sim.geometry.toe_x

    @property
    def note(self) -> str:
        """What the pilot has to say; empty: nothing."""
        return self._pilot.note

    @property
    def crept(self) -> float:
        """How far forward the feet have moved [m]."""
        return self._env.crept

    def measures(self) -> Measures:
        """Mode, cost and tracking of late."""
        still = math.radians(self._config.evaluation.still_joint_deg)
        return measure(self.history, self.dt, self._config.window_steps, still, self.knobs.tolerance)

    def theory(self) -> Least | None:
        """The torque-optimal stander with these knobs; None while it is being computed."""
        low, high, _ = self._ranges["freq"]
        freqs = np.linspace(low, high, self._config.theory_freqs)
        known = self._theory.about(
            self.knobs.subject, self._body, self.knobs.env(self._env.config), self.knobs.tolerance, freqs
        )
        if known and isinstance(self._theory.answer, Exception):
            raise self._theory.answer
        return self._theory.answer if known else None

    # -- inside ------------------------------------------------------------------------------------------------------

    def _as_trained(self, candidate: Candidate, freq: float) -> Knobs:
        env = candidate.env
        values: dict[str, Any] = {name: getattr(env, name) for name in ("hip_k", "ankle_k", "load", "amplitude")}
        trained = candidate.run.env.termination.head_tolerance if candidate.run else None
        values["tolerance"] = self._config.evaluation.tolerance if trained is None else trained
        # A slider cannot show what lies beyond its ends.
        return Knobs(freq=freq, **{name: float(np.clip(value, *self._ranges[name][:2])) for name, value in values.items()})

    def _start(self, candidate: Candidate) -> None:
        self.pilot = candidate.name
        self._env = SteeredEnv(candidate.env, self.knobs)
        self._pusher = Pusher(candidate.env)
        self._pilot = self._boarded()
        low = self._ranges["freq"][0]
        if not hasattr(self, "history"):
            self.history = History(2 * max(self._config.window_steps, math.ceil(1 / (low * self.dt))))

    def _boarded(self) -> Pilot:
        return board(self._pilots[self.pilot], self._env, self._config.lqr, self._office, self._body)

    def _ramp(self) -> None:
        if not self.ramping:
            return
        low, high, _ = self._ranges["freq"]
        freq = self.knobs.freq + self.ramping * self._config.ramp_rate * self.dt
        self.knobs = replace(self.knobs, freq=min(max(freq, low), high))
        if not low < freq < high:
            self.ramping = 0

    def _look(self) -> None:
        env = self._env
        pose = env.sim.body_pose[0].numpy().astype(np.float64)
        force = env.sim.sole_force[0].numpy().astype(np.float64)
        place = env.sim.sole_position[0].numpy().astype(np.float64)
        load = force[..., 2]
        loaded = load.sum() > MIN_LOAD_N
        share = load / np.maximum(load.sum(1, keepdims=True), MIN_LOAD_N)
        local = (share[..., None] * place).sum(1)
        at = np.stack([pose[foot, :3] + _turned(pose[foot, 3:], local[side]) for side, foot in enumerate(FEET)])
        self.state = State(
            pose=pose,
            head=float(env.head_x),
            target=float(env.target_x),
            force=force.sum(1),
            at=at,
            cop=float(local[:, 0] @ load.sum(1) / load.sum()) if loaded else math.nan,
        )

    def _remember(self) -> None:
        joint, state = self._env.sim.joint_angle[0], self.state
        hip, ankle = (float(joint[kind].mean()) for kind in (HIPS, ANKLES))
        cost = float((self._env.action**2).sum())
        self.history.append(self.time, self.knobs.freq, hip, ankle, state.target, state.head, state.cop, cost)
        if int(self.time / TRAIL_EVERY_S) != int((self.time - self.dt) / TRAIL_EVERY_S):
            self.trail.add(self.measures(), self.ramping)


def _turned(quaternion: Array, vector: Array) -> Array:
    """`vector` (3,) turned by `quaternion` x y z w (4,)."""
    axis, w = quaternion[:3], quaternion[3]
    twice = 2.0 * np.cross(axis, vector)
    return np.asarray(vector + w * twice + np.cross(axis, twice))
