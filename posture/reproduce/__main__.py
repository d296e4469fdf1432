"""Reproduce the paper: train and evaluate every experiment, and write one page of claims, measurements and verdicts.

python -m posture.reproduce seeds=1                      # a policy of each condition
python -m posture.reproduce                              # all seeds; finished jobs are not repeated
python -m posture.reproduce stages=[report]              # only the page, from the results so far
python -m posture.reproduce launcher=submitit_slurm      # the trainings on a cluster

Trainings and evaluations are separate commands. Each is printed before it is run, and can also be run separately.
"""

import shlex
import signal
import subprocess
import sys
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from hydra.core.global_hydra import GlobalHydra

from posture.cli import entry, jobs, signals
from posture.cli.jobs import Job
from posture.cli.sweep import SweepProgress, fraction_done, print_summary, report_periodically
from posture.config.dynamics import DynamicsConfig
from posture.config.errors import ConfigError, RunError
from posture.config.eval import EvalConfig
from posture.config.map import MapConfig
from posture.config.published import read_published
from posture.config.reproduce import ReproduceConfig
from posture.config.train import TrainConfig
from posture.reproduce.experiments import EVALUATIONS, OF_SEVERAL_SEEDS, TRAININGS
from posture.reproduce.page import text
from posture.reproduce.ship import archive, ship
from posture.storage import run_dir

REPORT_EVERY_S = 60.0
POLL_S = 0.1
"""Pause between two looks at the commands that run [s]."""
_KINDS: Mapping[str, type[MapConfig | DynamicsConfig]] = {"map": MapConfig, "dynamics": DynamicsConfig}
"""The configurations of the commands of `OF_SEVERAL_SEEDS`."""


@dataclass(frozen=True)
class Plan:
    """The jobs by experiment: trainings, those of them with the requested `seeds`, and evaluations."""

    trainings: Mapping[str, Sequence[Job]]
    wanted: Mapping[str, Sequence[Job]]
    evaluations: Mapping[str, Sequence[Job]]


def reproduce(config: ReproduceConfig, folder: Path) -> None:
    """Run the stages of `config`; the report goes into `folder`. Raises RunError if a job failed; the report shows the
    results so far."""
    check_files(config, folder)
    plan = make_plan(config, folder)
    wanted = [job for own in plan.wanted.values() for job in own]
    progress = SweepProgress(wanted)
    failed = False
    if "train" in config.stages:
        failed |= train(plan, config, progress)
    if "evaluate" in config.stages:
        done = {name: [job for job in own if fraction_done(job) >= 1] for name, own in plan.wanted.items()}
        failed |= any([run("eval", evaluation(name, config)) for name in EVALUATIONS if done[EVALUATIONS[name].policies]])
        for command, experiment in OF_SEVERAL_SEEDS.items():
            if done[experiment]:
                failed |= run(command, of_several_seeds(command, done[experiment], config, folder))
    if "report" in config.stages or "ship" in config.stages:
        report(plan, config, folder)
    if "archive" in config.stages:
        archive(plan.trainings, folder / "policies")
    if "train" in config.stages:
        failed |= not print_summary(wanted, progress.done_before)
    if failed:
        raise RunError("a training or an evaluation failed, see above; the same command tries again")


def check_files(config: ReproduceConfig, folder: Path) -> None:
    """Raise ConfigError if a file of the report or of the archive cannot be written to `folder`."""
    run_dir.writable(folder, "report.html", "summary.md", "provenance.yaml")
    run_dir.writable(folder / "tables", *(f"{name}.csv" for name in (*TRAININGS, *EVALUATIONS, "verdicts")))
    run_dir.writable(folder / "figures", *(f"{name}.png" for name in text.FIGURES))
    if "archive" in config.stages:
        run_dir.writable(folder / "policies")


def make_plan(config: ReproduceConfig, folder: Path) -> Plan:
    """Compose and check the jobs of every experiment, whose report goes into `folder`.

    Raises ConfigError for a wrong override, and if nothing is done that the stages need. That is found as early as possible,
    since composing all jobs is slow.
    """
    GlobalHydra.instance().clear()  # Hydra composes one command line at a time
    trainings: dict[str, Sequence[Job]] = {}
    for name in TRAININGS:  # Exp. 1 is the first
        trainings[name] = jobs.check("train", TrainConfig, [*training(name, config), *_launcher(config)]).jobs
        if name == "frequency" and not {"train", "evaluate"} & set(config.stages):
            _check_done(trainings[name])
    wanted = {
        name: [job for job in own if name in config.experiments and _seed(job) <= config.seeds]
        for name, own in trainings.items()
    }
    if "train" not in config.stages and "evaluate" in config.stages:
        _check_done([job for own in wanted.values() for job in own])
    for command, experiment in OF_SEVERAL_SEEDS.items():
        if "evaluate" in config.stages and wanted[experiment]:
            jobs.check(command, _KINDS[command], of_several_seeds(command, wanted[experiment], config, folder))
    evaluations = {name: jobs.check("eval", EvalConfig, evaluation(name, config)).jobs for name in EVALUATIONS}
    return Plan(trainings, wanted, evaluations)


def train(plan: Plan, config: ReproduceConfig, progress: SweepProgress) -> bool:
    """Run the trainings that are not done, with a progress line at intervals; return whether a sweep failed.

    A sweep of one job, or of an odd number, would leave cores idle. With joblib the jobs of all experiments are therefore
    run first, each by a command of its own. The sweeps then find them done, evaluate where that is missing, and try again
    what failed.
    """
    failed = False
    with report_periodically(progress, "whole", REPORT_EVERY_S):
        if config.launcher == "joblib":
            missing = [(name, job) for name in config.experiments for job in plan.wanted[name] if fraction_done(job) < 1]
            run_at_once(
                [Start("train", [*training(name, config), *job.own], job.folder) for name, job in missing], config.parallel
            )
        for name in config.experiments:
            seeds = sorted({_seed(job) for job in plan.wanted[name]})
            failed |= run("train", [*training(name, config), *_launcher(config), f"seed={','.join(map(str, seeds))}"])
    return failed


