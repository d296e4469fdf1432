"""What a policy for many bodies senses of the body it has: every file of conf/body_sense/, as docs/many_bodies.md says."""

from pathlib import Path

import pytest
import torch

from envs.engines.interface import SUBJECT
from envs.task.head_tracking import HeadTrackingEnv
from posture.cli.jobs import check
from posture.config.train import TrainConfig
from tests.conftest import compose

WITHOUT = 16 + 2  # values of the default's groups `policy` and `target_motion`: docs/gymnasium.md
PROPERTIES, TORQUES = 7, 2  # the seven keys that are drawn; spring and damper of hip and ankle
SIZES = {
    "told": WITHOUT + PROPERTIES + TORQUES,
    "felt": WITHOUT + TORQUES,
    "history": WITHOUT * (1 + 6),
    "memory": WITHOUT,
    "none": WITHOUT,
}
TINY = ("env.num_envs=4", "agent.algorithm.num_mini_batches=1")
MANY_BODIES = ("env=many_bodies", "agent=universal", *TINY)


def config(sense):
    return compose(*MANY_BODIES, f"body_sense={sense}")


def after_a_step(sense):
    """The environment, and what it observes."""
    env = HeadTrackingEnv(config(sense).env, 1, "cpu")
    return env, env.step(torch.tensor([[-0.2, 0.1]] * 4))[0]


@pytest.mark.parametrize("sense", SIZES)
def test_actor_and_critic_observe_as_much_as_documented(sense):
    _, observed = after_a_step(sense)
    for groups in (config(sense).agent.obs_groups.actor, config(sense).agent.obs_groups.critic):
        values = torch.cat([observed[group] for group in groups], dim=-1)
        assert values.shape == (4, SIZES[sense]) and bool(values.isfinite().all())


def test_told_are_the_properties_and_felt_is_the_torque():
    env, observed = after_a_step("told")
    own, torques = observed["body"].split([PROPERTIES, TORQUES], dim=-1)
    drawn = [*(getattr(env.sim, name) for name in SUBJECT), env.episodes.amplitude.float(), env.episodes.tolerance]
    assert torch.equal(own, torch.stack(drawn, dim=-1))
    assert all(len(values.unique()) == 4 for values in own.T) and bool((torques != 0).all())
    # The same bodies are drawn whatever of them is sensed.
    assert torch.equal(after_a_step("felt")[1]["body"], torques)


def test_earlier_moments_or_a_memory_stand_for_the_body():
    networks = {sense: config(sense).agent.actor.class_name for sense in SIZES}
    assert networks == dict.fromkeys(SIZES, "MLPModel") | {"memory": "RNNModel"}
    sensing = {sense: config(sense).env.sensing for sense in SIZES}
    seconds = {name: own.history * own.history_step * config(name).env.control_dt for name, own in sensing.items()}
    assert seconds == dict.fromkeys(SIZES, 0.0) | {"history": pytest.approx(0.4, abs=0.005)}


def test_the_experiment_trains_each():
    jobs = check("train", TrainConfig, ["-m", "experiment=body_senses", "seed=1", *TINY]).jobs
    found = {job.own[0].removeprefix("body_sense="): job.config for job in jobs}
    files = {path.stem for path in (Path(__file__).parents[3] / "conf" / "body_sense").glob("*.yaml")}
    assert len(jobs) == len(found) and set(found) == files == set(SIZES)
    for sense, of_experiment in found.items():
        assert (of_experiment.env, of_experiment.agent) == (config(sense).env, config(sense).agent)
