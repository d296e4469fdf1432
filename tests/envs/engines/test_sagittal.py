"""The sagittal engine against MuJoCo's C solver in double precision, against SolverMuJoCo, and against mechanics."""

import math
from dataclasses import dataclass
from types import SimpleNamespace

import mujoco
import numpy as np
import pytest
import torch

from envs.body.joints import BODIES, JOINTS
from envs.body.segments import segments
from envs.engines.factory import simulate
from envs.engines.interface import top_speed
from envs.engines.newton_mujoco import NewtonMujocoSimulation
from envs.engines.sagittal import SagittalSimulation
from tests.mujoco_c import MujocoC

GRAVITY = 9.81
HIP, ANKLE = (-0.01, -0.465), (0.0, -0.713)
"""Hip from the HAT's frame, ankle from the hip [m], as in humanoid.xml."""
ENDS = ((-0.06, -0.098), (0.13, -0.098))
"""Centres of the balls at heel and toe from the ankle [m], same source."""
RADIUS = 0.01
OUTPUTS = ("joint_angle", "joint_velocity", "joint_force", "body_pose", "body_velocity", "sole_force", "sole_position")


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
        sim._write_outputs()
        return sim
    # Newton: quaternion x y z w, velocity of the centre of mass.
    at, speed = sim._joint_q.zero_(), sim._joint_qd.zero_()
    pitch, (x, _, z) = q[:, 2], torch.from_numpy(sim.model.body_com.numpy()[:: len(BODIES)]).T
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
    return {name: getattr(sim, name).numpy().copy() for name in OUTPUTS}


def finite(sim):
    return all(bool(getattr(sim, name).isfinite().all()) for name in OUTPUTS)


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
    load_at: tuple[float, float] | None = None
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
    "over the toe": Trial(FLAT, still_feet(FLAT, 0.6, 0.9), push=(0, 30), sway=(5, 3), rounding=3),
    "over the heel": Trial(FLAT, still_feet(FLAT, -0.6, -0.9), push=(0, -25), sway=(5, 3), rounding=3),
    "stopped short": Trial(FLAT, (0.6, 0, 0, 0, 0), sway=(10, 5)),
    "on ice": Trial(FLAT, (0.6, 0, 0, 0, 0), sway=(10, 5), friction=0.2, rounding=5),
    "swinging on ice": Trial(SWUNG, still_feet(SWUNG, -1.0, 0.6), sway=(40, 8), friction=0.2, rounding=5),
    "landing": Trial(above(0.05, 0.05, -0.05, 0.05), (0.2, -0.5, 0.1, 0.1, 0.1), sway=(15, 8)),
    "landing on ice": Trial(
        above(0.05, 0.05, -0.05, 0.05), (0.8, -0.5, 0.1, 0.1, 0.1), sway=(15, 8), friction=0.2, rounding=6
    ),
    "hip bent": Trial(above(0.5, 1.2, -0.85, -0.8), (0, 0, 1.5, -1.5, -1.5), (-150, 0), (20, 5), rounding=6),
    "hip stretched": Trial(above(0.5, -0.3, 0.45, 0.4), (0, 0, -1, 1, 1), (120, 0), (20, 5), rounding=6),
    "ankle bent": Trial(above(0.5, 0.0, 0.2, -0.65), (0, 0, 0, 1, -2), (0, -40), (10, 5)),
    "ankle stretched": Trial(above(0.5, 0.0, -0.2, 0.65), (0, 0, 0, -1, 2), (0, 40), (10, 5), rounding=3),
    "squatting": Trial(above(PRESSED, 1.1, -0.95, -0.2), (0, 0, 0.5, -0.5, -0.1), (-150, -20), (20, 5), rounding=3),
    "soft hips": Trial(FLAT, sway=(15, 8), hip_k=50.0),
    "soft ankles": Trial(FLAT, sway=(15, 8), ankle_k=10.0),
    "loaded": Trial(FLAT, sway=(15, 8), load=4.0),
    "loaded behind": Trial(FLAT, sway=(15, 8), load=8.0, load_at=(-0.2, 0.1)),
    "loaded in flight": Trial(above(2.0, 0.3, -0.2, 0.1), (0.5, 1, 2, -1, 3), sway=(40, 15), load=8.0, load_at=(-0.2, 0.1)),
}


