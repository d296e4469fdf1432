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
from posture.config.eval import EnvChanges, EvalConfig
from posture.config.train import TrainConfig
from posture.storage import run_dir

# Modules that import torch or the physics are imported inside functions: bad input must not wait for them.


def evaluate_all(config: EvalConfig, job: Path) -> None:
    """Evaluate every checkpoint that `ckpt` names, each into its own folder; several also share one table.

    `job`: the folder of a sweep's job. The shared table goes there, and so does everything else where the
    sweep is that of an experiment.
    """
    out = None if config.out is None else run_dir.writable(Path(config.out))
    if config.policy == "lqr":
        from posture.evaluation.trial import evaluate_lqr

        folder = out or Path(run_dir.folder_for(str(run_dir.RUNS), None)) / "evaluation"
        evaluate_lqr(config.lqr, config.evaluation, config.env, config.device, folder)
        return
    in_experiment = entry.in_sweep() and entry.experiment() is not None
    models = run_dir.find_checkpoints(config.ckpt, only_current if in_experiment else None)
    runs = [run_dir.read_config(model.parent) for model in models]
    # All checkpoints are checked, which needs torch but no physics, before the first is evaluated.
    from posture.learning.networks import load_policy
    from posture.storage import checkpoint

    for model, run in zip(models, runs, strict=True):
        load_policy(checkpoint.load(model, "cpu"), run, model, "cpu")
    from posture.analysis.results import Result, write_csv
    from posture.evaluation.trial import evaluate, origin

    results: list[Result] = []
    home = None
    for model, run in zip(models, runs, strict=True):
        if run_dir.is_shipped(model):
            home = home or Path(run_dir.folder_for(str(run_dir.RUNS), None))  # nothing is written into the package
        folder = (home or model.parent) / folder_name(model, run, config.env) if out is None else out
        if len(models) > 1:
            print(f"== {model.parent.name}")
            folder = folder if out is None else out / model.parent.name
        if in_experiment and out is None:
            folder = job / model.parent.name
        rows = evaluate(model, run, config.evaluation, config.env, config.device, folder, config.again)
        results += [replace(row, origin=origin(run, config.env, model.parent.name)) for row in rows]
    if len(models) > 1 or in_experiment:
        table = (out or (job if entry.in_sweep() else Path(config.ckpt))) / "metrics.csv"
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


def folder_name(model: Path, run: TrainConfig, changes: EnvChanges) -> str:
    """Name of the folder of an evaluation: `evaluation` for the final policy in the environment that it was trained in.

    Other checkpoints and changed environments have folders of their own, and so does the newest checkpoint of an unfinished
    training, because `evaluation` is for the final one.
    """
    changed = {key: value for key, value in changes.model_dump().items() if value is not None}
    newest = model == run_dir.newest_model(model.parent)
    parts = [] if newest and run_dir.iteration_of(model) >= run.max_iterations else [model.stem]
    parts += [f"{key}={format(value, 'g') if isinstance(value, float) else value}" for key, value in changed.items()]
    return f"evaluation_{override_slug(','.join(parts))}" if parts else "evaluation"


def main() -> None:
    """The command `python -m posture.eval`."""
    entry.run("eval", EvalConfig, evaluate_all)


if __name__ == "__main__":
    main()
