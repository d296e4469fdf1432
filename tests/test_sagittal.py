"""The sagittal engine against MuJoCo's C solver in double precision, against the spatial engine, and against mechanics."""

import math
from dataclasses import dataclass
from types import SimpleNamespace

import mujoco
import numpy as np
import pytest
import torch

from envs.body import BODIES, FEET, JOINTS
from envs.sagittal import SagittalSimulation
from envs.segments import segments
from envs.simulation import simulate
from envs.spatial import SpatialSimulation
from tests.mujoco_c import MujocoC

GRAVITY = 9.81
HIP, ANKLE = (-0.01, -0.465), (0.0, -0.713)
"""Hip from the HAT's frame, ankle from the hip [m], as in humanoid.xml."""
ENDS = ((-0.06, -0.098), (0.13, -0.098))
"""Centres of the balls at heel and toe from the ankle [m], same source."""
RADIUS = 0.01
SHOWN = ("joint_angle", "joint_velocity", "joint_force", "body_pose", "body_velocity", "sole_force", "sole_position")


def turned(v, pitch):
    """Vectors (x, z) of a body that leans forward by `pitch` [rad]."""
    return np.stack([v[0] * np.cos(pitch) + v[1] * np.sin(pitch), v[1] * np.cos(pitch) - v[0] * np.sin(pitch)], -1)


def above(gap, hat, leg, foot):
    """Planar coordinates with these pitches [rad], the lower end of the sole `gap` [m] above the ground."""
    hat, leg, foot = (np.asarray(pitch, dtype=float) for pitch in (hat, leg, foot))
    lower = np.minimum(*(turned(end, foot)[..., 1] for end in ENDS))
    z = gap + RADIUS - lower - turned(HIP, hat)[..., 1] - turned(ANKLE, leg)[..., 1]
    return np.stack([np.zeros_like(z), z, hat, leg, foot], -1)


def still_feet(q, hat, leg):
    """Planar velocities with these pitch rates [rad/s] and the foot at rest."""
    hip, ankle = turned(HIP, q[2]), turned(ANKLE, q[3])
    return np.array([-hat * hip[1] - leg * ankle[1], hat * hip[0] + leg * ankle[0], hat, leg, 0.0])


def placed(sim, q, qd):
    """The simulation with its worlds at these planar coordinates and velocities."""
    q, qd = (torch.as_tensor(np.atleast_2d(value), dtype=torch.float32) for value in (q, qd))
    if isinstance(sim, SagittalSimulation):
        sim._q[:], sim._qd[:] = q, qd
        sim._place()
        return sim
    # Newton: quaternion x y z w, velocity of the centre of mass.
    at, speed = sim._joint_q.zero_(), sim._joint_qd.zero_()
    pitch, (x, _, z) = q[:, 2], sim.geometry.hat_com
    at[:, 0], at[:, 2], at[:, 4], at[:, 6] = q[:, 0], q[:, 1], torch.sin(pitch / 2), torch.cos(pitch / 2)
    at[:, 7:] = torch.stack([q[:, 3] - q[:, 2], q[:, 4] - q[:, 3]] * 2, -1)
    speed[:, 0] = qd[:, 0] + qd[:, 2] * (z * torch.cos(pitch) - x * torch.sin(pitch))
    speed[:, 2] = qd[:, 1] - qd[:, 2] * (x * torch.cos(pitch) + z * torch.sin(pitch))
    speed[:, 4] = qd[:, 2]
    speed[:, 6:] = torch.stack([qd[:, 3] - qd[:, 2], qd[:, 4] - qd[:, 3]] * 2, -1)
    return sim


def both_sides(hip_ankle):
    """Torques of hip and ankle (..., 2) for left and right."""
    return torch.as_tensor(np.asarray(hip_ankle), dtype=torch.float32).tile(2)


def seen(sim):
    return {name: getattr(sim, name).numpy().copy() for name in SHOWN}


def finite(sim):
    return all(bool(getattr(sim, name).isfinite().all()) for name in SHOWN)


def modified(config, **solver):
    """The configuration with other numbers of the solver."""
    return config.model_copy(update={"solver": config.solver.model_copy(update=solver)})


def random_states(rng, worlds, pitch, speed, gap):
    """Planar states: pitches within +-`pitch` [rad], velocities of size `speed`, the sole at `gap` = (low, high) [m]."""
    q = above(rng.uniform(*gap, worlds), *rng.uniform(-pitch, pitch, (3, worlds)))
    q[:, 0] = rng.uniform(-1, 1, worlds)
    return q.astype(np.float32), rng.normal(0, speed, (worlds, 5)).astype(np.float32)


# -- against the references ------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Trial:
    """A motion from planar state q, qd under torques of hip and ankle [Nm]: `push` plus up to `sway` at random, anew each
    control step. `rounding`: how much more than others it makes of rounding errors."""

    q: np.ndarray
    qd: np.ndarray | tuple[float, ...] = (0, 0, 0, 0, 0)
    push: tuple[float, float] = (0.0, 0.0)
    sway: tuple[float, float] = (0.0, 0.0)
    friction: float = 1.0
    hip_k: float = 125.0
    ankle_k: float = 25.0
    load: float = 0.0
    rounding: float = 1.0