@pytest.fixture(scope="module", params=[False, True], ids=["contacts of MuJoCo", "contact bias"])
def either(config, request):
    """The configuration with MuJoCo's own contacts, and with their bias acceleration."""
    return modified(config, contact_bias=request.param)


@pytest.fixture(scope="module")
def played(either):
    """Every trial in the sagittal engine, in SolverMuJoCo and in MuJoCo's C: {trial: {engine: {name: (steps, ...)}}}."""
    found = {}
    for friction, load_at in dict.fromkeys((trial.friction, trial.load_at) for trial in TRIALS.values()):
        names = [name for name, trial in TRIALS.items() if (trial.friction, trial.load_at) == (friction, load_at)]
        trials = [TRIALS[name] for name in names]
        rough = either.model_copy(update={"friction": friction, "load_at": load_at})
        sways = [np.random.default_rng([1, *name.encode()]).uniform(-1, 1, (STEPS, 2)) for name in names]
        push = [trial.push + sway * trial.sway for trial, sway in zip(trials, sways, strict=True)]
        torque = both_sides(np.stack(push, 1))
        subject = {key: torch.tensor([getattr(trial, key) for trial in trials]) for key in ("hip_k", "ankle_k", "load")}
        engines = {}
        for engine, make in (("sagittal", SagittalSimulation), ("newton", NewtonMujocoSimulation)):
            sim = make(rough, len(trials), "cpu")
            sim.set_subject(**subject)
            placed(sim, [trial.q for trial in trials], [trial.qd for trial in trials])
            history = []
            for step in torque:
                sim.step(step)
                history.append(seen(sim))
            sim.check_capacity()
            engines[engine] = {key: np.stack([outputs[key] for outputs in history], 1) for key in OUTPUTS}
        for i, (name, trial) in enumerate(zip(names, trials, strict=True)):
            own = rough.model_copy(update={key: getattr(trial, key) for key in subject})
            reference, history = MujocoC(own), []
            reference.place(np.float32(trial.q).astype(float), np.float32(trial.qd).astype(float))
            for step in torque[:, i]:
                reference.step(step, either.solver.substeps)
                history.append(reference.read())
            exact = {key: np.stack([outputs[key] for outputs in history]) for key in OUTPUTS}
            found[name] = {engine: {key: outputs[key][i] for key in OUTPUTS} for engine, outputs in engines.items()} | {
                "c": exact
            }
    return found


def deviation(ours, theirs):
    """Largest difference of each quantity; the place of a force where there is one."""
    differences = {name: np.abs(ours[name] - theirs[name]) for name in OUTPUTS}
    differences["sole_position"] *= (np.abs(theirs["sole_force"]).max(-1) > 1e-3)[..., None]
    return {name: float(difference.max()) for name, difference in differences.items()}


C_AGREES = {
    "joint_angle": 1.5e-6,
    "joint_velocity": 6e-5,
    "joint_force": 1.5e-4,
    "body_pose": 1.5e-6,
    "body_velocity": 6e-5,
    "sole_force": 0.03,
    "sole_position": 4e-7,
}
NEWTON_AGREES = {
    "joint_angle": 5e-6,
    "joint_velocity": 1e-4,
    "joint_force": 6e-4,
    "body_pose": 1e-5,
    "body_velocity": 1e-4,
    "sole_force": 0.06,
    "sole_position": 2e-6,
}
"""Largest differences over half a second [rad, rad/s, Nm, m, m/s, N], two to four times those measured."""


@pytest.mark.parametrize("name", TRIALS)
def test_agrees_with_mujoco_c(played, name):
    """The equations are the same; the differences are of single precision, 1e-7 to 1e-6 rad where nothing amplifies them."""
    found = deviation(played[name]["sagittal"], played[name]["c"])
    assert not {key: value for key, value in found.items() if value > C_AGREES[key] * TRIALS[name].rounding}


@pytest.mark.parametrize("name", TRIALS)
def test_agrees_with_newton_mujoco(played, name):
    """Both in single precision, in different coordinates."""
    found = deviation(played[name]["sagittal"], played[name]["newton"])
    assert not {key: found[key] for key, value in NEWTON_AGREES.items() if found[key] > value * TRIALS[name].rounding}


