"""Diverged worlds, dropped constraints, and bitwise reproducibility of the environment in every engine."""

import math

import pytest
import torch

from envs.config import ConstraintOverflowError, SolverConfig
from envs.engines.factory import simulate
from envs.engines.interface import top_speed
from envs.engines.newton_mujoco import NewtonMujocoSimulation
from envs.task.head_tracking import HeadTrackingEnv
from envs.task.observations import TERMS
from tests.commands import TINY, call

ENGINES = ["sagittal", "mujoco", "mujoco_c"]
WORLDS, BROKEN = 4, 2
FREE = ("env.termination.head_tolerance=null", "env.termination.foot_motion=null", "env.freq_draw=uniform")
"""Nothing but a fall or divergence ends an episode; world i draws as world i of any other number of worlds."""


@pytest.fixture(scope="module", params=ENGINES)
def engine(request):
    return request.param


@pytest.fixture(scope="module")
def make(engine, env_config):
    """A function that makes an environment in the engine under test with all observation terms."""
    sensed = f"++env.observations={{policy:[{','.join(TERMS)}]}}"

    def made(*overrides, seed=1):
        config = env_config(f"env.physics={engine}", f"env.num_envs={WORLDS}", sensed, *FREE, *overrides)
        return HeadTrackingEnv(config, seed, "cpu")

    return made


def actions(steps, worlds=WORLDS, size=0.2):
    return size * torch.randn(steps, worlds, 2, generator=torch.Generator().manual_seed(0))


def all_finite(observation, reward, extras):
    values = [observation["policy"], reward, *extras["log"].values()]
    return all(bool(value.isfinite().all()) for value in values)


def harmed(env, harm, action):
    """One step of `env` in which only world BROKEN gets the `harm`."""
    if harm == "nan action":
        action = action.clone()
        action[BROKEN, 0] = math.nan
        return env.step(action)
    # Actions are clipped, so such a torque can only be given to the engine directly.
    step, more = env.sim.step, torch.zeros(WORLDS, 4)
    more[BROKEN] = {"nan torque": math.nan, "infinite torque": math.inf, "torque of 1e7": 1e7}[harm]
    env.sim.step = lambda torque: step(torque + more)
    try:
        return env.step(action)
    finally:
        env.sim.step = step


# Episodes of seven steps: the bad input comes in the step in which they time out.
@pytest.mark.parametrize(
    ("harm", "reward_of_an_end"),
    [
        ("nan action", "null"),
        ("nan action", "-9.0"),
        ("nan torque", "null"),
        ("infinite torque", "null"),
        ("torque of 1e7", "null"),
    ],
)
def test_diverged_world_ends_its_episode_and_is_reset(make, harm, reward_of_an_end):
    """The episode ends early in that step, even if it would also time out. All outputs are finite, the other worlds are
    unchanged bit for bit, and after the reset the world moves like a new one."""
    before, after = actions(6), actions(8, size=0.1)
    overrides = (f"env.reward.ended={reward_of_an_end}", "env.episode_steps=7")
    env, calm = make(*overrides), make(*overrides)
    for action in before:
        env.step(action)
        calm.step(action)
    observation, reward, done, extras = harmed(env, harm, after[0])
    _, calm_reward, calm_done, calm_extras = calm.step(after[0])
    assert bool(calm_done.all()) and bool(calm_extras["time_outs"].all())
    others = [world for world in range(WORLDS) if world != BROKEN]
    assert bool(done[BROKEN]) and not bool(extras["time_outs"][BROKEN])
    assert bool(extras["time_outs"][others].all())
    assert float(extras["log"]["/diverged"]) == 1.0 and float(calm_extras["log"]["/diverged"]) == 0.0
    assert all_finite(observation, reward, extras)
    assert float(extras["log"]["/tracking_error_mm"]) < 1e3 and float(extras["log"]["/cost"]) <= 4.0
    assert torch.equal(reward[others], calm_reward[others])

    # A new environment with the same target.
    fresh = make(*overrides)
    fresh.reset_all()
    fresh.steps.copy_(env.steps)  # scheduled weights depend on it
    assert torch.equal(env.episodes.freq, fresh.episodes.freq)
    for action in after[1:7]:
        (seen, got, _, more), (as_calm, calm_got, *_), (as_fresh, fresh_got, *_) = (
            e.step(action) for e in (env, calm, fresh)
        )
        assert all_finite(seen, got, more) and float(more["log"]["/diverged"]) == 0.0
        assert torch.equal(seen["policy"][others], as_calm["policy"][others]) and torch.equal(got[others], calm_got[others])
        assert torch.equal(seen["policy"][BROKEN], as_fresh["policy"][BROKEN]) and got[BROKEN] == fresh_got[BROKEN]


