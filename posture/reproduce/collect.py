"""Read the results of every experiment's jobs from their folders, and compute the theory for them."""

from __future__ import annotations

import csv
import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from envs.body.mjcf import mjcf
from envs.body.segments import read_segments
from envs.config import EnvConfig, Ramp
from posture.analysis.results import NO_REWARD, Result, RewardOptimum, read_csv
from posture.analysis.trajectory import Trajectory
from posture.cli.jobs import Job
from posture.cli.sweep import fraction_done
from posture.config.errors import ConfigError
from posture.config.eval import EnvChanges, EvalConfig, EvaluationConfig
from posture.config.published import Published
from posture.config.train import TrainConfig
from posture.evaluation.trial import AS_TRAINED, is_current, origin, policy_record
from posture.reproduce.claims.verdict import Transitions
from posture.reproduce.experiments import EVALUATIONS, PUBLISHED, RECIPES
from posture.reproduce.reproduction import (
    Body,
    Dynamics,
    ManyBodies,
    Recipe,
    Reproduction,
    Traces,
    Training,
    last_anti_phase,
)
from posture.reproduce.ship import duration
from posture.storage import provenance, run_dir, yaml_files
from posture.theory.motion import motion_indices
from posture.theory.program import InfeasibleError
from posture.theory.reward_optimum import reward_optimum
from posture.theory.stander import linearise
from posture.theory.transition import bound_transition, hip_ankle_correlation, reward_transition, sinusoid_transition

WITH_REWARD_OPTIMUM = ("frequency", "energy", "load", "hip_stiffness")
"""Experiments whose results are compared with the optimum of the trained reward, too."""


def collect(
    trained: Mapping[str, Sequence[Job]],
    evaluated: Mapping[str, Sequence[Job]],
    search: tuple[float, float],
    paper: Published,
    folder: Path,
) -> Reproduction:
    """Read the results of the jobs that are done, by experiment; at least one policy of Exp. 1 must be.

    The jobs `trained` train policies, the jobs `evaluated` take those that `EVALUATIONS` names. Left out, and named, are
    runs in the same sweeps that none of these jobs made, and results of other code or under other conditions. `search`:
    where theory's transitions are looked for [Hz]. `folder`: of the report, in which `OF_SEVERAL_SEEDS` write, too.
    """
    done = {name: [job for job in jobs if fraction_done(job) >= 1] for name, jobs in trained.items()}
    policies = done["frequency"]
    run = _config(policies[0])
    left_out = [str(folder) for jobs in trained.values() for folder in other_runs(jobs)]
    results = {name: [result for job in jobs for result in _of_training(job, left_out)] for name, jobs in done.items()}
    for name, trials in evaluated.items():
        own = done[EVALUATIONS[name].policies]
        results[name] = [result for job in own for trial in trials for result in _of_trial(trial, job, left_out)]
    # Exp. 3 is compared at one frequency only: each optimum takes half a second.
    at_one = {"hip_stiffness": paper.experiment_3.freq_hz}
    for name in WITH_REWARD_OPTIMUM:
        results[name] = _with_reward_optimum(results.get(name, []), run, at_one.get(name))
    for name in PUBLISHED:
        for kind in (name, f"load_{name}"):
            if results.get(kind):
                results[kind] = _with_reward_optimum(results[kind], _config(done[name][0]), None)
    recipes = [
        _recipe(name, results, _config(done[name][0]), search, paper) for name in RECIPES if results.get(name) and done[name]
    ]
    on_map = _tables(folder / "map", ("agreement", "transitions"), done["map"], left_out)
    asked = _tables(folder / "dynamics", ("findings",), done["human"], left_out)
    (ramp,) = evaluated["ramp"]
    return Reproduction(
        results={name: found for name, found in results.items() if found},
        traces=_traces(policies[0], evaluated, left_out),
        transitions=theory_transitions(run, search),
        body=read_body(run.env),
        trainings=[_training(name, job) for name, jobs in trained.items() for job in jobs],
        run=run,
        left_out=left_out,
        ramp_start=_ramp_start(ramp),
        many_bodies=ManyBodies(folder / "map" / "map.png", *on_map) if on_map else None,
        dynamics=Dynamics(folder / "dynamics" / "dynamics.png", *asked) if asked else None,
        recipes=recipes if len(recipes) > 1 else (),
    )