def test_trials_are_what_their_names_say(played):
    """By MuJoCo's C: contacts, slip, the pitch that the foot comes to, and joints beyond their limits."""
    outputs = {
        name: SimpleNamespace(
            hip=engines["c"]["joint_angle"][:, 0],
            ankle=engines["c"]["joint_angle"][:, 1],
            foot=2 * np.arcsin(engines["c"]["body_pose"][-1, 2, 4]),
            heel=engines["c"]["sole_force"][:, 0, 0],
            toe=engines["c"]["sole_force"][:, 0, 1],
        )
        for name, engines in played.items()
    }
    assert not np.any(outputs["flight"].heel) and not np.any(outputs["flight"].toe)
    for name in ("standing", "swaying", "swinging", "stopped short", "soft hips", "soft ankles", "loaded", "loaded behind"):
        assert min(outputs[name].heel[:, 2].min(), outputs[name].toe[:, 2].min()) > 0.0, name
    assert outputs["over the toe"].foot > 0.5 and not outputs["over the toe"].heel[-10:].any()
    assert outputs["over the heel"].foot < -0.5 and not outputs["over the heel"].toe[-10:].any()
    for name in ("on ice", "swinging on ice", "landing on ice"):
        total = outputs[name].heel + outputs[name].toe
        assert np.sum(np.abs(total[:, 0]) > 0.199 * total[:, 2]) > 3, name
    assert outputs["landing"].heel[0, 2] == 0.0 and outputs["landing"].toe[:, 2].max() > 500.0
    assert outputs["hip bent"].hip.min() < math.radians(-121) and outputs["hip stretched"].hip.max() > math.radians(45.5)
    assert outputs["ankle bent"].ankle.min() < math.radians(-51) and outputs["ankle stretched"].ankle.max() > math.radians(
        51
    )
    assert outputs["squatting"].ankle.min() < math.radians(-51) and outputs["squatting"].heel.any()


STATES = {
    "standing": (0.15, 0.5, (-0.002, 0.001), 20.0),
    "falling": (0.8, 2.0, (-0.003, 0.001), 60.0),
    "tumbling": (3.1, 10.0, (-0.02, 0.005), 200.0),
    "buried": (3.1, 30.0, (-0.5, 0.005), 1000.0),
}
"""Pitches up to [rad], size of the velocities [m/s] and [rad/s], gap of the sole [m], size of the torques [Nm]."""


@pytest.mark.parametrize("friction", [0.2, 1.0, 3.0])
@pytest.mark.parametrize("kind", STATES)
def test_one_step_from_random_states_agrees_with_mujoco_c(either, kind, friction):
    """From anywhere, with limits and impacts, one control step. Of the speed and of the force there is, half of the worlds
    differ by less than 2e-6 (friction 0.2: 2e-5), the worst by 1e-4 and 8e-4; the softness of friction, which goes by mu^2,
    divides that."""
    worlds, rng = 600, np.random.default_rng(3)
    pitch, speed, gap, size = STATES[kind]
    rough = either.model_copy(update={"friction": friction})
    q, qd = random_states(rng, worlds, pitch, speed, gap)
    torque = both_sides(rng.normal(0, size, (worlds, 2)))
    sim = placed(SagittalSimulation(rough, worlds, "cpu"), q, qd)
    sim.step(torque)
    reference, history = MujocoC(rough), []
    for world in range(worlds):
        reference.place(q[world].astype(float), qd[world].astype(float))
        reference.step(torque[world], either.solver.substeps)
        history.append(reference.read())
    exact, ours = {key: np.stack([outputs[key] for outputs in history]) for key in OUTPUTS}, seen(sim)
    sound = ~sim.diverged.numpy()
    if not sound.all():  # dug up so fast that it is no motion any more, in MuJoCo as well
        assert kind == "buried" and sound.mean() > 0.95
        speeds = [np.abs(exact[key]).reshape(worlds, -1).max(1) for key in ("joint_velocity", "body_velocity")]
        assert (np.maximum(*speeds)[~sound] > top_speed(rough)).all()
    fast = 1.0 + np.abs(exact["joint_velocity"]).max(1)
    hard = 1.0 + np.abs(exact["sole_force"]).max((1, 2, 3))
    for key, scale, allowed in (("joint_angle", fast, 5e-6), ("joint_velocity", fast, 5e-4), ("sole_force", hard, 2e-3)):
        found = (np.abs(ours[key] - exact[key]).reshape(worlds, -1).max(1) / scale)[sound]
        allowed *= max(1.0, friction**-2)
        assert found.max() < allowed and np.quantile(found, 0.99) < allowed / 5, key


