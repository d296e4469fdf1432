"""How much of the noise of PPO's advantages comes from episodes that end early.

python benchmarks/advantage_noise.py CKPT [STD]     a checkpoint, and the standard deviation of the actions (0.01)

2048 worlds are stepped with noisy actions. The advantages are those that PPO would learn from, with the checkpoint's value
function; the samples of the 100 steps before an early end are then left out.
"""

import sys
from pathlib import Path

import torch

from envs.task.head_tracking import HeadTrackingEnv
from posture.learning.networks import load_network
from posture.storage import checkpoint, run_dir

WORLDS, SETTLED, STEPS, NEAR = 2048, 500, 400, 100
"""Worlds; control steps before the first sample, and of samples; before an early end this many count as close to it."""


def main(model: Path, std: float) -> None:
    """Print the share of samples close to an early end, and the standard deviation of advantages with and without them."""
    run, content = run_dir.read_config(model.parent), checkpoint.load(model, "cpu")
    actor, critic = (load_network(content, run, name, model).eval() for name in ("actor", "critic"))
    gamma, lam = run.agent.algorithm.gamma, run.agent.algorithm.lam
    env = HeadTrackingEnv(run.env.model_copy(update={"num_envs": WORLDS}), 1, "cpu")
    draw = torch.Generator().manual_seed(0)
    observation, records = env.reset_all(), []
    with torch.inference_mode():
        for step in range(SETTLED + STEPS):
            mean, value = actor(observation), critic(observation).squeeze(1)
            observation, reward, done, extras = env.step(mean + std * torch.randn(mean.shape, generator=draw))
            if step >= SETTLED:
                time_out = extras["time_outs"]
                records.append((value, reward + gamma * value * time_out, done, done & ~time_out))
        following = critic(observation).squeeze(1)
    advantage, until_end, kept = torch.zeros(WORLDS), torch.full((WORLDS,), NEAR), []
    ends = sum(int(early.sum()) for *_, early in records)
    for value, reward, done, early in reversed(records):
        advantage = reward + gamma * following * ~done - value + gamma * lam * advantage * ~done
        until_end = torch.where(early, 0, (until_end + 1).where(~done, torch.tensor(NEAR)))
        kept.append((advantage, until_end))
        following = value
    advantages, ends_in = (torch.stack(values) for values in zip(*kept, strict=True))
    far = ends_in >= NEAR
    steps = STEPS * WORLDS / max(ends, 1)
    print(f"early ends: 1 in {steps:,.0f} steps; close to one: {1 - far.float().mean():.2%} of the samples")
    print(f"standard deviation of the advantages: {advantages.std():.4f}, without those {advantages[far].std():.4f}")


if __name__ == "__main__":
    main(Path(sys.argv[1]), float(sys.argv[2]) if len(sys.argv) > 2 else 0.01)