def other_runs(jobs: Sequence[Job]) -> list[Path]:
    """Runs with a checkpoint in the sweeps of `jobs` that none of `jobs` made: of other physics or another configuration."""
    own = {job.folder for job in jobs}
    sweeps = sorted({folder.parent for folder in own if folder.parent.is_dir()})
    return [run for sweep in sweeps for run in run_dir.runs_in(sweep) if run not in own and run_dir.newest_model(run)]


def theory_transitions(run: TrainConfig, search: tuple[float, float]) -> Transitions:
    """The frequencies at which the modes of the linear stander of `run` switch."""
    tolerance = run.evaluation.tolerance
    stander = linearise(read_segments(run.env), run.env)
    least = bound_transition(stander, run.env.amplitude, tolerance, search)
    reward = reward_transition(stander, run.env, tolerance, search)
    sinusoid = sinusoid_transition(stander, search)
    return Transitions(*(math.nan if hz is None else hz for hz in (least, reward, sinusoid)))


def read_body(env: EnvConfig) -> Body:
    """Read the body from its MJCF."""
    model = mujoco.MjModel.from_xml_string(mjcf(env.body))
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    hip, ankle = (np.degrees(model.joint(f"{name}_left").range) for name in ("hip", "ankle"))
    foot = read_segments(env)
    return Body(
        mass=float(model.body_mass.sum()),
        height=float(data.geom("head").xpos[2] + model.geom("head").size[0]),
        com=np.array(data.subtree_com[model.body("hat").id]),
        hip_range=hip,
        ankle_range=ankle,
        foot_span=(foot.heel_x, foot.toe_x),
    )


def _config(job: Job) -> TrainConfig:
    assert isinstance(job.config, TrainConfig)
    return job.config


def _trial(job: Job) -> EvalConfig:
    assert isinstance(job.config, EvalConfig)
    return job.config


def _ramp_start(job: Job) -> float:
    ramp = _trial(job).env.ramp
    assert isinstance(ramp, Ramp)
    return ramp.start


def _training(experiment: str, job: Job) -> Training:
    name, seed = job.folder.name, _config(job).seed
    if fraction_done(job) < 1:
        return Training(experiment, name, seed)
    return Training(experiment, name, seed, True, duration(job.folder), provenance.whole_starts(job.folder))


def _of_training(job: Job, left_out: list[str]) -> list[Result]:
    """The results of a training's own evaluation."""
    run = _config(job)
    return _read(job, job.folder / "evaluation", run.evaluation, AS_TRAINED, run.device, left_out)


def _of_trial(trial: Job, job: Job, left_out: list[str]) -> list[Result]:
    """The results of the policy that `job` trained, in the evaluation `trial`."""
    config = _trial(trial)
    return _read(job, trial.folder / job.folder.name, config.evaluation, config.env, config.device, left_out)


def _read(
    job: Job, out: Path, evaluation: EvaluationConfig, changes: EnvChanges, device: str, left_out: list[str]
) -> list[Result]:
    """The results in `out`; none if they are of other conditions, another policy or other code, or damaged: `out` joins
    `left_out`."""
    model, run = run_dir.newest_model(job.folder), _config(job)
    if model is None or not is_current(out, model, run, evaluation, changes, device):
        if (out / "trial.yaml").exists() or (out / "metrics.csv").exists():
            left_out.append(str(out))
        return []
    return [replace(result, origin=origin(run, changes, job.folder.name)) for result in read_csv(out / "metrics.csv")]


