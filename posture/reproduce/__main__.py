"""Reproduce the paper: train and evaluate every experiment, and write one page of claims, measurements and verdicts.

python -m posture.reproduce seeds=1                      # a policy of each condition
python -m posture.reproduce                              # all seeds; what is there already is kept
python -m posture.reproduce stages=[report]              # the page alone, of what has been reached
python -m posture.reproduce launcher=submitit_slurm      # the trainings on a cluster

Every step is a command of its own that it prints before it runs it, so that each can be run alone as well.
"""

import shlex
import subprocess
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from hydra.core.global_hydra import GlobalHydra

from posture.cli import entry, jobs
from posture.cli.jobs import Job
from posture.cli.sweep import SweepProgress, fraction_done, print_summary, report_periodically
from posture.config.errors import ConfigError
from posture.config.eval import EvalConfig
from posture.config.reproduce import ReproduceConfig
from posture.config.train import TrainConfig
from posture.storage import run_dir

TRAININGS = ("frequency", "energy", "hip_stiffness")
"""Experiments that train policies, in the order of their length."""
EVALUATIONS = ("ramp", "load", "amplitude", "engines")
"""Experiments that take the policies of Exp. 1."""
POLICIES = "runs/frequency"
"""Where those are."""
REPORT_EVERY_S = 60.0


def reproduce(config: ReproduceConfig, _folder: Path) -> None:
    """Run the stages that `config` names. Exits with 1 where a job failed; the report is of what was reached."""
    run_dir.writable(Path(config.out))
    with _composing():
        trainings = {name: [*training(name, config), *_launcher(config)] for name in TRAININGS}
        all_jobs = {name: jobs.check("train", TrainConfig, arguments).jobs for name, arguments in trainings.items()}
        wanted = {name: [job for job in found if _seed(job) <= config.seeds] for name, found in all_jobs.items()}
        trials = {name: jobs.check("eval", EvalConfig, evaluation(name, config)).jobs for name in EVALUATIONS}
    to_train = [job for found in wanted.values() for job in found]
    failed = 0
    if "train" in config.stages:
        progress = SweepProgress(to_train)
        with report_periodically(progress, "whole", REPORT_EVERY_S):
            for name in TRAININGS:
                seeds = sorted({_seed(job) for job in wanted[name]})
                failed |= run([*trainings[name], f"seed={','.join(map(str, seeds))}"], "train")
    if "evaluate" in config.stages and any(fraction_done(job) >= 1 for job in wanted["frequency"]):
        for name in EVALUATIONS:
            failed |= run(evaluation(name, config), "eval")
    if "report" in config.stages or "ship" in config.stages:
        # Imported here because they are slow.
        from posture.reproduce.page.document import warnings, write_report
        from posture.reproduce.results import collect
        from posture.reproduce.ship import ship

        results = collect(all_jobs, trials, config.search)
        if results is None:
            raise ConfigError("no policy of Exp. 1 is done: run the stage train first")
        for warning in warnings(results):
            print(warning.replace("**", ""), file=sys.stderr)
        if "report" in config.stages:
            print(write_report(results, Path(config.out), commands(config), _ramp_start(trials["ramp"])))
        if "ship" in config.stages:
            ship(results.jobs)
    if "train" in config.stages and not print_summary(to_train, progress.done_before):
        failed = True
    if failed:
        sys.exit(1)


def training(name: str, config: ReproduceConfig) -> list[str]:
    """Arguments of `python -m posture.train` for an experiment."""
    return ["-m", f"experiment={name}", *config.overrides]


def evaluation(name: str, config: ReproduceConfig) -> list[str]:
    """Arguments of `python -m posture.eval` for an experiment with the policies of Exp. 1."""
    return ["-m", f"experiment={name}", f"ckpt={POLICIES}", *(o for o in config.overrides if o.startswith("evaluation."))]


def commands(config: ReproduceConfig) -> list[str]:
    """The command of each experiment, as a user would type it."""
    lines = [["python", "-m", "posture.train", *training(name, config)] for name in TRAININGS]
    lines += [["python", "-m", "posture.eval", *evaluation(name, config)] for name in EVALUATIONS]
    return [shlex.join(line) for line in lines]


def run(arguments: Sequence[str], name: str) -> bool:
    """Run `python -m posture.<name>` with `arguments`, after printing it; whether it failed."""
    command = ["-m", f"posture.{name}", *arguments]
    print(f"$ python {shlex.join(command)}", flush=True)
    return subprocess.run([sys.executable, *command], check=False).returncode != 0


def _launcher(config: ReproduceConfig) -> list[str]:
    own = [f"hydra.launcher.n_jobs={config.parallel}"] if config.launcher == "joblib" else []
    return [f"hydra/launcher={config.launcher}", *own]


def _ramp_start(trials: Sequence[Job]) -> float:
    (trial,) = trials
    assert isinstance(trial.config, EvalConfig) and trial.config.env.ramp is not None
    return trial.config.env.ramp.start


def _seed(job: Job) -> int:
    assert isinstance(job.config, TrainConfig)
    return job.config.seed


@contextmanager
def _composing() -> Iterator[None]:
    """Within it other command lines can be composed: Hydra knows one at a time."""
    own = GlobalHydra.instance().hydra
    GlobalHydra.instance().clear()
    try:
        yield
    finally:
        GlobalHydra.instance().clear()
        if own is not None:
            GlobalHydra.instance().initialize(own)


def main() -> None:
    """The command `python -m posture.reproduce`."""
    entry.run("reproduce", ReproduceConfig, reproduce)


if __name__ == "__main__":
    main()
