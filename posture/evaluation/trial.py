"""The evaluation of a policy: from a checkpoint to trajectories, results, table and figures."""

import contextlib
import hashlib
import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import torch

from envs.body.segments import read_segments
from envs.config import EnvConfig, Schedule, as_plain
from envs.task.head_tracking import HeadTrackingEnv
from posture.analysis import figures
from posture.analysis.coordination import measure_trajectory
from posture.analysis.ramp import transitions
from posture.analysis.results import Origin, Result, read_csv, write_csv
from posture.analysis.table import evaluation_columns, markdown_table, text_table
from posture.analysis.trajectory import Trajectory
from posture.config.checks import check_engine
from posture.config.errors import ConfigError
from posture.config.eval import BodyChanges, EnvChanges, EvaluationConfig, LqrConfig, SolverChanges, check_trial
from posture.config.published import Table3, read_published
from posture.config.reading import read
from posture.config.train import TrainConfig
from posture.evaluation.lqr_policy import LqrController
from posture.evaluation.rollout import Policy, rollout
from posture.learning.networks import load_policy
from posture.learning.progress import preparing
from posture.storage import checkpoint, provenance, run_dir, yaml_files
from posture.storage.atomic import replacing
from posture.storage.lock import locked
from posture.theory.lqr import plan
from posture.theory.nonlinear import exact_stander
from posture.theory.prediction import predict
from posture.theory.program import InfeasibleError

AS_TRAINED = EnvChanges(
    hip_k=None,
    ankle_k=None,
    load=None,
    load_at=None,
    amplitude=None,
    body=BodyChanges(mass=None, height=None, sex=None),
    physics=None,
    ramp=None,
    solver=SolverChanges(contact_bias=None),
)
RESULTS = ("trajectories.npz", "metrics.csv")
"""Files that are read again; trial.yaml has their digests."""
FILES = (*RESULTS, "table.md", "trial.yaml")


def evaluate_at(
    freq: Sequence[float], ckpt: str = "pretrained", duration: float | None = None, **changes: Any
) -> tuple[list[Result], Trajectory]:
    """Evaluate one policy at the frequencies `freq` [Hz], in one batch, for use in a program: nothing is written or printed.

    `ckpt` is what `posture.eval` accepts, `duration` [s] that of the run's own evaluation if None, and `changes` those of
    `EnvChanges`, such as hip_k=60 [Nm/rad] or load=4 [kg]. Returns a result for each frequency and the roll-out, whose world
    i is that of `freq`[i]. Raises ConfigError where an argument is not allowed.
    """
    model = run_dir.find_checkpoint(ckpt)
    run = run_dir.read_config(model.parent)
    wanted = {"freq": tuple(freq), "duration": run.evaluation.duration if duration is None else duration}
    evaluation = read(EvaluationConfig, run.evaluation.model_dump() | wanted)
    as_asked = read(EnvChanges, AS_TRAINED.model_dump() | {"ramp": "none"} | changes)
    env, policy = open_trial(model, run, trial_config(run.env, evaluation, as_asked, "cpu"), "cpu")
    return measure_policy(env, policy, evaluation)


def evaluate_run(run: Path, config: TrainConfig) -> list[Result]:
    """Evaluate the newest checkpoint of `run` as its configuration says, unless that was done before; print the table."""
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
    """Evaluate the deterministic policy of checkpoint `model` of a run; see `evaluate_policy`.

    With `again` false, results of the same policy, code and conditions in `out` are read instead.
    """
    checkpoint.load(model, device)  # a damaged file is refused before anything is written
    trial = trial_config(run.env, evaluation, changes, device)
    with _reserved(out, evaluation):
        if not again and is_current(out, model, run, evaluation, changes, device):
            rows = read_csv(out / "metrics.csv")
            print(text_table(rows, evaluation_columns(rows, comparable_table_3(trial))))
            print(f"evaluated before: {out}")
            return rows
        env, policy = open_trial(model, run, trial, device)
        return evaluate_policy(env, policy, evaluation, out, policy_record(model, run))


