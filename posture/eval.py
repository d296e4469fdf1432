"""Evaluate a trained policy: the paper's indices, table and figures.

python -m posture.eval                                   # the latest run
python -m posture.eval ckpt=runs/<run>/model_100.pt
python -m posture.eval ckpt=runs/<sweep>                 # every run of a sweep, and one table
python -m posture.eval ckpt=runs/<run> env.load=2
python -m posture.eval policy=lqr                        # the model-based controller, no checkpoint
"""

from dataclasses import replace
from pathlib import Path

from posture.cli import entry
from posture.cli.jobs import identity, override_slug
from posture.cli.sweep import status
from posture.config.errors import ConfigError
from posture.config.eval import EvalConfig
from posture.config.train import TrainConfig
from posture.storage import run_dir

# Modules that import torch or the physics are imported inside functions: bad input must not wait for them.


def evaluate_all(config: EvalConfig, job: Path) -> None:
    """Evaluate every checkpoint that `ckpt` names, each into its own folder; several also share one table.

    `job`: the folder for the results. A single evaluation without `out` has none: its results go into the folder of the run,
    and those of a shipped policy or of the model-based controller into a new one.
    """
    own, new = entry.has_folder(), Path(run_dir.folder_for(str(run_dir.RUNS), None))
    if config.policy == "lqr":
        from posture.evaluation.trial import evaluate_lqr

        evaluate_lqr(config.lqr, config.evaluation, config.env, config.device, job if own else new)
        return
    in_experiment = entry.in_sweep() and entry.experiment() is not None
    models = run_dir.find_checkpoints(config.ckpt, only_current if in_experiment else None)
    runs = [run_dir.read_config(model.parent) for model in models]
    if not own and any(map(run_dir.is_shipped, models)):
        own, job = True, new  # nothing is written into the package
    if all(config.env.ramps(run.env) for run in runs):
        entry.refuse("evaluation.freq", "in a ramp, which the policy was trained on (env.ramp=none ends it)")
    # All checkpoints are checked, which needs torch but no physics, before the first is evaluated.
    from posture.learning.networks import load_policy
    from posture.storage import checkpoint

    for model, run in zip(models, runs, strict=True):
        load_policy(checkpoint.load(model, "cpu"), run, model, "cpu")
    from posture.analysis.results import Result, write_csv
    from posture.evaluation.trial import evaluate, origin

    several = len(models) > 1 or in_experiment
    changes = [] if own else [differences(run, config) for run in runs]
    name = "_".join(["metrics", *next(filter(None, changes), [])])
    table = (job if own else Path(config.ckpt)) / f"{name}.csv"
    if several:
        run_dir.writable(table.parent, table.name)
    results: list[Result] = []
    for model, run in zip(models, runs, strict=True):
        if several:
            print(f"== {model.parent.name}")
        if own:
            folder = job / model.parent.name if several else job
        else:
            folder = model.parent / "_".join(["evaluation", *is_not_final(model, run), *differences(run, config)])
        rows = evaluate(model, run, config.evaluation, config.env, config.device, folder, config.again)
        results += [replace(row, origin=origin(run, config.env, model.parent.name)) for row in rows]
    if several:
        write_csv(results, table)
        print(f"all runs: {table}")


def only_current(run: Path) -> bool:
    """Whether `run` is finished and of the current code if it is a job of an experiment; True for any other run."""
    state = status(run).get("state")
    if state is None:
        return True  # not a job of a sweep
    try:
        return state == "done" and run.name.endswith(identity(run_dir.read_config(run)))
    except ConfigError:
        return False


def is_not_final(model: Path, run: TrainConfig) -> list[str]:
    """The name of a checkpoint in that of a folder, unless it is the final one, which `evaluation` is for."""
    newest = model == run_dir.newest_model(model.parent)
    return [] if newest and run_dir.iteration_of(model) >= run.max_iterations else [model.stem]


def differences(run: TrainConfig, config: EvalConfig) -> list[str]:
    """What distinguishes an evaluation from the run's own, as part of a file name: changes to its environment, then other
    conditions than those that its configuration names. Empty if nothing does."""
    pairs = [
        (run.env.without_ranges().model_dump(), config.env.apply_to(run.env)),
        *[(evaluation.model_dump(exclude={"figures"}) for evaluation in (run.evaluation, config.evaluation))],
    ]
    changed = {key: _changed(own[key], value) for own, tried in pairs for key, value in tried.items() if value != own[key]}
    return [override_slug(",".join(f"{key}={_text(value)}" for key, value in changed.items()))] if changed else []


def _changed(own: object, tried: object) -> object:
    """What of a changed value is changed."""
    if not (isinstance(own, dict) and isinstance(tried, dict)):
        return tried
    return {key: value for key, value in tried.items() if key not in own or value != own[key]}


def _text(value: object) -> str:
    """A value of a configuration in short."""
    if isinstance(value, dict):
        return ",".join(f"{key}:{_text(part)}" for key, part in value.items())
    if isinstance(value, tuple):
        return ",".join(map(_text, value))
    return "none" if value is None else str(value).removesuffix(".0")


def main() -> None:
    """The command `python -m posture.eval`."""
    entry.run("eval", EvalConfig, evaluate_all)


if __name__ == "__main__":
    main()
