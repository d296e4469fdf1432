"""From a checkpoint to trajectories, indices, table and figures: the analyst's pipeline."""

import hashlib
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import torch

from envs.config import EnvConfig, Schedule, as_plain
from envs.task.head_tracking import HeadTrackingEnv
from posture.analysis.coordination import measure_trajectory
from posture.analysis.figures import draw_all
from posture.analysis.ramp import transitions
from posture.analysis.results import Origin, Result, read_csv, write_csv
from posture.analysis.table import evaluation_columns, markdown_table, text_table
from posture.config.device import check_engine
from posture.config.errors import ConfigError
from posture.config.eval import EnvChanges, EvaluationConfig, LqrConfig, check_trial
from posture.config.published import read_published
from posture.config.reading import read
from posture.config.train import TrainConfig
from posture.evaluation.lqr_policy import LqrController
from posture.evaluation.rollout import Policy, rollout
from posture.learning.networks import load_policy
from posture.learning.progress import preparing
from posture.storage import checkpoint, provenance, run_dir, yaml_files
from posture.storage.atomic import replacing
from posture.storage.code_version import analysis_version, envs_version
from posture.theory.lqr import plan
from posture.theory.prediction import predict
from posture.theory.program import InfeasibleError
from posture.theory.stander import linearise, segments

AS_TRAINED = EnvChanges(hip_k=None, ankle_k=None, load=None, amplitude=None, physics=None, ramp=None)


def evaluate_run(run: Path, config: TrainConfig) -> list[Result]:
    """Evaluate the newest checkpoint of `run` as its own configuration says, unless that was done; print the table."""
    model = run_dir.newest_model(run)
    if model is None:
        raise ConfigError(f"{run}: no checkpoint to evaluate")
    return evaluate(model, config, config.evaluation, AS_TRAINED, config.device, run / "evaluation", again=False)


def evaluate(
    model: Path,
    run: TrainConfig,
    evaluation: EvaluationConfig,
    changes: EnvChanges,
    device: str,
    out: Path,
    again: bool = True,
) -> list[Result]:
    """Evaluate the deterministic policy of checkpoint `model` of a run; see `analyse`.

    Not `again`: where `out` has what the same policy, code and conditions gave, that is read.
    """
    content = checkpoint.load(model, device)
    run_dir.writable(out)
    trial = trial_config(run.env, evaluation, changes, device)
    if not again and is_current(out, model, run, evaluation, changes, device):
        rows = read_csv(out / "metrics.csv")
        print(text_table(rows, evaluation_columns(rows, published(trial))))
        print(f"evaluated before: {out}")
        return rows
    with preparing():
        env = HeadTrackingEnv(trial, run.seed, device)
        policy = load_policy(content, run, model, env.sim.device)
        env.warm_up()
    return analyse(env, policy, evaluation, out, _about(model, run))


def is_current(
    out: Path, model: Path, run: TrainConfig, evaluation: EvaluationConfig, changes: EnvChanges, device: str
) -> bool:
    """Whether `out` holds what the policy of `model` gives under these conditions, by this code and these libraries."""
    kept = yaml_files.read_yaml(out / "trial.yaml")
    expected = _about(model, run) | _conditions(evaluation, trial_config(run.env, evaluation, changes, device))
    return isinstance(kept, dict) and kept | {"policy": str(model)} == expected  # wherever it was evaluated from


def _about(model: Path, run: TrainConfig) -> dict[str, Any]:
    """What was evaluated, and by which code and versions of the libraries."""
    return {
        "policy": str(model),
        "policy_sha256": hashlib.sha256(model.read_bytes()).hexdigest(),
        "seed": run.seed,
        "envs_version": envs_version(),
        "analysis_version": analysis_version(),
        "versions": provenance.versions(),
        "window_steps": read_published().experiment_4a.window_steps,
    }


def evaluate_lqr(
    config: LqrConfig, evaluation: EvaluationConfig, changes: EnvChanges, device: str, out: Path
) -> list[Result]:
    """Evaluate the model-based controller; see `analyse`. Raises ConfigError where its motion cannot be planned."""
    trial = trial_config(config.env, evaluation, changes, device)
    stander = linearise(segments(trial), trial)
    try:
        motions = [plan(stander, freq, trial.amplitude, evaluation.tolerance, config) for freq in evaluation.freq]
    except InfeasibleError as error:
        raise ConfigError(str(error)) from None
    run_dir.writable(out)
    with preparing():
        env = HeadTrackingEnv(trial, 0, device)
        env.warm_up()
    controller = LqrController(env, motions, config, evaluation.duration)
    about = {"policy": "lqr", "lqr": config.model_dump(mode="json", exclude={"env"})}
    return analyse(env, controller, evaluation, out, about)