def _recipe(
    name: str, results: Mapping[str, list[Result]], run: TrainConfig, search: tuple[float, float], paper: Published
) -> Recipe:
    """The experiment `name` of `RECIPES`, whose policies were trained as `run` says, in results and in theory."""
    suffix = "" if name == "frequency" else f"_{name}"

    def optimum_r(freq: float, **changes: float) -> float:
        env = EnvConfig.model_validate(run.env.model_dump() | changes)
        return hip_ankle_correlation(reward_optimum(linearise(body, env), freq, env, run.evaluation.tolerance))

    body = read_segments(run.env)
    third, fourth = paper.experiment_3, paper.table_4
    hip_k, gamma = last_anti_phase(paper)
    reward_hz = reward_transition(linearise(body, run.env), run.env, run.evaluation.tolerance, search)
    return Recipe(
        name,
        results[name],
        results.get(f"ramp{suffix}", []),
        results.get(f"load{suffix}", []),
        math.nan if reward_hz is None else reward_hz,
        optimum_r(third.freq_hz, hip_k=hip_k),
        optimum_r(fourth.freq_hz, energy_weight=gamma),
    )


def _tables(folder: Path, names: Sequence[str], policies: Sequence[Job], left_out: list[str]) -> list[list[dict[str, str]]]:
    """The tables `names` that a command of `OF_SEVERAL_SEEDS` wrote into `folder`; none if they are of other policies or
    other code, or incomplete: `folder` joins `left_out`."""
    models = [(run_dir.newest_model(job.folder), _config(job)) for job in policies]
    expected = [policy_record(model, run) for model, run in models if model is not None]
    if not folder.is_dir():
        return []
    try:
        record = yaml_files.read_yaml(folder / f"{folder.name}.yaml")
        whole = provenance.digests(folder, list(record["sha256"]))["sha256"] == record["sha256"]
        made_of = [policy | {"policy": ""} for policy in record["policies"]] if whole else []
        tables = [_rows(folder / f"{name}.csv") for name in names]
    except (OSError, KeyError, TypeError, ConfigError):
        made_of, tables = [], []
    # The paths of the policies may have been other ones. Results of the first seeds are those of a smaller reproduction.
    if not made_of or any(policy not in [own | {"policy": ""} for own in expected] for policy in made_of):
        left_out.append(str(folder))
        return []
    return tables


def _rows(path: Path) -> list[dict[str, str]]:
    with path.open(newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def _with_reward_optimum(results: Sequence[Result], run: TrainConfig, freq: float | None) -> list[Result]:
    """`results` with the optimum of the trained reward (posture/theory/reward_optimum.py), only at `freq` [Hz] if given."""
    body = read_segments(run.env)

    @cache
    def optimum(freq: float, **changes: float) -> RewardOptimum:
        env = EnvConfig.model_validate(run.env.model_dump() | changes)
        if env.energy_weight == 0:
            return NO_REWARD
        try:
            motion = reward_optimum(linearise(body, env), freq, env, run.evaluation.tolerance)
        except InfeasibleError:
            return NO_REWARD
        found = motion_indices(motion, run.evaluation.duration)
        return RewardOptimum(found.hip_ankle_r, found.cost, found.energy_j)

    def changes(result: Result) -> dict[str, Any]:
        own = result.origin
        varied = {"energy_weight": own.energy_weight, "amplitude": own.amplitude_m}
        return {"hip_k": result.hip_k_nm_per_rad, "load": result.load_kg, **varied}

    return [
        replace(result, reward=optimum(result.freq_hz, **changes(result)))
        if freq is None or math.isclose(result.freq_hz, freq)
        else result
        for result in results
    ]


def _traces(first: Job, evaluated: Mapping[str, Sequence[Job]], left_out: Sequence[str]) -> Traces:
    """Trajectories of the policy of the job `first` of Exp. 1, without those in folders that are left out."""

    def trajectory(folder: Path) -> Trajectory | None:
        file = folder / "trajectories.npz"
        return Trajectory.read(file) if file.exists() and str(folder) not in left_out else None

    load = {_trial(job).env.load: trajectory(job.folder / first.folder.name) for job in evaluated["load"]}
    (ramp,) = evaluated["ramp"]
    return Traces(
        frequency=trajectory(first.folder / "evaluation"),
        ramp=trajectory(ramp.folder / first.folder.name),
        load={kg: found for kg, found in load.items() if kg is not None and found is not None},
    )