def test_top_speed_is_half_a_turn_in_a_physics_step(engine, env_config):
    """In flight at 0.9 of the bound a world moves; at 1.1 it has diverged, and its outputs are those before the step."""
    config = env_config(f"env.physics={engine}")
    bound = top_speed(config)
    assert bound == pytest.approx(math.pi / (0.0166 / 2))  # of two steps in 16.6 ms: 378 m/s
    sim = simulate(config, 2, "cpu")
    for world, share in enumerate((0.9, 1.1)):
        fling(sim, world, share * bound)
    place, kept = sim.body_pose.clone(), sim.body_velocity.clone()
    sim.step(torch.zeros(2, 4))
    assert sim.diverged.tolist() == [False, True]
    moved = sim.body_pose[:, 0, 0] - place[:, 0, 0]
    assert moved.tolist() == pytest.approx([0.9 * bound * config.control_dt, 0.0], rel=1e-3)
    assert torch.equal(sim.body_pose[1], place[1]) and torch.equal(sim.body_velocity[1], kept[1])


def fling(sim, world, speed):
    """Put a world 100 m up with a `speed` [m/s] along x; each engine has its own state."""
    state = sim.state_dict()
    if "q" in state:
        state["q"][world, 1] += 100.0
        state["qd"][world, 0] = speed
    elif "joint_q" in state:
        state["joint_q"][world, 2] += 100.0
        state["joint_qd"][world, 0] = speed
    else:  # MuJoCo's row: time, positions, velocities
        state["mujoco"][world, 1 + 2] += 100.0
        state["mujoco"][world, 1 + sim._models[world].nq] = speed
    sim.load_state_dict(state)


# -- capacity for contacts and constraints -------------------------------------------------------------------------------


def crouched(config, **capacity):
    """Both feet pressed into the ground and four joints past their limits: 4 contacts of 4 rows, and 4 rows more."""
    solver = SolverConfig.model_validate(config.solver.model_dump() | capacity)
    sim = NewtonMujocoSimulation(config.model_copy(update={"solver": solver}), 2, "cpu")
    sim.joint_angle[:] = 0.9
    sim._joint_q[:, 2] -= 1.0
    sim.step(torch.zeros(2, 4))
    return sim


def test_overflow_error_states_the_number_of_rows_needed(config):
    """The rows of this posture are counted by hand. One row less is an error; the size that the error states is enough."""
    with pytest.raises(ConstraintOverflowError, match="env.solver.constraint_rows = 19, needed at least 20$"):
        crouched(config, constraint_rows=19).check_capacity()
    crouched(config, constraint_rows=20, contacts=4).check_capacity()  # four is all that two soles can have


@pytest.mark.parametrize("command", ["eval", "export", "train"])
def test_command_with_an_overflow_fails_and_writes_no_result(monkeypatch, tmp_path, capsys, command):
    """One line with the key to raise, exit code 1, and no file of results is left."""
    monkeypatch.chdir(tmp_path)
    call(monkeypatch, "train", *TINY, "evaluate=false", "max_iterations=1")
    build = NewtonMujocoSimulation.__init__

    def cramped(sim, *arguments):
        build(sim, *arguments)
        sim._data.njmax = 8  # the solver's own minimum is the 16 rows of two flat feet

    monkeypatch.setattr(NewtonMujocoSimulation, "__init__", cramped)
    capsys.readouterr()
    with pytest.raises(SystemExit) as stop:
        call(monkeypatch, command, *(TINY if command == "train" else ["ckpt=latest"]), "env.physics=mujoco")
    (line,) = capsys.readouterr().err.strip().splitlines()
    assert stop.value.code == 1 and line.startswith("error: ") and "env.solver.constraint_rows = 8, needed at least" in line
    left = {path.name for path in tmp_path.rglob("*")}
    assert "model_1.pt" in left and not left & {"metrics.csv", "trajectories.npz", "table.md", "trial.yaml", "policy.onnx"}


# -- reproducibility -----------------------------------------------------------------------------------------------------


def test_same_seed_is_bitwise_reproducible_and_another_seed_differs(make):
    """Over several episodes."""
    drawn = ("env.episode_steps=[3,9]", "env.freq=[0.1,1.5]")
    one, two, other = make(*drawn), make(*drawn), make(*drawn, seed=2)
    differ = False
    for action in actions(30):
        (seen, reward, done, _), (seen2, reward2, done2, _), (seen3, *_) = (e.step(action) for e in (one, two, other))
        assert torch.equal(seen["policy"], seen2["policy"]) and torch.equal(reward, reward2) and torch.equal(done, done2)
        differ |= not torch.equal(seen["policy"], seen3["policy"])
    assert int(one.episodes.episode.min()) >= 3 and differ
