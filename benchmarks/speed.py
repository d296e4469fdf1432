"""Speed of the environment, and how the time of a training iteration divides.

    python benchmarks/speed.py [--worlds 64 512 2048] [--csv benchmarks/speed.csv]

Prints and writes one row per number of worlds: control steps/s of the environment alone under random actions, and the shares
of physics, of observation and reward, and of learning (policy, value function and PPO update) in a training iteration.
All rows are from one run. Compare ratios, since the speed of a machine drifts.
"""

import argparse
import tempfile
import time
from pathlib import Path
from typing import Any

import torch
from shared import compose, finish, hardware, timed, write

from envs.task.head_tracking import HeadTrackingEnv
from posture.learning.learner import Learner

STEPS, ITERATIONS = 64, 4


def main() -> None:
    """Measure, print and write the rows."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--worlds", type=int, nargs="+", default=[64, 512, 2048])
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--csv", type=Path, default=Path(__file__).with_name("speed.csv"))
    arguments = parser.parse_args()
    rows = [measure(worlds, arguments.device) for worlds in arguments.worlds]
    write(rows, arguments.csv)


def measure(worlds: int, device: str) -> dict[str, Any]:
    """One row."""
    config = compose(f"env.num_envs={worlds}", f"device={device}", "processes=1")
    torch.manual_seed(0)
    torch.set_num_threads(config.threads)
    env = HeadTrackingEnv(config.env, 0, device)
    env.warm_up()
    actions = 0.2 * torch.randn(STEPS, worlds, env.num_actions, device=device)
    alone = timed(device, lambda: [env.step(action) for action in actions])

    clock = {"physics": 0.0, "env": 0.0}
    count(env.sim, "step", clock, "physics", device)
    count(env, "step", clock, "env", device)
    with tempfile.TemporaryDirectory() as folder:
        learner = Learner(env, config.agent, Path(folder), device)
        whole = timed(device, lambda: learner.train(ITERATIONS))
    horizon = config.agent.num_steps_per_env
    row = {
        "worlds": worlds,
        "env_steps_per_s": round(STEPS * worlds / alone),
        "training_samples_per_s": round(ITERATIONS * horizon * worlds / whole),
        "physics_share": round(clock["physics"] / whole, 3),
        "observation_reward_share": round((clock["env"] - clock["physics"]) / whole, 3),
        "learning_share": round(1 - clock["env"] / whole, 3),
        "torch_threads": torch.get_num_threads(),
    } | hardware(device)
    print(row)
    return row


def count(owner: Any, name: str, clock: dict[str, float], key: str, device: str) -> None:
    """Add the time of every call of `owner.name` to `clock[key]`."""
    method = getattr(owner, name)

    def counted(*arguments: Any) -> Any:
        finish(device)
        start = time.perf_counter()
        result = method(*arguments)
        finish(device)
        clock[key] += time.perf_counter() - start
        return result

    setattr(owner, name, counted)


if __name__ == "__main__":
    main()