@contextlib.contextmanager
def _reserved(out: Path, evaluation: EvaluationConfig) -> Iterator[None]:
    """In this context only this process evaluates into the folder `out`. Raises ConfigError if another one does, or if one
    of the files cannot be written."""
    run_dir.writable(out, *FILES, *(figures.FILES if evaluation.figures else ()))
    with locked(out):
        yield


def open_trial(model: Path, run: TrainConfig, trial: EnvConfig, device: str) -> tuple[HeadTrackingEnv, Policy]:
    """The environment of a trial and the deterministic policy of checkpoint `model`, ready for `rollout`."""
    content = checkpoint.load(model, device)
    with preparing():
        env = HeadTrackingEnv(trial, run.seed, device)
        policy = load_policy(content, run, model, env.sim.device)
        env.warm_up()
    return env, policy


def evaluate_lqr(
    config: LqrConfig, evaluation: EvaluationConfig, changes: EnvChanges, device: str, out: Path
) -> list[Result]:
    """Evaluate the model-based controller; see `evaluate_policy`. Raises ConfigError where its motion cannot be planned."""
    trial = trial_config(config.env, evaluation, changes, device)
    stander = exact_stander(read_segments(trial), trial)
    try:
        motions = [plan(stander, freq, trial.amplitude, evaluation.tolerance, config) for freq in evaluation.freq]
    except InfeasibleError as error:
        raise ConfigError(str(error)) from None
    record = {"policy": "lqr", "lqr": config.model_dump(mode="json", exclude={"env"})}
    with _reserved(out, evaluation):
        with preparing():
            env = HeadTrackingEnv(trial, 0, device)
            env.warm_up()
        controller = LqrController(env, motions, config, evaluation.duration)
        return evaluate_policy(env, controller, evaluation, out, record)


def evaluate_policy(
    env: HeadTrackingEnv, policy: Policy, evaluation: EvaluationConfig, out: Path, record: dict[str, Any]
) -> list[Result]:
    """Roll out `policy` at every frequency of `evaluation`, in one batch, and return one result for each.

    Writes into the folder `out`: trajectories.npz, metrics.csv, table.md, the figures, and trial.yaml with the conditions
    and `record`, which identifies the policy. Prints the table and the paths.
    """
    rows, trajectory = measure_policy(env, policy, evaluation)
    published = comparable_table_3(env.config)
    columns = evaluation_columns(rows, published)

    (out / "trial.yaml").unlink(missing_ok=True)  # it marks the folder as complete
    trajectory.save(out / "trajectories.npz")
    write_csv(rows, out / "metrics.csv")
    with replacing(out / "table.md") as temporary:
        temporary.write_text(markdown_table(rows, columns) + "\n", encoding="utf-8")
    foot = env.sim.geometry.heel_x, env.sim.geometry.toe_x
    drawn = figures.draw_all(trajectory, rows, published, out, foot) if evaluation.figures else []
    yaml_files.write_yaml(
        out / "trial.yaml", record | _conditions(evaluation, env.config) | provenance.digests(out, RESULTS)
    )

    print(text_table(rows, columns))
    for path in (*(out / name for name in FILES), *drawn):
        print(path)
    return rows


def measure_policy(env: HeadTrackingEnv, policy: Policy, evaluation: EvaluationConfig) -> tuple[list[Result], Trajectory]:
    """Roll out `policy` at every frequency of `evaluation`; a result for each, with the theory, and the roll-out."""
    # The target of a ramp is the environment's own.
    freq = torch.tensor(evaluation.freq, dtype=torch.float64) if env.config.ramp is None else None
    trajectory = rollout(env, policy, freq, evaluation.duration)
    return with_theory(_measure(trajectory, env.config, evaluation), env.config, evaluation), trajectory


def _measure(trajectory: Trajectory, env: EnvConfig, evaluation: EvaluationConfig) -> list[Result]:
    """The measured part of the results, of a ramp with its transitions."""
    rows = measure_trajectory(
        trajectory,
        transient_s=evaluation.transient,
        tolerance_m=evaluation.tolerance,
        still_joint_deg=evaluation.still_joint_deg,
    )
    if env.ramp is None:
        return rows
    window, still = read_published().experiment_4a.window_steps, math.radians(evaluation.still_joint_deg)
    found = transitions(trajectory, env.ramp.start, env.ramp.rate, env.ramp.duration, window, still)
    return [replace(row, ramp=ramp) for row, ramp in zip(rows, found, strict=True)]


