"""One policy on many bodies and targets, beside the torque-optimal motion of each.

python -m posture.map ckpt=runs/<run>                # a policy that was trained on ranges
python -m posture.map ckpt=runs/universal random=0   # of several seeds, the maps alone
"""

from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

from posture.cli import entry
from posture.config.errors import ConfigError
from posture.config.map import MapConfig
from posture.storage import checkpoint, provenance, run_dir, yaml_files

FILES = ("map.csv", "transitions.csv", "agreement.csv", "map.png", "map.yaml")
"""What a map consists of, the record of its policies and conditions last."""


def make_map(config: MapConfig, folder: Path) -> None:
    """Evaluate the policy, or those of several seeds; write map.csv with every trial, transitions.csv, agreement.csv,
    map.png and map.yaml, and print transitions and agreement."""
    # Imported here because they are slow.
    from posture.analysis.results import Result, as_row, write_rows
    from posture.evaluation.many_bodies import evaluate_many, least_costs_of, with_least_cost
    from posture.evaluation.trial import AS_TRAINED, policy_record, trial_config
    from posture.learning.networks import load_policy
    from posture.map.figure import draw
    from posture.map.summary import agreement, transitions
    from posture.map.trials import trials

    models = run_dir.find_checkpoints(config.ckpt)
    runs = [run_dir.read_config(model.parent) for model in models]
    if any(run.env != runs[0].env for run in runs) or len({run.seed for run in runs}) < len(runs):
        raise ConfigError(f"ckpt: {config.ckpt} holds different trainings; allowed are one, or one of several seeds")
    for model, run in zip(models, runs, strict=True):  # before minutes of work
        trial_config(run.env, config.evaluation, AS_TRAINED, config.device)
        load_policy(checkpoint.load(model, "cpu"), run, model, "cpu")
    record = {
        "policies": [policy_record(model, run) for model, run in zip(models, runs, strict=True)],
        "map": config.model_dump(mode="json", exclude={"ckpt", "out", "again", "device"}),
    }
    run_dir.writable(folder, *FILES)
    if not config.again and yaml_files.read_yaml(folder / "map.yaml") == record | provenance.digests_of_existing(
        folder, FILES[:-1]
    ):
        print(f"made before: {folder}")
        return
    (folder / "map.yaml").unlink(missing_ok=True)  # it marks the folder as complete
    env = runs[0].env.without_ranges()
    found = trials(config, runs[0].env)
    least = least_costs_of(found.rows, env, config.evaluation.duration)
    seeds: dict[int, list[Result]] = {
        run.seed: with_least_cost(evaluate_many(model, run, found.rows, config.evaluation, config.device), least)
        for model, run in zip(models, runs, strict=True)
    }
    switches = transitions(config, runs[0].env, found, seeds)
    agreed = [row for seed, results in seeds.items() for row in agreement(found, seed, results, switches)]
    rows = [
        {"varied": varied, **dict(zip(("joint_damping", "friction", "tolerance_m"), row[5:], strict=True)), **as_row(result)}
        for results in seeds.values()
        for varied, row, result in zip(found.varied, found.rows.tolist(), results, strict=True)
    ]
    write_rows(rows, folder / "map.csv")
    write_rows([asdict(row) for row in agreed], folder / "agreement.csv")
    if switches:
        write_rows([asdict(row) for row in switches], folder / "transitions.csv")
        draw(found, seeds, switches, folder / "map.png")
    else:
        for name in ("transitions.csv", "map.png"):  # of an earlier map
            (folder / name).unlink(missing_ok=True)
    yaml_files.write_yaml(folder / "map.yaml", record | provenance.digests_of_existing(folder, FILES[:-1]))
    print(_text(agreed), *([] if not switches else ["", _text(switches)]), sep="\n")
    print(*(folder / name for name in FILES if (folder / name).exists()), sep="\n")


def _text(rows: Sequence[object]) -> str:
    """A table for the terminal."""
    import tabulate

    return tabulate.tabulate([asdict(row) for row in rows], "keys", floatfmt=".4g")  # type: ignore[call-overload]


def check(configs: Sequence[MapConfig], in_sweep: bool) -> None:
    """Raise ConfigError if there is no policy for one of the jobs."""
    for config in configs:
        run_dir.find_checkpoints(config.ckpt)


def main() -> None:
    """The command `python -m posture.map`."""
    entry.run("map", MapConfig, make_map, check)


if __name__ == "__main__":
    main()
