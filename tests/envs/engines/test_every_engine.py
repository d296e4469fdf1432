"""The contract of the interface in every engine: worlds are independent, resets and saved states are bitwise exact."""

import math

import numpy as np
import pytest
import torch

from envs.body.model import build_model
from envs.engines.factory import simulate
from tests.envs.engines.test_sagittal import OUTPUTS, both_sides, seen


@pytest.fixture(params=["sagittal", "mujoco", "mujoco_c"])
def make(request, config):
    """A function that builds the engine with a number of worlds, and changes of the configuration."""
    return lambda worlds, **changes: simulate(config.model_copy(update={"physics": request.param, **changes}), worlds, "cpu")


def pushes(number, worlds):
    return [both_sides(20 * torch.randn(worlds, 2)) for _ in range(number)]


def assert_equal(sim, worlds, other, others=None):
    for name in OUTPUTS:
        assert torch.equal(getattr(sim, name)[worlds], getattr(other, name)[worlds if others is None else others]), name


def test_stiffness_and_load_take_effect_per_world(make):
    """Each world moves as one built that way."""
    changes = [{}, {"hip_k": 50.0}, {"ankle_k": 10.0}, {"load": 4.0}]
    sim, built = make(4, load=1.0), [make(1, **change) for change in changes]
    sim.set_subject(**{name: torch.cat([getattr(each, name) for each in built]) for name in ("hip_k", "ankle_k", "load")})
    for _ in range(10):
        for each in (sim, *built):
            each.step(both_sides([[-20.0, 5.0]]).expand(each.num_worlds, -1))
    for world, other in enumerate(built):
        assert_equal(sim, [world], other, [0])
    assert min(float((sim.joint_angle[world] - sim.joint_angle[0]).abs().max()) for world in (1, 2, 3)) > 1e-3


@pytest.mark.parametrize("name", ["hip_k", "ankle_k", "load"])
def test_impossible_subjects_are_refused(make, name):
    sim = make(2)
    before = getattr(sim, name).clone()
    for bad in ([-1.0, 1.0], [math.nan, 1.0], [math.inf, 1.0], [1.0], [[1.0, 1.0]]):
        with pytest.raises(ValueError, match=f"{name}: expected 2 finite values"):
            sim.set_subject(**{name: torch.tensor(bad)})
    assert torch.equal(getattr(sim, name), before)


def test_a_reset_world_moves_like_a_new_one_and_the_others_are_unchanged(make):
    """One world after wild motion, one that has diverged."""
    sim, undisturbed, new = (make(4) for _ in range(3))
    torques = pushes(12, 4)
    for torque in torques:
        undisturbed.step(torque)
        sim.step(torque * torch.tensor([[1.0], [4.0], [math.nan], [1.0]]))
    assert sim.diverged.tolist() == [False, False, True, False]
    sim.reset(torch.tensor([False, True, True, False]))
    assert not bool(sim.diverged.any()) and not bool(sim.sole_force[1:3].any())
    assert_equal(sim, [1, 2], new)
    for torque in torques:
        for each in (sim, undisturbed, new):
            each.step(torque)
    assert_equal(sim, [1, 2], new)
    assert_equal(sim, [0, 3], undisturbed)
    assert not torch.equal(sim.joint_angle[1], undisturbed.joint_angle[1])


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
def test_a_step_with_a_bad_torque_is_not_made(make, bad):
    sim = make(1)
    sim.step(pushes(1, 1)[0])
    before = seen(sim)
    sim.step(torch.tensor([[bad, 0.0, bad, 0.0]]))
    assert sim.diverged.tolist() == [True]
    assert all(np.array_equal(before[name], now) for name, now in seen(sim).items())
    if type(sim).__name__ != "NewtonMujocoSimulation":  # whose solver needs a reset
        sim.step(torch.zeros(1, 4))
        assert sim.diverged.tolist() == [False]


def test_a_saved_state_is_continued_exactly(make):
    """In another simulation, one world having diverged in the last step."""
    sim, other = make(3), make(3)
    sim.set_subject(hip_k=torch.tensor([60.0, 125.0, 125.0]), load=torch.tensor([0.0, 0.0, 3.0]))
    torques = pushes(20, 3)
    for i, torque in enumerate(torques[:10]):
        sim.step(torque * torch.tensor([[1.0], [math.nan if i == 9 else 1.0], [1.0]]))
    saved, outputs = sim.state_dict(), seen(sim)
    for torque in torques[10:]:
        sim.step(torque)
    other.step(torques[0])
    other.load_state_dict(saved)
    assert other.diverged.tolist() == [False, True, False]
    for name, value in seen(other).items():
        assert np.allclose(value, outputs[name], atol=2e-6 if name.startswith("body") else 0.0, rtol=0), name
    for torque in torques[10:]:
        other.step(torque)
    assert_equal(other, [0, 2], sim)
    ours, theirs = sim.state_dict(), other.state_dict()
    assert ours.keys() == theirs.keys()
    assert all(np.array_equal(ours[name][[0, 2]].numpy(), theirs[name][[0, 2]].numpy()) for name in ours)


def momentum(sim):
    """Momentum along x of the whole body [kg m/s], (N,): hat, and each leg and foot, by the masses of the Newton model."""
    mass = torch.from_numpy(build_model(sim.config, 1, "cpu").body_mass.numpy()).double()
    return sim.body_velocity[..., 0].double() @ mass


def test_a_push_gives_the_body_its_momentum(make):
    """Force times time, less what the ground takes; without friction to speak of it takes nothing."""
    sim = make(3, friction=0.01)
    sim.push[:] = torch.tensor([50.0, -50.0, 0.0])
    for _ in range(4):
        sim.step(torch.zeros(3, 4))
    given = 50.0 * 4 * sim.config.control_dt
    assert momentum(sim).tolist() == pytest.approx([given, -given, 0.0], abs=0.1 * given)
    before = momentum(sim)
    sim.push.zero_()
    sim.step(torch.zeros(3, 4))
    assert momentum(sim).tolist() == pytest.approx(before.tolist(), abs=0.05 * given)


def test_engines_agree_on_pushes(config):
    """The same pushes, of bodies with a load before the trunk, in all engines: within what separates them without pushes."""
    changed = config.model_copy(update={"load": 3.0, "load_at": (0.1, -0.1)})
    sims = [simulate(changed.model_copy(update={"physics": name}), 2, "cpu") for name in ("sagittal", "mujoco", "mujoco_c")]
    for step in range(12):
        for sim in sims:
            sim.push[:] = torch.tensor([80.0, -40.0]) if step < 6 else 0.0
            sim.step(both_sides([[-5.0, 2.0], [4.0, 1.0]]))
    planar, newton, c = sims
    assert planar.joint_velocity.abs().max() > 0.2
    assert torch.allclose(newton.joint_velocity, c.joint_velocity, atol=1e-3)
    assert torch.allclose(planar.joint_velocity, c.joint_velocity, atol=1e-3)
    assert torch.allclose(planar.body_velocity, c.body_velocity, atol=1e-3)
