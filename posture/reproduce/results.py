"""The results of a reproduction: what the jobs of every experiment left in their folders, as tidy rows beside the theory."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from envs.body.segments import Segments, read_segments
from envs.config import EnvConfig
from posture.analysis.results import Row, as_row, read_csv
from posture.analysis.trajectory import Trajectory
from posture.cli.jobs import Job
from posture.cli.sweep import fraction_done
from posture.config.eval import EnvChanges, EvalConfig, EvaluationConfig
from posture.config.published import read_published
from posture.config.train import TrainConfig
from posture.evaluation.trial import AS_TRAINED, is_current, origin
from posture.storage import run_dir
from posture.theory.motion import motion_indices
from posture.theory.program import InfeasibleError
from posture.theory.reward_optimum import reward_optimum
from posture.theory.stander import linearise
from posture.theory.transition import bound_transition, reward_transition, sinusoid_transition

BESIDE_THE_REWARD = ("frequency", "energy", "load", "hip_stiffness")
"""Experiments whose rows stand beside the optimum of their reward, too."""


@dataclass(frozen=True)
class Results:
    """What was reached.

    rows: by experiment, a row a seed and condition. traces: trajectories of the first seed by name (see `_traces`).
    transitions: theory's switch frequency [Hz] of the default stander: sinusoid, least, reward. jobs: all that train, done
    or not. first: configuration of the first policy of Exp. 1. left_out: folders of results that are there, but of other
    code, another configuration or another policy than the rest.
    """

    rows: dict[str, list[Row]]
    traces: dict[str, Trajectory]
    transitions: dict[str, float]
    jobs: list[Job]
    first: TrainConfig
    left_out: list[str]


def collect(
    trained: Mapping[str, Sequence[Job]], evaluated: Mapping[str, Sequence[Job]], search: tuple[float, float]
) -> Results | None:
    """Read what the jobs left, by experiment: `trained` trained policies, `evaluated` took those of Exp. 1. None where no
    policy of Exp. 1 is done yet. Jobs that are not done are left out; so are runs that none of these jobs made, and
    evaluations of other code or conditions, which are named.

    `search`: where theory's transitions are looked for [Hz].
    """
    done = {name: [job for job in jobs if fraction_done(job) >= 1] for name, jobs in trained.items()}
    policies = done["frequency"]
    if not policies:
        return None
    first = _config(policies[0])
    others = [str(run) for jobs in trained.values() for run in strangers(jobs)]
    rows = {name: [row for job in jobs for row in _own_rows(job, others)] for name, jobs in done.items()}
    for name, trials in evaluated.items():
        rows[name] = [row for policy in policies for trial in trials for row in _trial_rows(trial, policy, others)]
    alone = {"hip_stiffness": read_published().experiment_3.freq_hz}
    for name in BESIDE_THE_REWARD:
        rows[name] = _beside_the_reward(rows.get(name, []), first, alone.get(name))
    return Results(
        {name: found for name, found in rows.items() if found},
        _traces(done, evaluated, policies[0].folder.name),
        theory_transitions(first, search),
        [job for jobs in trained.values() for job in jobs],
        first,
        others,
    )


def strangers(jobs: Sequence[Job]) -> list[Path]:
    """Runs with a checkpoint beside those of `jobs`: of other code of the physics or another configuration."""
    own = {job.folder for job in jobs}
    runs = [run for sweep in sorted({folder.parent for folder in own}) if sweep.is_dir() for run in run_dir.runs_in(sweep)]
    return [run for run in runs if run not in own and run_dir.newest_model(run)]


def theory_transitions(run: TrainConfig, search: tuple[float, float]) -> dict[str, float]:
    """The switch frequency [Hz] of the stander of `run` by theory, nan where there is none: of the least-torque sinusoid, of
    the least-torque motion within the tolerance, of the optimum of its reward."""
    tolerance = run.evaluation.tolerance
    stander = linearise(read_segments(run.env), run.env)
    found = {
        "sinusoid": sinusoid_transition(stander, search),
        "least": bound_transition(stander, run.env.amplitude, tolerance, search),
        "reward": reward_transition(stander, run.env, tolerance, search),
    }
    return {name: math.nan if freq is None else freq for name, freq in found.items()}


def _config(job: Job) -> TrainConfig:
    assert isinstance(job.config, TrainConfig)
    return job.config


def _own_rows(job: Job, left_out: list[str]) -> list[Row]:
    """The rows of a training's own evaluation."""
    run = _config(job)
    return _rows(job, job.folder / "evaluation", run.evaluation, AS_TRAINED, run.device, left_out)


