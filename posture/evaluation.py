"""From a checkpoint to trajectories, indices, table and figures: the analyst's pipeline."""

from pathlib import Path
from typing import Any

import torch
from rsl_rl.models import MLPModel

from envs.config import EnvConfig
from envs.head_tracking import HeadTrackingEnv
from posture import run_dir
from posture.atomic import replacing
from posture.config import ConfigError, EnvChanges, EvaluationConfig, TrainConfig
from posture.coordination import Row, indices, write_csv
from posture.figures import draw_all
from posture.progress import preparing
from posture.rollout import Policy, rollout
from posture.table import evaluation_table, markdown_table

AS_TRAINED = EnvChanges(hip_k=None, ankle_k=None, load=None, amplitude=None)


def evaluate_run(run: Path, config: TrainConfig) -> list[Row]:
    """Evaluate the newest checkpoint of `run` as its own configuration says; print the table."""
    model = run_dir.newest_model(run)
    if model is None:
        raise ConfigError(f"{run}: no checkpoint to evaluate")
    return evaluate(model, config, config.evaluation, AS_TRAINED, config.device, run / "evaluation")


def evaluate(
    model: Path, run: TrainConfig, evaluation: EvaluationConfig, changes: EnvChanges, device: str, out: Path
) -> list[Row]:
    """Roll out the policy of checkpoint `model` at every frequency of `evaluation`, in one batch, and write to `out`:
    trajectories.npz, metrics.csv, table.md and the figures. Prints the table and what was written. Returns the rows of
    metrics.csv."""
    content = run_dir.load(model, device)
    with preparing():
        env = HeadTrackingEnv(trial_config(run.env, evaluation, changes), run.seed, device)
        policy = load_policy(content, env, run, model)
        env.warm_up()
    freq = torch.tensor(evaluation.freq, dtype=torch.float32, device=env.sim.device)
    trajectory = rollout(env, policy, freq, evaluation.duration)
    rows = indices(
        trajectory,
        transient_s=evaluation.transient,
        tolerance_m=evaluation.tolerance,
        still_joint_deg=evaluation.still_joint_deg,
    )
    shape = env.sim.geometry
    out.mkdir(parents=True, exist_ok=True)
    trajectory.save(out / "trajectories.npz")
    write_csv(rows, out / "metrics.csv")
    paper = published(run.paper, env.config)
    with replacing(out / "table.md") as temporary:
        temporary.write_text(markdown_table(rows, paper) + "\n", encoding="utf-8")
    draw_all(trajectory, rows, paper, out, (shape.heel_x, shape.toe_x))
    print(evaluation_table(rows, paper))
    for path in sorted(out.iterdir()):
        print(path)
    return rows


def published(paper: dict[str, Any], env: EnvConfig) -> dict[str, Any]:
    """The published numbers that were measured under the conditions of `env`: ours stand beside nothing else."""
    return {
        name: table
        for name, table in paper.items()
        if all(getattr(env, key) == value for key, value in table.get("condition", {}).items())
    }


def trial_config(env: EnvConfig, evaluation: EvaluationConfig, changes: EnvChanges) -> EnvConfig:
    """The run's environment for a trial: a world a frequency, and nothing but a fall or its duration ends it."""
    values = env.model_dump()
    values.update({key: value for key, value in changes.model_dump().items() if value is not None})
    values["num_envs"] = len(evaluation.freq)
    values["episode_steps"] = 2 * round(evaluation.duration / env.control_dt) + 1
    values["termination"] |= {"foot_motion": None, "head_tolerance": None}
    return EnvConfig.model_validate(values)


def load_policy(content: dict[str, Any], env: HeadTrackingEnv, run: TrainConfig, model: Path) -> Policy:
    """The deterministic policy of a checkpoint. Raises ConfigError where it does not fit the run's configuration."""
    actor = run.agent.actor.model_dump(mode="json")
    del actor["class_name"]
    groups = {"actor": list(run.agent.obs_groups.actor)}
    network = MLPModel(env.get_observations(), groups, "actor", env.num_actions, **actor)
    try:
        network.load_state_dict(content["actor_state_dict"])
    except (KeyError, RuntimeError, AttributeError, TypeError) as error:
        reason = " ".join(str(error).split())[:200]
        raise ConfigError(f"{model}: does not hold this run's policy ({reason})") from None
    if not all(bool(value.isfinite().all()) for value in network.state_dict().values() if value.is_floating_point()):
        raise ConfigError(f"{model}: holds weights that are not finite")
    return network.to(env.sim.device).eval()