@pytest.mark.parametrize("friction", [0.2, 1.0])
def test_accelerations_minimise_the_cost_of_the_constraints(either, friction):
    """MuJoCo's C has mass matrix, forces and constraint rows of random states; with them the gradient at our accelerations
    is zero but for rounding: 1e-7 of what is summed up in it, and 1e-5 in the first millimetre of depth, with which the
    softness changes."""
    worlds, rng = 300, np.random.default_rng(4)
    single = modified(either, substeps=1).model_copy(update={"friction": friction, "control_dt": 0.0083})
    q, qd = random_states(rng, worlds, 1.5, 3.0, (-0.005, 0.001))
    torque = both_sides(rng.normal(0, 100, (worlds, 2)))
    sim = placed(SagittalSimulation(single, worlds, "cpu"), q, qd)
    sim.step(torque)
    reference = MujocoC(single)
    model, data, inertial = reference.model, reference.data, np.zeros(reference.model.nv)
    relative, pushing = [], 0
    for world in range(worlds):
        reference.place(q[world].astype(float), qd[world].astype(float))
        data.qfrc_applied[reference.dofs] = torque[world]
        mujoco.mj_forward(model, data)
        reference.correct()
        rows = data.efc_J.reshape(data.nefc, model.nv)
        ours = reference.spread(sim._qdd[world].numpy())
        mujoco.mj_mulM(model, data, inertial, ours)
        pushes = -data.efc_D * np.minimum(0.0, rows @ ours - data.efc_aref)
        gradient = inertial - data.qfrc_smooth - rows.T @ pushes
        summed = np.abs(rows.T) @ ((pushes > 0) * data.efc_D * (np.abs(rows) @ np.abs(ours) + np.abs(data.efc_aref)))
        relative.append(np.abs(gradient).max() / (np.abs(inertial) + np.abs(data.qfrc_smooth) + summed).max())
        pushing += bool(pushes.any())
    assert pushing > 200
    assert np.max(relative) < 3e-5 and np.median(relative) < 5e-7


@pytest.mark.parametrize(("friction", "short"), [(0.2, 0.01), (1.0, 0.0)])
def test_ten_iterations_are_enough(config, friction, short):
    """Three hundred give the same, bit for bit, from random states with impacts, slip and limits, and in worlds that sway,
    slip and fall for a second; but at friction 0.2 a few worlds in a thousand would have needed up to fifteen."""
    worlds, rng, ends = 2000, np.random.default_rng(6), []
    q, qd = random_states(rng, worlds, 1.5, 4.0, (-0.01, 0.001))
    torque = both_sides(rng.normal(0, 60, (60, worlds, 2)))
    for iterations in (10, 300):
        sim = SagittalSimulation(
            modified(config, iterations=iterations).model_copy(update={"friction": friction}), 2 * worlds, "cpu"
        )
        sim._q[:worlds], sim._qd[:worlds] = torch.from_numpy(q), torch.from_numpy(qd)
        for push in torque:
            sim.step(push.repeat(2, 1))
        ends.append(seen(sim))
    for key in OUTPUTS:
        assert (ends[0][key] != ends[1][key]).reshape(2 * worlds, -1).any(1).mean() <= short, key


# -- mechanics -------------------------------------------------------------------------------------------------------------


