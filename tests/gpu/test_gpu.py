"""What needs a GPU: `make test-gpu`. Without one these tests are skipped, and say so."""

import time

import pytest
import torch

from envs.engines.factory import simulate
from envs.task.head_tracking import LOG, HeadTrackingEnv
from posture.learning.learner import Learner
from tests.conftest import compose

pytestmark = [
    pytest.mark.gpu,
    pytest.mark.skipif(not torch.cuda.is_available(), reason="torch finds no CUDA device"),
]
ENGINES = pytest.mark.parametrize("physics", ["sagittal", "mujoco"])


def environment(physics, worlds=64, device="cuda", training_steps=None, *overrides):
    keys = [f"env.physics={physics}", f"env.num_envs={worlds}", "agent.algorithm.num_mini_batches=1", "processes=1"]
    return HeadTrackingEnv(compose(*keys, *overrides).env, 1, device, training_steps=training_steps)


def actions(steps, worlds=64):
    return 0.5 * torch.randn(steps, worlds, 2, generator=torch.Generator().manual_seed(0))


@ENGINES
def test_physics_is_that_of_the_cpu(physics):
    """Half a second under random torques: angles within 1e-4 rad, speeds within 1e-2 rad/s."""
    config = compose(f"env.physics={physics}", "env.num_envs=64", "agent.algorithm.num_mini_batches=1").env
    here, there = (simulate(config, 64, device) for device in ("cpu", "cuda"))
    for action in actions(32):
        torque = 0.1 * config.torque_limit * torch.cat((action, action), -1)
        here.step(torque)
        there.step(torque.cuda())
    torch.testing.assert_close(there.joint_angle.cpu(), here.joint_angle, rtol=0, atol=1e-4)
    torch.testing.assert_close(there.joint_velocity.cpu(), here.joint_velocity, rtol=0, atol=1e-2)
    assert here.joint_angle.abs().max() > 0.01


@ENGINES
def test_episodes_are_those_of_the_cpu(physics):
    """The same numbers are drawn: frequencies, lengths and targets agree, and so do time-outs."""
    here, there = (environment(physics, 64, device, None, "env.episode_steps=[2,9]") for device in ("cpu", "cuda"))
    for action in 0.1 * actions(30):
        expected, result = here.step(action), there.step(action.cuda())
        torch.testing.assert_close(result[3]["time_outs"].cpu(), expected[3]["time_outs"])
        torch.testing.assert_close(there.episodes.freq.cpu(), here.episodes.freq, rtol=0, atol=0)
        torch.testing.assert_close(there.episodes.target_x.cpu(), here.episodes.target_x, rtol=0, atol=1e-6)
        torch.testing.assert_close(result[0]["policy"].cpu(), expected[0]["policy"], rtol=1e-3, atol=1e-2)


@ENGINES
@pytest.mark.parametrize("training_steps", [None, 200])
def test_the_graph_is_the_step(physics, training_steps):
    """200 steps with resets, replayed, against the same operations launched one by one: equal to the bit for the sagittal
    engine. SolverMuJoCo adds contacts in any order, so its sums differ in the last bits."""
    replayed, launched = (environment(physics, 64, "cuda", training_steps, "env.episode_steps=[1,30]") for _ in range(2))
    replayed.warm_up()
    tolerance = {"rtol": 0, "atol": 0} if physics == "sagittal" else {"rtol": 1e-3, "atol": 1e-2}
    for action in actions(200).cuda():
        observation, reward, done, extras = replayed.step(action)
        torch.cat((action.clamp(-1, 1),) * 2, dim=-1, out=launched.state.action)
        if launched.sim.replays_graph:
            launched._move()
        *groups, expected_reward, expected_done, time_out, log = launched._rest_of_step()
        for name, group in zip(replayed.config.observations, groups, strict=True):
            torch.testing.assert_close(observation[name], group, **tolerance)
        torch.testing.assert_close(reward, expected_reward, **tolerance)
        assert torch.equal(extras["time_outs"], time_out) and torch.equal(done, expected_done)
        torch.testing.assert_close(torch.stack([extras["log"][name] for name in LOG]), log, **tolerance)
    assert replayed.episodes.episode.min() >= 6 and int(replayed.steps) == 200


