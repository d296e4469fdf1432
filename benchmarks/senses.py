"""What senses and muscles of people cost: control steps of the environment per second, exact and with env=human.

    python benchmarks/senses.py [--worlds 2048] [--steps 300] [--rounds 5]

The two take turns, and the best round of each counts. One process, one thread of torch.
"""

import argparse

import torch
from shared import compose, timed

from envs.task.head_tracking import HeadTrackingEnv


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    for name, default in (("worlds", 2048), ("steps", 300), ("rounds", 5)):
        parser.add_argument(f"--{name}", type=int, default=default)
    options = parser.parse_args()
    torch.set_num_threads(1)
    agents = {"head_tracking": "laptop", "human": "human"}
    envs = {}
    for name, agent in agents.items():
        config = compose(f"env={name}", f"agent={agent}", f"env.num_envs={options.worlds}")
        envs[name] = HeadTrackingEnv(config.env, 1, "cpu")
        envs[name].warm_up()
    actions = 0.1 * torch.randn(options.steps, options.worlds, 2, generator=torch.Generator().manual_seed(0))
    best = dict.fromkeys(envs, 0.0)
    for _ in range(options.rounds):
        for name, env in envs.items():
            env.reset_all()
            seconds = timed("cpu", lambda env=env: [env.step(action) for action in actions])
            best[name] = max(best[name], options.steps * options.worlds / seconds)
    for name, rate in best.items():
        print(f"{name:<14}{rate:>10,.0f} control steps of one world per second, {rate / best['head_tracking']:.2f}")


if __name__ == "__main__":
    main()