class Mechanics:
    """Energy and momenta by the bodies' masses and inertias, as MuJoCo's C reads them from the file."""

    def __init__(self, config):
        model = MujocoC(config).model
        self.config = config
        self.mass = np.array([model.body(name).mass[0] for name in BODIES])
        self.com = np.array([model.body(name).ipos for name in BODIES])
        turns = np.zeros((len(BODIES), 9))
        for turn, name in zip(turns, BODIES, strict=True):
            mujoco.mju_quat2Mat(turn, model.body(name).iquat)
        inertia = np.array([model.body(name).inertia for name in BODIES])
        self.inertia = (turns.reshape(-1, 3, 3)[:, 1] ** 2 * inertia).sum(1)

    def places(self, sim, world=0):
        """Centres of mass along x and z [m]."""
        pose = sim.body_pose[world].double().numpy()
        pitch = 2 * np.arctan2(pose[:, 4], pose[:, 6])
        return pose[:, [0, 2]] + np.stack([turned(c[[0, 2]], p) for c, p in zip(self.com, pitch, strict=True)])

    def of(self, sim, world=0):
        """Energy of bodies, springs and rotors [J]; momentum along x, z [Ns], about y through the centre of mass [Nms]."""
        outputs = (sim.joint_angle, sim.joint_velocity, sim.body_velocity)
        angle, speed, velocity = (values[world].double().numpy() for values in outputs)
        place, linear, angular = self.places(sim, world), velocity[:, [0, 2]], velocity[:, 4]
        stiffness = np.array([self.config.hip_k, self.config.ankle_k] * 2)
        energy = 0.5 * (self.mass @ (linear**2).sum(1) + self.inertia @ angular**2) + GRAVITY * self.mass @ place[:, 1]
        energy += 0.5 * (stiffness @ angle**2 + self.config.joint_armature * (speed**2).sum())
        momentum = self.mass @ linear
        arm = place - self.mass @ place / self.mass.sum()
        return energy, *momentum, self.mass @ (arm[:, 1] * linear[:, 0] - arm[:, 0] * linear[:, 1]) + self.inertia @ angular


THROWN = above(5.0, 0.3, -0.2, 0.4), (0.5, 2.0, 3.0, -2.0, 4.0)


def history(config, steps, torque=(0.0, 0.0), state=THROWN):
    """Energy and momenta before and after each of so many control steps."""
    meter, sim = Mechanics(config), placed(SagittalSimulation(config, 1, "cpu"), *state)
    found = [meter.of(sim)]
    for _ in range(steps):
        sim.step(both_sides([torque]))
        found.append(meter.of(sim))
    return np.array(found)


STEPPED = (1, 2, 4, 8, 16, 32)


def assert_first_order(errors):
    """They halve with the step, the closer the smaller it is."""
    slopes = -np.diff(np.log2(errors))
    assert np.abs(slopes[-3:] - 1.0).max() < 0.1, slopes


@pytest.fixture(scope="module")
def thrown(config):
    """Energy and momenta of a body without damping, spinning and bending in the air for 0.33 s, for each of STEPPED."""
    free = config.model_copy(update={"joint_damping": 0.0})
    return np.stack([history(modified(free, substeps=substeps), 20) for substeps in STEPPED])


def test_energy_is_conserved_in_flight(thrown):
    """The drift is first order in the step: 11 J of 2466 J at the two substeps of the default, 0.7 J at 32."""
    drift = np.abs(thrown[:, :, 0] - thrown[:, :1, 0]).max(1)
    assert_first_order(drift)
    assert drift[-1] < 1.0


def test_momentum_is_conserved_in_flight(thrown, config):
    """Along x, along z but for m g t, and about the centre of mass: the drift, from the turning masses within a step, is
    first order, and at 32 substeps 0.03 Ns, 0.2 Ns and 0.01 Nms."""
    weight = 40.154 * GRAVITY * config.control_dt * np.arange(thrown.shape[1])
    for kept, allowed in ((thrown[..., 1], 0.04), (thrown[..., 2] + weight, 0.3), (thrown[..., 3], 0.015)):
        drift = np.abs(kept - kept[:, :1]).max(1)
        assert_first_order(drift)
        assert drift[-1] < allowed


def test_joint_torques_do_not_change_momentum(config):
    """Actuators, springs and dampers act between the bodies."""
    found = np.stack([history(modified(config, substeps=substeps), 20, (30.0, -10.0)) for substeps in STEPPED])
    for kept in (found[..., 1], found[..., 3]):
        assert_first_order(np.abs(kept - kept[:, :1]).max(1))


def test_damping_takes_energy(config):
    energy = history(config, 20)[:, 0]
    assert np.diff(energy).max() < 0.0