def analyse(
    env: HeadTrackingEnv,
    policy: Policy,
    evaluation: EvaluationConfig,
    out: Path,
    about: dict[str, Any],
) -> list[Result]:
    """Roll out `policy` at every frequency of `evaluation`, in one batch, and write to the folder `out`: trajectories.npz,
    metrics.csv, table.md, the figures, and trial.yaml, which says what was evaluated: `about` and the conditions.

    Prints the table and what was written. Returns the rows of metrics.csv.
    """
    # A ramp is the environment's own target.
    freq = torch.tensor(evaluation.freq, dtype=torch.float64) if env.config.ramp is None else None
    trajectory = rollout(env, policy, freq, evaluation.duration)
    rows = measure_trajectory(
        trajectory,
        transient_s=evaluation.transient,
        tolerance_m=evaluation.tolerance,
        still_joint_deg=evaluation.still_joint_deg,
    )
    if env.config.ramp is not None:
        ramp, steps = env.config.ramp, read_published().experiment_4a.window_steps
        still = math.radians(evaluation.still_joint_deg)
        found = transitions(trajectory, ramp.start, ramp.rate, ramp.duration, steps, still)
        rows = [replace(row, ramp=at) for row, at in zip(rows, found, strict=True)]
    rows = with_theory(rows, env.config, evaluation)
    shape = env.sim.geometry
    (out / "trial.yaml").unlink(missing_ok=True)  # what it says is about to be untrue
    trajectory.save(out / "trajectories.npz")
    write_csv(rows, out / "metrics.csv")
    comparable = published(env.config)
    columns = evaluation_columns(rows, comparable)
    with replacing(out / "table.md") as temporary:
        temporary.write_text(markdown_table(rows, columns) + "\n", encoding="utf-8")
    figures = draw_all(trajectory, rows, comparable, out, (shape.heel_x, shape.toe_x)) if evaluation.figures else []
    # Last, since it says that all is there.
    yaml_files.write_yaml(out / "trial.yaml", about | _conditions(evaluation, env.config))
    print(text_table(rows, columns))
    for path in (*(out / name for name in ("metrics.csv", "table.md", "trajectories.npz", "trial.yaml")), *figures):
        print(path)
    return rows


def _conditions(evaluation: EvaluationConfig, env: EnvConfig) -> dict[str, Any]:
    return {"evaluation": evaluation.model_dump(mode="json"), "env": as_plain(env)}


def with_theory(rows: list[Result], env: EnvConfig, evaluation: EvaluationConfig) -> list[Result]:
    """`rows` with the motion of least cost under the same conditions, and the cost over the least cost.

    The least cost is that of the linear model with flat feet and the head within the tolerance: a ratio below one means
    something only beside `beyond_tolerance_share` and `foot_not_flat_share`.
    """
    if env.ramp is not None or evaluation.tolerance >= env.amplitude:
        return rows  # no periodic motion to compare with, or standing still is good enough
    body = segments(env)
    least = [predict(body, env, row.freq_hz, evaluation.tolerance, evaluation.duration).least for row in rows]
    return [replace(row, least=best, cost_ratio=row.cost / best.cost) for row, best in zip(rows, least, strict=True)]


def origin(run: TrainConfig, changes: EnvChanges, name: str) -> Origin:
    """What distinguishes the results of the run `name` from those of other runs."""
    weight = run.env.energy_weight
    return Origin(
        seed=run.seed,
        energy_weight=weight.end if isinstance(weight, Schedule) else weight,
        physics=changes.physics or run.env.physics,
        amplitude_m=changes.amplitude or run.env.amplitude,
        run=name,
    )


def published(env: EnvConfig) -> dict[str, Any]:
    """The published numbers that were measured under the conditions of `env`: ours stand beside nothing else."""
    return {
        name: table
        for name, table in read_published().model_dump(mode="json").items()
        if all(getattr(env, key) == value for key, value in table.get("condition", {}).items())
    }


def trial_config(env: EnvConfig, evaluation: EvaluationConfig, changes: EnvChanges, device: str) -> EnvConfig:
    """The run's environment for a trial: a world a frequency, and nothing but a fall or its duration ends it.

    Raises ConfigError where the trial is too short for its transient, or its engine cannot compute on `device`.
    """
    try:
        check_trial(evaluation, env)
        check_engine(changes.physics or env.physics, device)
    except ValueError as error:
        raise ConfigError(str(error)) from None
    values = env.model_dump()
    values.update({key: value for key, value in changes.model_dump().items() if value is not None})
    values["num_envs"] = len(evaluation.freq)
    values["episode_steps"] = 2 * round(evaluation.duration / env.control_dt) + 1
    values["termination"] |= {"foot_motion": None, "head_tolerance": None}
    return read(EnvConfig, values)
