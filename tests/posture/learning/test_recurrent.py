"""A policy with a memory: trained, resumed, evaluated and used on the page like any other; not exported."""

import torch

from envs.task.head_tracking import HeadTrackingEnv
from posture.evaluation.rollout import rollout
from posture.evaluation.trial import AS_TRAINED, trial_config
from posture.learning.networks import load_policy
from posture.play.environment import PlayEnv, Settings, play_config
from posture.play.policies import TrainedPolicy
from posture.storage import checkpoint, run_dir
from tests.commands import CONSTANT, TINY, call, refused, runs, same

QUICK = [*TINY, *CONSTANT, "senses=recurrent", "agent.actor.rnn_hidden_dim=4", "agent.critic.rnn_hidden_dim=4"]


def test_resume_continues_exactly(monkeypatch, tmp_path):
    """One iteration, a break and two more equal three without a break: the memory of the present episodes is kept."""
    monkeypatch.chdir(tmp_path)
    quick = [*QUICK, "evaluate=false"]
    call(monkeypatch, "train", *quick, "max_iterations=1")
    run = runs()[0]
    call(monkeypatch, "train", f"resume={run}", "max_iterations=3")
    call(monkeypatch, "train", *quick, "max_iterations=3")
    assert same(*(checkpoint.load(folder / "model_3.pt", "cpu") for folder in runs()))
    state = checkpoint.load(run / "resume.pt", "cpu")["processes"][0]["memory"]
    assert [memory.shape for memory in state] == [(1, 8, 4)] * 2 and all(bool(memory.any()) for memory in state)


def test_each_trial_begins_without_memory(monkeypatch, tmp_path, capsys):
    """Two roll-outs of one policy agree, and the page starts anew after a reset; an export is refused."""
    monkeypatch.chdir(tmp_path)
    call(monkeypatch, "train", *QUICK)
    run = runs()[0]
    model = run / "model_2.pt"
    config = run_dir.read_config(run)
    env = config.env
    worlds = HeadTrackingEnv(trial_config(env, config.evaluation, AS_TRAINED, "cpu"), 0, "cpu")
    actor = load_policy(checkpoint.load(model, "cpu"), config, model, "cpu")
    freq = torch.tensor(config.evaluation.freq)
    first, second = (rollout(worlds, actor, freq, config.evaluation.duration) for _ in range(2))
    assert (first.head_x == second.head_x).all()

    settings = Settings(1.0, env.hip_k, env.ankle_k, env.load, env.amplitude, 0.025, None)
    stander = PlayEnv(play_config(env), settings)
    policy = TrainedPolicy(model, config)
    with torch.inference_mode():
        fresh, later = policy.act(stander, settings).clone(), policy.act(stander, settings).clone()
        assert not torch.equal(fresh, later)  # the same observation, with a memory of it
        policy.reset()
        assert torch.equal(policy.act(stander, settings), fresh)

    assert "a recurrent policy cannot be exported" in refused(monkeypatch, capsys, "export", f"ckpt={run}", "what=[policy]")