def test_energy_does_not_grow_on_the_ground(config):
    """Falling, landing and bouncing without actuation; the soft ground gives back a little of what it stored, 2 J a step."""
    worlds, meter, energy = 100, Mechanics(config), []
    q, qd = random_states(np.random.default_rng(5), worlds, 0.3, 0.5, (0.0, 0.05))
    sim = placed(SagittalSimulation(config, worlds, "cpu"), q, qd)
    for _ in range(40):
        energy.append([meter.of(sim, world)[0] for world in range(worlds)])
        sim.step(torch.zeros(worlds, len(JOINTS)))
    energy = np.array(energy)
    assert np.diff(energy, axis=0).max() < 3.0
    assert (energy[1:] < energy[0]).all() and (energy[0] - energy[-1]).min() > 3.0


def test_converges_to_first_order(config):
    """In flight, with springs, dampers and actuators, towards MuJoCo's Runge-Kutta integrator in steps of 0.26 ms."""
    (q, qd), steps, torque = THROWN, 10, (20.0, -8.0)
    reference = MujocoC(modified(config, contact_bias=False), timestep=config.control_dt / 64)
    reference.model.opt.integrator = mujoco.mjtIntegrator.mjINT_RK4
    reference.place(np.float32(q).astype(float), np.float32(qd).astype(float))
    reference.step(torque * 2, 64 * steps)
    exact, ends = reference.read(), []
    for substeps in STEPPED:
        sim = placed(SagittalSimulation(modified(config, substeps=substeps), 1, "cpu"), q, qd)
        for _ in range(steps):
            sim.step(both_sides([torque]))
        ends.append(seen(sim))
    for key in ("joint_angle", "joint_velocity", "body_pose", "body_velocity"):
        assert_first_order([np.abs(end[key][0] - exact[key]).max() for end in ends])


def test_free_fall_by_hand(config):
    """Upright and still, the body falls by g t (t + dt) / 2, the sum of what semi-implicit Euler adds each step."""
    sim = placed(SagittalSimulation(config, 1, "cpu"), above(5.0, 0, 0, 0), np.zeros(5))
    for _ in range(30):
        sim.step(torch.zeros(1, len(JOINTS)))
    time, dt = 30 * config.control_dt, config.control_dt / config.solver.substeps
    assert float(sim.body_pose[0, 0, 2]) == pytest.approx(6.286 - GRAVITY * time * (time + dt) / 2, abs=1e-5)
    assert float(sim.joint_angle.abs().max()) < 1e-6 and float(sim.sole_force.abs().max()) == 0.0


@pytest.mark.parametrize("load", [0.0, 4.0])
def test_standing_carries_the_weight(config, load):
    """With ankles stiff enough to come to rest, the ground carries m g right below the centre of mass, within 2e-6 of the
    weight and 1e-7 m."""
    firm = config.model_copy(update={"load": load, "hip_k": 400.0, "ankle_k": 400.0, "joint_damping": 60.0})
    sim, meter = SagittalSimulation(firm, 1, "cpu"), Mechanics(firm)
    for _ in range(1000):
        sim.step(torch.zeros(1, len(JOINTS)))
    assert float(sim.joint_velocity.abs().max()) < 2e-6
    assert torch.equal(sim.sole_force[0, 0], sim.sole_force[0, 1])
    force, foot = sim.sole_force[0, 0].double().numpy(), sim.body_pose[0, 2].double().numpy()
    assert 2 * force[:, 2].sum() == pytest.approx((40.154191 + load) * GRAVITY, rel=1e-5)
    place = foot[0] + turned(sim.sole_position[0, 0].double().numpy()[:, [0, 2]].T, 2 * foot[4])[:, 0]
    middle = meter.mass @ meter.places(sim)[:, 0] / meter.mass.sum()
    assert force[:, 2] @ place / force[:, 2].sum() == pytest.approx(middle, abs=1e-6)