STEPS = 30
PRESSED = -5e-4  # at a bare touch rounding would decide whether there is a contact
FLAT = above(PRESSED, 0.0, 0.0, 0.0)
SWUNG = above(PRESSED, 0.15, -0.05, 0.0)
TRIALS = {
    "flight": Trial(above(2.0, 0.3, -0.2, 0.1), (0.5, 1, 2, -1, 3), sway=(40, 15)),
    "standing": Trial(FLAT),
    "swaying": Trial(FLAT, sway=(15, 8)),
    "swinging": Trial(SWUNG, still_feet(SWUNG, -1.0, 0.6), sway=(40, 8)),
    "over the toe": Trial(FLAT, still_feet(FLAT, 0.6, 0.9), push=(0, 30), sway=(5, 3)),
    "over the heel": Trial(FLAT, still_feet(FLAT, -0.6, -0.9), push=(0, -25), sway=(5, 3)),
    "sliding": Trial(FLAT, (0.6, 0, 0, 0, 0), sway=(10, 5)),
    "on ice": Trial(FLAT, (0.6, 0, 0, 0, 0), sway=(10, 5), friction=0.2),
    "swinging on ice": Trial(SWUNG, still_feet(SWUNG, -1.0, 0.6), sway=(40, 8), friction=0.2),
    "landing": Trial(above(0.05, 0.05, -0.05, 0.05), (0.2, -0.5, 0.1, 0.1, 0.1), sway=(15, 8)),
    "landing on ice": Trial(above(0.05, 0.05, -0.05, 0.05), (0.2, -0.5, 0.1, 0.1, 0.1), sway=(15, 8), friction=0.2),
    "hip bent": Trial(above(0.5, 1.2, -0.85, -0.8), (0, 0, 1.5, -1.5, -1.5), (-150, 0), (20, 5)),
    "hip stretched": Trial(above(0.5, -0.3, 0.45, 0.4), (0, 0, -1, 1, 1), (120, 0), (20, 5)),
    "ankle bent": Trial(above(0.5, 0.0, 0.2, -0.65), (0, 0, 0, 1, -2), (0, -40), (10, 5)),
    "ankle stretched": Trial(above(0.5, 0.0, -0.2, 0.65), (0, 0, 0, -1, 2), (0, 40), (10, 5)),
    "squatting": Trial(above(PRESSED, 1.1, -0.95, -0.2), (0, 0, 0.5, -0.5, -0.1), (-150, -20), (20, 5)),
    "soft hips": Trial(FLAT, sway=(15, 8), hip_k=50.0),
    "soft ankles": Trial(FLAT, sway=(15, 8), ankle_k=10.0),
    "loaded": Trial(FLAT, sway=(15, 8), load=4.0),
}


@pytest.fixture(scope="module")
def played(config):
    """Every trial in the sagittal engine, in the spatial one and in MuJoCo's C: {trial: {engine: {name: (steps, ...)}}}."""
    rng, found = np.random.default_rng(1), {}
    for friction in sorted({trial.friction for trial in TRIALS.values()}):
        names = [name for name, trial in TRIALS.items() if trial.friction == friction]
        trials = [TRIALS[name] for name in names]
        rough = config.model_copy(update={"friction": friction})
        push = [[trial.push + rng.uniform(-1, 1, 2) * trial.sway for trial in trials] for _ in range(STEPS)]
        torque = both_sides(push)
        subject = {key: torch.tensor([getattr(trial, key) for trial in trials]) for key in ("hip_k", "ankle_k", "load")}
        engines = {}
        for engine, make in (("sagittal", SagittalSimulation), ("spatial", SpatialSimulation)):
            sim = make(rough, len(trials), "cpu")
            sim.set_subject(**subject)
            placed(sim, [trial.q for trial in trials], [trial.qd for trial in trials])
            history = []
            for step in torque:
                sim.step(step)
                history.append(seen(sim))
            sim.check_capacity()
            engines[engine] = {key: np.stack([shown[key] for shown in history], 1) for key in SHOWN}
        for i, (name, trial) in enumerate(zip(names, trials, strict=True)):
            own = rough.model_copy(update={key: getattr(trial, key) for key in subject})
            reference, history = MujocoC(own), []
            reference.place(np.float32(trial.q).astype(float), np.float32(trial.qd).astype(float))
            for step in torque[:, i]:
                reference.step(step, config.solver.substeps)
                history.append(reference.read())
            exact = {key: np.stack([shown[key] for shown in history]) for key in SHOWN}
            found[name] = {engine: {key: shown[key][i] for key in SHOWN} for engine, shown in engines.items()} | {"c": exact}
    return found


def deviation(ours, theirs):
    """Largest difference of each quantity; the place of a force where there is one."""
    differences = {name: np.abs(ours[name] - theirs[name]) for name in SHOWN}
    differences["sole_position"] *= (np.abs(theirs["sole_force"]).max(-1) > 1e-3)[..., None]
    return {name: float(difference.max()) for name, difference in differences.items()}
