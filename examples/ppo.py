"""PPO in one file, in the style of CleanRL, on the vector environment.

    python examples/ppo.py [--steps 500000] [--num-envs 256] [--seed 1]

Prints, after every tenth update, the control steps so far, and return and length of the last hundred episodes on average.
"""

import argparse

import gymnasium
import numpy as np
import torch
from gymnasium.wrappers.vector import RecordEpisodeStatistics
from torch import nn
from torch.distributions import Normal

import posture.gymnasium

STEPS, EPOCHS, MINI_BATCHES, LEARNING_RATE = 32, 4, 8, 1e-3
GAMMA, LAMBDA, CLIP = 0.99, 0.98, 0.2
FIRST_STD = 0.2
"""Standard deviation of the first actions. With 1, as is usual, the first episodes are half as long."""


def train(steps: int, num_envs: int, seed: int) -> list[tuple[float, float]]:
    """Return and length of the last hundred episodes, on average, after each update."""
    torch.manual_seed(seed)
    envs = RecordEpisodeStatistics(gymnasium.make_vec(posture.gymnasium.ID, num_envs, autoreset_mode="SameStep"))
    size, actions = envs.single_observation_space.shape[0], envs.single_action_space.shape[0]
    scaled = nn.BatchNorm1d(size, affine=False, momentum=None).eval()  # by mean and deviation of all observations so far
    actor, critic = network(size, actions, 0.01), network(size, 1, 1.0)
    log_std = nn.Parameter(torch.full((actions,), FIRST_STD).log())
    parameters = [*actor.parameters(), *critic.parameters(), log_std]
    optimizer = torch.optim.Adam(parameters, LEARNING_RATE)
    seen, curve = torch.from_numpy(envs.reset(seed=seed)[0]), []

    for update in range(1, steps // (STEPS * num_envs) + 1):
        # 1. Roll out. An episode that timed out is worth more than was seen of it: the value of its last observation.
        batch = []
        for _ in range(STEPS):
            with torch.no_grad():
                state = scaled(seen)
                policy = Normal(actor(state), log_std.exp())
                action = policy.sample()
                observation, reward, terminated, truncated, info = envs.step(action.numpy())
                after = torch.from_numpy(observation.copy())
                for world in np.flatnonzero(info.get("_final_obs", ())):
                    after[world] = torch.from_numpy(info["final_obs"][world])
                value, next_value = critic(state)[:, 0], critic(scaled(after))[:, 0] * torch.from_numpy(~terminated)
            step = reward + GAMMA * next_value.numpy(), terminated | truncated
            batch.append((seen, state, action, policy.log_prob(action).sum(-1), value, *map(torch.from_numpy, step)))
            seen = torch.from_numpy(observation)

        # 2. Generalised advantage estimation, from the last step to the first.
        raw, states, acts, log_probs, values, targets, dones = map(torch.stack, zip(*batch, strict=True))
        advantages = (targets - values).float()
        for t in reversed(range(STEPS - 1)):
            advantages[t] += GAMMA * LAMBDA * advantages[t + 1] * ~dones[t]
        returns = (advantages + values).flatten()
        advantages = ((advantages - advantages.mean()) / advantages.std()).flatten()
        states, acts, log_probs = states.flatten(0, 1), acts.flatten(0, 1), log_probs.flatten()

        # 3. Update.
        for _ in range(EPOCHS):
            for part in torch.randperm(len(returns)).chunk(MINI_BATCHES):
                ratio = (Normal(actor(states[part]), log_std.exp()).log_prob(acts[part]).sum(-1) - log_probs[part]).exp()
                gain = torch.min(ratio * advantages[part], ratio.clamp(1 - CLIP, 1 + CLIP) * advantages[part])
                loss = (critic(states[part])[:, 0] - returns[part]).square().mean() - gain.mean()
                optimizer.zero_grad()
                loss.backward()
                nn.utils.clip_grad_norm_(parameters, 1.0)
                optimizer.step()
        scaled.train()(raw.flatten(0, 1))
        scaled.eval()

        curve.append((float(np.mean(envs.return_queue)), float(np.mean(envs.length_queue))))
        if update % 10 == 0:
            print(f"{update * STEPS * num_envs:>9,} steps: return {curve[-1][0]:.2f}, length {curve[-1][1]:.0f}", flush=True)
    envs.close()
    return curve


def network(inputs: int, outputs: int, last_gain: float) -> nn.Sequential:
    """Two hidden layers; a small `last_gain` makes the first outputs small."""
    net = nn.Sequential(nn.Linear(inputs, 64), nn.SiLU(), nn.Linear(64, 64), nn.SiLU(), nn.Linear(64, outputs))
    nn.init.orthogonal_(net[-1].weight, last_gain)
    return net


if __name__ == "__main__":
    torch.set_num_threads(1)
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--steps", type=int, default=500_000)
    parser.add_argument("--num-envs", type=int, default=256)
    parser.add_argument("--seed", type=int, default=1)
    arguments = parser.parse_args()
    train(arguments.steps, arguments.num_envs, arguments.seed)