def report(plan: Plan, config: ReproduceConfig, folder: Path) -> None:
    """Write the page to `folder` and ship policies, as the stages say. Raises ConfigError if there is nothing to report."""
    _check_done(plan.trainings["frequency"])
    # Imported here because they are slow.
    from posture.reproduce.collect import collect
    from posture.reproduce.page.provenance import warnings
    from posture.reproduce.page.report import write_report

    paper = read_published()
    reproduction = collect(plan.trainings, plan.evaluations, config.search, paper, folder)
    for warning in warnings(reproduction.trainings, reproduction.left_out):
        print(warning.replace("**", ""), file=sys.stderr)
    if "report" in config.stages:
        print(write_report(reproduction, paper, config.report, folder, commands(config)))
    if "ship" in config.stages:
        ship([job for own in plan.trainings.values() for job in own], config.report.shipped_seed)


def _check_done(policies: Sequence[Job]) -> None:
    if not any(fraction_done(job) >= 1 for job in policies):
        names = ", ".join(dict.fromkeys(job.folder.parent.name for job in policies))
        raise ConfigError(f"no policy of {names} is done: run the stage train first, which keeps what is trained")


def training(name: str, config: ReproduceConfig) -> list[str]:
    """Arguments of `python -m posture.train` for an experiment."""
    return ["-m", f"experiment={name}", *config.overrides]


def evaluation(name: str, config: ReproduceConfig) -> list[str]:
    """Arguments of `python -m posture.eval` for one of `EVALUATIONS`."""
    trial = EVALUATIONS[name]
    own = _of_evaluation(config, "freq" if trial.experiment == "ramp" else "")  # it takes the place of the frequencies
    return ["-m", f"experiment={trial.experiment}", f"ckpt=runs/{trial.policies}", *own]


def of_several_seeds(command: str, policies: Sequence[Job], config: ReproduceConfig, folder: Path) -> list[str]:
    """Arguments of one of `OF_SEVERAL_SEEDS` for the `policies`; its results go into the folder of the report."""
    own = _of_evaluation(config, "freq", "figures")
    ckpt = ",".join(jobs.quoted(job.folder) for job in policies)
    return [f"ckpt=[{ckpt}]", "again=false", f"out={jobs.quoted(folder / command)}", *own]


def _of_evaluation(config: ReproduceConfig, *without: str) -> list[str]:
    """The overrides of evaluations, but for those of the keys `without`."""
    left_out = tuple(f"evaluation.{key}=" for key in without)
    return [o for o in config.overrides if o.startswith("evaluation.") and not o.startswith(left_out)]


def commands(config: ReproduceConfig) -> list[str]:
    """The command of each experiment, as a user would type it."""
    lines = [["python", "-m", "posture.train", *training(name, config)] for name in TRAININGS]
    lines += [["python", "-m", "posture.eval", *evaluation(name, config)] for name in EVALUATIONS]
    lines += [["python", "-m", f"posture.{name}", f"ckpt=runs/{policies}"] for name, policies in OF_SEVERAL_SEEDS.items()]
    return [shlex.join(line) for line in lines]


@dataclass(frozen=True)
class Start:
    """A start of `python -m posture.<name>` with `arguments`. folder: where log.txt takes its output; None: the terminal."""

    name: str
    arguments: Sequence[str]
    folder: Path | None = None

    def begin(self) -> subprocess.Popen[bytes]:
        """Print the command, and start it."""
        command = ["-m", f"posture.{self.name}", *self.arguments]
        print(f"$ python {shlex.join(command)}", flush=True)
        if self.folder is None:
            return subprocess.Popen([sys.executable, *command])
        self.folder.mkdir(parents=True, exist_ok=True)
        with (self.folder / "log.txt").open("ab") as log:
            return subprocess.Popen([sys.executable, *command], stdout=log, stderr=log)


def run(name: str, arguments: Sequence[str]) -> bool:
    """Print and run `python -m posture.<name>` with `arguments`; whether it failed."""
    return run_at_once([Start(name, arguments)], 1)


def run_at_once(commands: Sequence[Start], most: int) -> bool:
    """Run `commands`, `most` of them at the same time; whether one failed. They end before a signal ends this."""
    waiting, running, failed = list(commands), list[subprocess.Popen[bytes]](), False
    try:
        while waiting or running:
            while waiting and len(running) < most:
                running.append(waiting.pop(0).begin())
            time.sleep(POLL_S)
            ended = [child for child in running if child.poll() is not None]
            failed |= any(child.returncode for child in ended)
            running = [child for child in running if child not in ended]
    except signals.Stopped as stop:
        try:
            for child in running:
                if stop.number != signal.SIGINT:  # Ctrl-C reaches all
                    child.send_signal(stop.number)
            for child in running:
                child.wait()  # it saves
        except signals.Stopped:
            for child in running:
                child.kill()
        raise
    return failed


def _launcher(config: ReproduceConfig) -> list[str]:
    parallel = [f"hydra.launcher.n_jobs={config.parallel}"] if config.launcher == "joblib" else []
    return [f"hydra/launcher={config.launcher}", *parallel]


def _seed(job: Job) -> int:
    assert isinstance(job.config, TrainConfig)
    return job.config.seed


def main() -> None:
    """The command `python -m posture.reproduce`."""
    entry.run("reproduce", ReproduceConfig, reproduce)


if __name__ == "__main__":
    main()