def _trial_rows(trial: Job, policy: Job, left_out: list[str]) -> list[Row]:
    """The rows of the policy that the job `policy` trained, in the job `trial`."""
    config = trial.config
    assert isinstance(config, EvalConfig)
    return _rows(policy, trial.folder / policy.folder.name, config.evaluation, config.env, config.device, left_out)


def _rows(
    policy: Job, out: Path, evaluation: EvaluationConfig, changes: EnvChanges, device: str, left_out: list[str]
) -> list[Row]:
    """What `out` holds of a policy; nothing where that is of other conditions, another policy or other code: then it is
    added to `left_out`."""
    model, run = run_dir.newest_model(policy.folder), _config(policy)
    if model is None or not is_current(out, model, run, evaluation, changes, device):
        if (out / "metrics.csv").exists():
            left_out.append(str(out))
        return []
    of = origin(run, changes, policy.folder.name)
    return [as_row(replace(row, origin=of)) for row in read_csv(out / "metrics.csv")]


def _beside_the_reward(rows: Sequence[Row], run: TrainConfig, freq: float | None) -> list[Row]:
    """`rows` with the columns reward_* of the optimum of the reward that was trained (posture/theory/reward_optimum.py):
    hip_ankle_r, cost, energy_j; nan where it prefers no motion. `freq` [Hz]: at this one alone, since each takes half a
    second."""
    body = read_segments(run.env)
    known: dict[tuple[float, ...], Row] = {}
    joined = []
    for row in rows:
        key = tuple(row[name] for name in ("freq_hz", "hip_k_nm_per_rad", "load_kg", "energy_weight", "amplitude_m"))
        if key not in known:
            wanted = freq is None or math.isclose(row["freq_hz"], freq)
            known[key] = _best(body, run, *key) if wanted else _NOTHING
        joined.append({**row, **known[key]})
    return joined


def _best(
    body: Segments, run: TrainConfig, freq: float, hip_k: float, load: float, energy_weight: float, amplitude: float
) -> Row:
    changes = {"hip_k": hip_k, "load": load, "energy_weight": energy_weight, "amplitude": amplitude}
    env = EnvConfig.model_validate(run.env.model_dump() | changes)
    if energy_weight == 0:
        return _NOTHING
    try:
        motion = reward_optimum(linearise(body, env), freq, env, run.evaluation.tolerance)
    except InfeasibleError:
        return _NOTHING
    found = motion_indices(motion, run.evaluation.duration)
    return {"reward_hip_ankle_r": found.hip_ankle_r, "reward_cost": found.cost, "reward_energy_j": found.energy_j}


_NOTHING = {f"reward_{name}": math.nan for name in ("hip_ankle_r", "cost", "energy_j")}


def _traces(done: Mapping[str, Sequence[Job]], evaluated: Mapping[str, Sequence[Job]], first: str) -> dict[str, Trajectory]:
    """Trajectories of the first seed that is done: frequency (a world a frequency), energy_<gamma>, hip_<k> (a world a
    frequency); and of the run `first` of Exp. 1: ramp and load_<kg>."""
    found: dict[str, Path] = {}
    for name, label, value in (
        ("frequency", "frequency", None),
        ("energy", "energy", "energy_weight"),
        ("hip_stiffness", "hip", "hip_k"),
    ):
        for job in done[name]:
            env = _config(job).env
            key = label if value is None else f"{label}_{getattr(env, value):g}"
            found.setdefault(key, job.folder / "evaluation")
    for name in ("ramp", "load"):
        for job in evaluated[name]:
            assert isinstance(job.config, EvalConfig)
            key = name if name == "ramp" else f"load_{job.config.env.load:g}"
            found.setdefault(key, job.folder / first)
    files = {name: folder / "trajectories.npz" for name, folder in found.items()}
    return {name: Trajectory.read(file) for name, file in files.items() if file.exists()}