def is_current(
    out: Path, model: Path, run: TrainConfig, evaluation: EvaluationConfig, changes: EnvChanges, device: str
) -> bool:
    """Whether `out` holds the results of the policy of `model` under these conditions, by this code and these libraries, and
    as they were written."""
    found = yaml_files.read_yaml(out / "trial.yaml")
    expected = policy_record(model, run) | _conditions(evaluation, trial_config(run.env, evaluation, changes, device))
    try:
        expected |= provenance.digests(out, RESULTS)
    except OSError:
        return False
    # The path of the policy may have been another one.
    return isinstance(found, dict) and found | {"policy": str(model)} == expected


def policy_record(model: Path, run: TrainConfig) -> dict[str, Any]:
    """Identification of the policy, and of the code and library versions that evaluated it."""
    return {
        "policy": str(model),
        "policy_sha256": hashlib.sha256(model.read_bytes()).hexdigest(),
        "seed": run.seed,
        "training_code": provenance.training_code(),
        "analysis_code": provenance.analysis_code(),
        "versions": provenance.library_versions(),
        "window_steps": read_published().experiment_4a.window_steps,
    }


def _conditions(evaluation: EvaluationConfig, env: EnvConfig) -> dict[str, Any]:
    """The conditions of an evaluation, on which its numbers depend."""
    return {"evaluation": evaluation.model_dump(mode="json", exclude={"figures"}), "env": as_plain(env)}


def with_theory(rows: list[Result], env: EnvConfig, evaluation: EvaluationConfig) -> list[Result]:
    """`rows` with the motion of least cost under the same conditions, and the cost over the least cost.

    The least cost is that of the linear model with flat feet and the head within the tolerance: a ratio below one means
    something only beside `beyond_tolerance_share` and `foot_not_flat_share`.
    """
    if env.ramp is not None or evaluation.tolerance >= env.amplitude:
        return rows  # no periodic motion to compare with, or standing still is good enough
    body = read_segments(env)
    least = [predict(body, env, row.freq_hz, evaluation.tolerance, evaluation.duration).least for row in rows]
    return [replace(row, least=best, cost_ratio=row.cost / best.cost) for row, best in zip(rows, least, strict=True)]


def origin(run: TrainConfig, changes: EnvChanges, name: str) -> Origin:
    """The columns that distinguish the results of the run `name` from those of other runs."""
    weight = run.env.energy_weight
    return Origin(
        seed=run.seed,
        energy_weight=weight.end if isinstance(weight, Schedule) else weight,
        physics=changes.physics or run.env.physics,
        amplitude_m=changes.amplitude or run.env.amplitude,
        run=name,
    )


def comparable_table_3(env: EnvConfig) -> Table3 | None:
    """Paper Table 3, if it was measured under the conditions of `env`."""
    table = read_published().table_3
    return table if env.body is None and all(getattr(env, key) == value for key, value in table.condition) else None


def trial_config(env: EnvConfig, evaluation: EvaluationConfig, changes: EnvChanges, device: str) -> EnvConfig:
    """The run's environment for a trial: one world for each frequency; only a fall or its duration ends it.

    Raises ConfigError where the trial is too short for its transient, or its engine cannot compute on `device`.
    """
    try:
        check_trial(evaluation, env)
        check_engine(changes.physics or env.physics, device)
    except ValueError as error:
        raise ConfigError(str(error)) from None
    values = changes.apply_to(env)
    values["num_envs"] = len(evaluation.freq)
    values["episode_steps"] = 2 * round(evaluation.duration / env.control_dt) + 1
    values["termination"] |= {"foot_motion": None, "head_tolerance": None}
    if env.ranges.tolerance is not None:  # the policy may observe it
        values["reward"]["tolerance"] = evaluation.tolerance
    try:
        return read(EnvConfig, values)
    except ConfigError as error:
        raise ConfigError(f"env.{error}") from None
