"""Hysteresis, fluctuations and recovery of a policy, or of several seeds, beside what is reported of people.

python -m posture.dynamics ckpt=runs/<run>
python -m posture.dynamics ckpt=runs/human what=[staircase,ramp] repeats=16
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from posture.cli import entry
from posture.config.dynamics import DynamicsConfig, check_trials
from posture.config.errors import ConfigError
from posture.storage import checkpoint, provenance, run_dir, yaml_files

FILES = (
    *("staircase.csv", "switches.csv", "fluctuation.csv", "relaxation.csv"),
    *("findings.csv", "dynamics.png", "dynamics.yaml"),
)


def examine(config: DynamicsConfig, folder: Path) -> None:
    """Run the trials of `config.what` with every policy; write tables and figure to `folder`, and print the findings."""
    # Imported here because they are slow.
    from posture.analysis.results import write_rows
    from posture.dynamics import courses, measures, trials
    from posture.dynamics.figure import draw
    from posture.dynamics.findings import findings
    from posture.evaluation.trial import policy_record
    from posture.learning.networks import load_policy

    models = run_dir.find_checkpoints(config.ckpt)
    runs = [run_dir.read_config(model.parent) for model in models]
    if len({run.seed for run in runs}) < len(runs):
        raise ConfigError(f"ckpt: {config.ckpt} holds several policies of one seed; allowed is one of each")
    for model, run in zip(models, runs, strict=True):
        load_policy(checkpoint.load(model, "cpu"), run, model, "cpu")
    record = {
        "policies": [policy_record(model, run) for model, run in zip(models, runs, strict=True)],
        "dynamics": config.model_dump(mode="json", exclude={"ckpt", "out", "again", "device"}),
    }
    run_dir.writable(folder, *FILES)
    if not config.again and yaml_files.read_yaml(folder / "dynamics.yaml") == record | provenance.digests_of_existing(
        folder, FILES[:-1]
    ):
        print(f"made before: {folder}")
        return
    steps: list[measures.StepRow] = []
    ramps: list[measures.SwitchRow] = []
    fluctuation: list[measures.FluctuationRow] = []
    relaxation: list[measures.RelaxationRow] = []
    for model, run in zip(models, runs, strict=True):
        asked, note = config, ""
        if not run.env.is_noisy and config.repeats > 1:
            asked, note = config.model_copy(update={"repeats": 1}), "; without noise all repeats are the same: one is made"
        print(f"== seed {run.seed}: {', '.join(config.what)}{note}", flush=True)
        dt = run.env.control_dt
        if "staircase" in config.what:
            for course, freq in asked.staircase.courses.items():
                stairs = courses.staircase(freq, asked.staircase, dt)
                trajectory = trials.following(model, run, courses.frequency_of(stairs), asked)
                steps += measures.steps_of(trajectory, stairs, course, run.seed, asked)
        if "ramp" in config.what:
            ramp = courses.up_and_down(asked.ramp, dt)
            ramps += measures.switches_of_ramp(trials.following(model, run, ramp, asked), ramp, run.seed, asked)
        if "fluctuation" in config.what:
            fluctuation += measures.fluctuations_of(trials.constant(model, run, asked), run.seed, asked)
        if "perturbation" in config.what:
            relaxation += measures.relaxations_of(*trials.pushed_and_twin(model, run, asked), run.seed, asked)
    switches = measures.switches_of_steps(steps) + ramps
    found = findings(switches, fluctuation, relaxation, config.near)
    (folder / "dynamics.yaml").unlink(missing_ok=True)  # it describes an earlier start
    tables: tuple[Sequence[Any], ...] = (steps, switches, fluctuation, relaxation, found)
    for name, rows in zip(FILES, tables, strict=False):
        if rows:
            write_rows([asdict(row) for row in rows], folder / name)
        else:
            (folder / name).unlink(missing_ok=True)
    if steps or fluctuation or relaxation:
        draw(steps, fluctuation, relaxation, folder / "dynamics.png")
    else:
        (folder / "dynamics.png").unlink(missing_ok=True)
    yaml_files.write_yaml(folder / "dynamics.yaml", record | provenance.digests_of_existing(folder, FILES[:-1]))
    import tabulate

    print(tabulate.tabulate([asdict(row) for row in found], "keys", floatfmt=".3g"))
    print(*(folder / name for name in FILES if (folder / name).exists()), sep="\n")


def check(configs: Sequence[DynamicsConfig], in_sweep: bool) -> None:
    """Raise ConfigError if there is no policy for one of the jobs, or its control steps do not suit the trials."""
    for config in configs:
        for model in run_dir.find_checkpoints(config.ckpt):
            try:
                check_trials(config, run_dir.read_config(model.parent).env.control_dt)
            except ValueError as error:
                raise ConfigError(str(error)) from None


def main() -> None:
    """The command `python -m posture.dynamics`."""
    entry.run("dynamics", DynamicsConfig, examine, check)


if __name__ == "__main__":
    main()