@ENGINES
def test_results_stay_after_the_next_step(physics):
    env = environment(physics)
    results = [env.step(action)[:2] for action in actions(3).cuda()]
    kept = [(observation.clone(), reward.clone()) for observation, reward in results]
    for action in actions(3).cuda():
        env.step(action)
    for (observation, reward), (observation_then, reward_then) in zip(results, kept, strict=True):
        assert (observation == observation_then).all() and torch.equal(reward, reward_then)


@ENGINES
def test_a_step_waits_for_nothing(physics):
    """PyTorch refuses every operation for which the host would wait."""
    env = environment(physics, 64, "cuda", 200, "env.episode_steps=[1,3]")
    env.warm_up()
    inputs = actions(50).cuda()
    torch.cuda.synchronize()
    torch.cuda.set_sync_debug_mode("error")
    try:
        for action in inputs.unbind():
            env.step(action)
    finally:
        torch.cuda.set_sync_debug_mode("default")


@ENGINES
def test_the_graph_reads_what_changes_between_steps(physics):
    """Another body, another frequency and a restored state have their effect on a captured step."""
    env, other = environment(physics), environment(physics)
    env.warm_up()
    for each in (env, other):
        each.sim.set_subject(hip_k=torch.full((64,), 200.0, device="cuda"), load=torch.full((64,), 5.0, device="cuda"))
        each.follow(torch.full((64,), 1.5, device="cuda"))
        each.reset_all()
    saved = env.state_dict()
    first = [env.step(action)[1] for action in 0.1 * actions(20).cuda()]
    expected = [other.step(action)[1] for action in 0.1 * actions(20).cuda()]
    env.load_state_dict(saved)
    again = [env.step(action)[1] for action in 0.1 * actions(20).cuda()]
    assert (env.episodes.freq == 1.5).all()
    torch.testing.assert_close(torch.stack(first), torch.stack(expected), rtol=1e-3, atol=1e-2)
    torch.testing.assert_close(torch.stack(first), torch.stack(again), rtol=1e-3, atol=1e-2)


def learner(folder):
    config = compose("env.num_envs=256", "agent.algorithm.num_mini_batches=4", "agent.save_interval=2", "processes=1")
    torch.manual_seed(0)
    env = HeadTrackingEnv(config.env, 1, "cuda", training_steps=128)
    folder.mkdir(exist_ok=True)
    result = Learner(env, config.agent, folder, "cuda")
    env.warm_up()
    return result


def test_a_resumed_training_is_the_training(tmp_path):
    whole = learner(tmp_path / "whole")
    whole.train(4)
    learner(tmp_path / "parts").train(2)
    resumed = learner(tmp_path / "parts")
    torch.manual_seed(99)
    resumed.resume()
    resumed.train(4)
    for name, weight in whole.alg.actor.state_dict().items():
        torch.testing.assert_close(resumed.alg.actor.state_dict()[name], weight, rtol=1e-5, atol=1e-6)
    assert int(whole.env.steps) == int(resumed.env.steps) == 128


def test_a_policy_trained_on_a_gpu_is_evaluated_on_a_cpu(tmp_path, monkeypatch):
    from tests.commands import TINY, call, runs

    monkeypatch.chdir(tmp_path)
    call(monkeypatch, "train", *TINY, "device=cuda", "processes=1", "evaluate=false")
    call(monkeypatch, "eval", f"ckpt={runs()[0]}", "evaluation.freq=[0.3]", "evaluation.duration=30")


def test_the_graph_is_faster():
    """1,024 worlds of the sagittal engine, where launches cost more than the work: at least as fast as without the graph."""
    env = environment("sagittal", 1024)
    env.warm_up()
    inputs = 0.2 * actions(200, 1024).cuda()

    def seconds(step):
        torch.cuda.synchronize()
        start = time.perf_counter()
        for action in inputs.unbind():
            step(action)
        torch.cuda.synchronize()
        return time.perf_counter() - start

    def launched(action):
        torch.cat((action, action), dim=-1, out=env.state.action)
        env._rest_of_step()

    assert min(seconds(env.step) for _ in range(3)) < min(seconds(launched) for _ in range(3))
