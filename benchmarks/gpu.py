"""Speed on a GPU: the environment, training, and the paper's 262 million samples from the command to the last checkpoint.

    python benchmarks/gpu.py [--worlds 1024 4096 16384 65536 131072] [--csv benchmarks/gpu.csv]
                             [--samples 262144000] [--trainings benchmarks/gpu_trainings.csv] [--device cuda]

For each engine and number of worlds one row: control steps/s of the physics alone, of the whole environment under random
actions, and of the same without the task's CUDA graph; the GPU's memory that it takes [bytes]; and for the sagittal engine
training samples/s and the share of learning (policy, value function and PPO update) in them. An iteration has 32 steps and
the default number of mini-batches, which grow with the worlds.

For each agent one row: seconds of `python -m posture.train` with 8,192 worlds. `--samples 0` leaves the trainings out.
Each measurement runs in its own process.
"""

import argparse
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import torch
from shared import compose, finish, hardware, in_new_process, memory, timed, write

from envs.task.head_tracking import HeadTrackingEnv
from posture.learning.learner import Learner

STEPS, ITERATIONS = 64, 4
TRAINING = ("training_samples_per_s", "learning_share")
TRAINED = 8192
"""Worlds of a whole training, those of the paper."""


def main() -> None:
    """Measure, print and write the rows."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--worlds", type=int, nargs="+", default=[1024, 4096, 16384, 65536, 131072])
    parser.add_argument("--csv", type=Path, default=Path(__file__).with_name("gpu.csv"))
    parser.add_argument("--samples", type=int, default=262_144_000)
    parser.add_argument("--trainings", type=Path, default=Path(__file__).with_name("gpu_trainings.csv"))
    parser.add_argument("--device", default="cuda")
    arguments = parser.parse_args()
    if arguments.device != "cpu" and not torch.cuda.is_available():
        parser.error(f"--device {arguments.device}: torch {torch.__version__} finds no CUDA device")
    cases = [(engine, worlds) for worlds in arguments.worlds for engine in ("sagittal", "mujoco")]
    write([shown(in_new_process(measure, *case, arguments.device)) for case in cases], arguments.csv)
    if arguments.samples:
        agents = ("laptop", "ppo_paper")
        write([shown(train(agent, arguments.samples, arguments.device)) for agent in agents], arguments.trainings)


def measure(engine: str, worlds: int, device: str) -> dict[str, Any]:
    """The row of an engine at a number of worlds."""
    config = compose(f"env.physics={engine}", f"env.num_envs={worlds}", f"device={device}", "processes=1")
    torch.manual_seed(0)
    before = memory(device)
    env = HeadTrackingEnv(config.env, 0, device)
    env.warm_up()
    actions = 0.2 * torch.randn(STEPS, worlds, env.num_actions, device=device)
    torques = config.env.torque_limit * torch.cat((actions, actions), -1)

    def steps_per_s(step: Any, inputs: torch.Tensor) -> int:
        step(inputs[0])
        return round(STEPS * worlds / timed(device, lambda: [step(each) for each in inputs.unbind()]))

    row: dict[str, Any] = {"engine": engine, "worlds": worlds, "env_steps_per_s": steps_per_s(env.step, actions)}
    with_graph, env._graph = env._graph, None
    row["env_steps_per_s_without_graph"] = steps_per_s(lambda action: _without_graph(env, action), actions)
    row["physics_steps_per_s"] = steps_per_s(env.sim.step, torques)
    env._graph = with_graph
    after = memory(device)
    row["bytes"] = None if after is None or before is None else after - before
    env.sim.check_capacity()
    env.reset_all()
    row |= _training(env, config, device) if engine == "sagittal" else dict.fromkeys(TRAINING)
    return row | hardware(device)


def _without_graph(env: HeadTrackingEnv, action: torch.Tensor) -> None:
    """A step whose operations are launched one by one."""
    command = action.clamp(-1.0, 1.0)
    torch.cat((command, command), dim=-1, out=env.state.action)
    if env.sim.replays_graph:
        env._move()
    env._rest_of_step()


def _training(env: HeadTrackingEnv, config: Any, device: str) -> dict[str, Any]:
    """Samples/s over a few iterations, after a first one, and the share of learning in a second run of them."""
    inside = 0.0
    step = env.step

    def counted(action: torch.Tensor) -> Any:
        nonlocal inside
        finish(device)
        start = time.perf_counter()
        result = step(action)
        finish(device)
        inside += time.perf_counter() - start
        return result

    with tempfile.TemporaryDirectory() as folder:
        learner = Learner(env, config.agent, Path(folder), device)
        learner.train(1)
        whole = timed(device, lambda: learner.train(1 + ITERATIONS))
        env.step = counted  # type: ignore[method-assign]
        counted_whole = timed(device, lambda: learner.train(1 + 2 * ITERATIONS))
    samples = ITERATIONS * config.agent.num_steps_per_env * env.num_envs
    return dict(zip(TRAINING, (round(samples / whole), round(1 - inside / counted_whole, 3)), strict=True))


def train(agent: str, samples: int, device: str) -> dict[str, Any]:
    """The row of a training of at least `samples` from the command to its end."""
    iterations = -(-samples // (TRAINED * 32))
    command = [sys.executable, "-m", "posture.train", f"agent={agent}", f"device={device}", f"env.num_envs={TRAINED}"]
    command += ["processes=1", "evaluate=false", f"max_iterations={iterations}"]
    with tempfile.TemporaryDirectory() as folder:
        start = time.perf_counter()
        subprocess.run([*command, f"hydra.run.dir={folder}/run"], cwd=folder, check=True)
        seconds = time.perf_counter() - start
    done = iterations * TRAINED * 32
    row = {"agent": agent, "samples": done, "seconds": round(seconds, 1), "samples_per_s": round(done / seconds)}
    return row | hardware(device)


def shown(row: dict[str, Any]) -> dict[str, Any]:
    """The row, printed."""
    print(row, flush=True)
    return row


if __name__ == "__main__":
    main()