@pytest.mark.parametrize("friction", [0.2, 1.0])
def test_contact_only_pushes_and_within_its_friction(config, friction):
    """Two thousand worlds under random torques until many have fallen: 0 <= f_z and |f_x| <= mu f_z at each end, and the
    centre of pressure between heel and toe."""
    worlds = 2000
    sim = SagittalSimulation(config.model_copy(update={"friction": friction}), worlds, "cpu")
    slipped = 0
    for _ in range(80):
        sim.step(both_sides(60 * torch.randn(worlds, 2)))
        assert not bool(sim.sole_force[..., 1].any())
        forward, up = sim.sole_force[:, 0, :, 0].double(), sim.sole_force[:, 0, :, 2].double()
        assert float(up.min()) >= 0.0
        assert bool((forward.abs() <= friction * up * (1 + 1e-6)).all())
        slipped += int(((forward.abs() > 0.999 * friction * up) & (up > 1.0)).sum())
        loaded = up.sum(-1) > 1.0
        pressure = (up * sim.sole_position[:, 0, :, 0]).sum(-1)[loaded] / up.sum(-1)[loaded]
        beyond = torch.maximum(-0.06 - pressure, pressure - 0.13)
        assert float(beyond.max()) < RADIUS  # a tilted ball touches the ground beside its centre
        assert bool((beyond[(up[loaded] > 1.0).all(-1)] < 1e-3).all())
    assert slipped > 10_000 and int((sim.body_pose[:, 0, 2] < 1.0).sum()) > 1500


# -- robustness ------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("size", [1e3, 1e6, 1e30, math.inf, -math.inf, math.nan])
def test_wild_torques_mark_their_worlds_and_no_others(config, size):
    """Every second world gets wild torques and stays finite; the others are unchanged, bit for bit."""
    worlds = 64
    sim, calm = (SagittalSimulation(config, worlds, "cpu") for _ in range(2))
    wild, ever = torch.arange(worlds) % 2 == 1, torch.zeros(worlds, dtype=torch.bool)
    for _ in range(40):
        usual = both_sides(20 * torch.randn(worlds, 2))
        calm.step(usual)
        sim.step(torch.where(wild[:, None], size * torch.randn(worlds, 1).sign(), usual))
        assert finite(sim)
        assert not bool(sim.diverged[~wild].any())
        ever |= sim.diverged
    if size != 1e3:  # which is borne
        assert torch.equal(ever, wild)
    for name in OUTPUTS:
        assert torch.equal(getattr(sim, name)[~wild], getattr(calm, name)[~wild]), name


@pytest.mark.parametrize(
    ("pitch", "speed", "gap"),
    [
        (3.14, 100.0, (0.0, 1.0)),
        (3.14, 1e4, (0.0, 1.0)),
        (3.14, 1e8, (0.0, 1.0)),
        (3.14, 1e30, (0.0, 1.0)),
        (3.14, 1.0, (-2.0, 0.0)),
        (3.14, 1.0, (-1e4, 0.0)),
        (100.0, 30.0, (-1.0, 1.0)),
    ],
)
def test_wild_states_stay_finite_or_are_marked(config, pitch, speed, gap):
    """Thousands of states upside down, too fast, deep under ground or wound up: outputs are finite, and a world that
    diverges keeps what it had."""
    worlds = 3000
    sim = SagittalSimulation(config, worlds, "cpu")
    placed(sim, *random_states(np.random.default_rng(8), worlds, pitch, speed, gap))
    for _ in range(15):
        q, qd = sim._q.clone(), sim._qd.clone()
        sim.step(both_sides(100 * torch.randn(worlds, 2)))
        assert finite(sim)
        moved = ((sim._q != q) | (sim._qd != qd)).any(1)
        assert torch.equal(moved, ~sim.diverged)
        assert not bool((sim._qd[moved].abs() > 1e4).any())


def test_too_fast_a_world_has_diverged(config):
    """From half a turn a physics step on, pi / 8.3 ms = 378.5 rad/s, and as many m/s."""
    sim = SagittalSimulation(config, 3, "cpu")
    sim._q[:, 1] += 100.0
    sim._qd[1, 0], sim._qd[2, 0] = 375.0, 382.0
    sim.step(torch.zeros(3, len(JOINTS)))
    assert sim.diverged.tolist() == [False, False, True]


# -- bookkeeping -----------------------------------------------------------------------------------------------------------


def test_neither_the_number_of_worlds_nor_of_threads_changes_a_bit(config):
    pushes, threads, ends = [both_sides(20 * torch.randn(300, 2)) for _ in range(10)], torch.get_num_threads(), []
    for worlds, count in ((300, 1), (300, 2), (7, 1)):
        torch.set_num_threads(count)
        try:
            sim = SagittalSimulation(config, worlds, "cpu")
            for push in pushes:
                sim.step(push[:worlds])
        finally:
            torch.set_num_threads(threads)
        ends.append(seen(sim))
    for name in OUTPUTS:
        assert np.array_equal(ends[0][name], ends[1][name]) and np.array_equal(ends[0][name][:7], ends[2][name]), name


def test_unequal_torques_act_as_their_mean(config):
    sim, mean = (SagittalSimulation(config, 1, "cpu") for _ in range(2))
    for _ in range(10):
        sim.step(torch.tensor([[-20.0, 5.0, -4.0, 2.0]]))
        mean.step(torch.tensor([[-12.0, 3.5, -12.0, 3.5]]))
    assert float(sim.joint_angle.abs().max()) > 0.01
    for name in OUTPUTS:
        assert torch.equal(getattr(sim, name), getattr(mean, name)), name


def test_segments_by_hand(config):
    """Solids of density 1000 kg/m3 as in humanoid.xml; inertias by MuJoCo's C."""

    def capsule(radius, *ends):
        return 1000 * math.pi * radius**2 * (math.dist(*ends) + 4 / 3 * radius)

    sim, meter = NewtonMujocoSimulation(config, 1, "cpu"), Mechanics(config)
    body = segments(sim.model)
    foot = 4 * capsule(0.027, (-0.07, -0.01), (0.14, -0.03))
    thigh, shin = capsule(0.06, (0, 0), (0.01, 0.34)), capsule(0.049, (0, 0), (0, 0.3))
    assert body.foot_mass == pytest.approx(foot, rel=1e-6) == pytest.approx(2.26228, abs=1e-5)
    assert body.leg_mass == pytest.approx(2 * (thigh + shin), rel=1e-6)
    assert body.hat_mass == pytest.approx(22.877, abs=1e-3)
    assert body.hat_mass + body.leg_mass + body.foot_mass == pytest.approx(40.154, abs=1e-3)
    ours = [body.hat_inertia, body.leg_inertia / 2, body.foot_inertia / 2]
    assert ours == pytest.approx(meter.inertia[:3], rel=1e-6)
    leg_com = 0.713 - (thigh * 0.17 + shin * 0.553) / (thigh + shin)
    assert body.leg_com == pytest.approx([0.0, leg_com], abs=1e-6)
    assert body.foot_com == pytest.approx([0.035, -0.08], abs=1e-6)
    assert body.hat_com == pytest.approx(meter.com[0, [0, 2]] - HIP, abs=1e-6)
    assert body.hat_frame == pytest.approx([0.01, 0.465], abs=1e-6)
    assert body.hip == pytest.approx([0.0, 0.713], abs=1e-6)
    assert body.head == pytest.approx([0.01, 0.655], abs=1e-6)
    assert (*body.heel, *body.toe) == pytest.approx((*ENDS[0], *ENDS[1]), abs=1e-6)
    assert body.half_width == pytest.approx([0.1, 0.09], abs=1e-6)
    assert (body.sole_radius, body.ankle_height, body.gravity) == pytest.approx((RADIUS, 0.108, GRAVITY), abs=1e-6)
    assert (body.ankle_x, body.heel_x, body.toe_x) == pytest.approx((0.0, -0.06, 0.13), abs=1e-6)


def test_starts_as_newton_mujoco_does(config):
    """Upright, the same body in the same place at rest."""
    ours, theirs = (simulate(config.model_copy(update={"physics": name}), 2, "cpu") for name in ("sagittal", "mujoco"))
    assert isinstance(ours, SagittalSimulation) and isinstance(theirs, NewtonMujocoSimulation)
    assert torch.allclose(ours.body_pose, theirs.body_pose, atol=2e-7, rtol=0)
    for name in set(OUTPUTS) - {"body_pose"}:
        assert not bool(getattr(ours, name).any()) and not bool(getattr(theirs, name).any()), name
    assert ours.geometry.heel_x == theirs.geometry.heel_x and np.array_equal(ours.geometry.head, theirs.geometry.head)
