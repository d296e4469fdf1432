"""Export a trained policy to other tools: its trajectories as OpenSim storage files and CSV, the policy as ONNX.

python -m posture.export                                          # the shipped policy at the ten frequencies, and as ONNX
python -m posture.export ckpt=runs/<run> evaluation.freq=[0.3,0.9]
python -m posture.export ckpt=latest what=[trajectories] in_degrees=true env.load=4
python -m posture.export ckpt=latest what=[policy]
"""

import hashlib
from collections.abc import Sequence
from pathlib import Path

from envs.config import as_plain
from posture.cli import entry
from posture.config.errors import ConfigError
from posture.config.export import ExportConfig
from posture.config.train import TrainConfig
from posture.storage import run_dir, yaml_files


def export(config: ExportConfig, out: Path) -> None:
    """Write what `config.what` names, to the folder `out`, and print each file."""
    model = run_dir.find_checkpoint(config.ckpt)
    # Imported here, and in the functions below, because they are slow.
    from posture.learning.networks import load_policy
    from posture.storage import checkpoint

    run = run_dir.read_config(model.parent)
    policy = load_policy(checkpoint.load(model, config.device), run, model, "cpu")
    if "policy" in config.what:
        if policy.is_recurrent:  # an exported policy has no place for a memory
            raise ConfigError(f"{model}: a recurrent policy cannot be exported; allowed is what=[trajectories]")
        run_dir.writable(out, "policy.onnx")
    if "trajectories" in config.what:
        write_trajectories(config, model, run, out)
    if "policy" in config.what:
        write_policy(model, run, out)


def check(configs: Sequence[ExportConfig], in_sweep: bool) -> None:
    """Raise ConfigError if there is no policy for one of the jobs, or a package is missing."""
    for ckpt in {config.ckpt: None for config in configs}:
        run_dir.find_checkpoint(ckpt)
    if any("policy" in config.what for config in configs):
        from posture.export import onnx_policy

        onnx_policy.check_installed()


def write_trajectories(config: ExportConfig, model: Path, run: TrainConfig, out: Path) -> None:
    """Roll out the policy of checkpoint `model` as `posture.eval` does; write to `out` a .sto and a .csv per frequency, and
    export.yaml, which describes the policy and the trial."""
    import torch

    from posture.evaluation.rollout import rollout
    from posture.evaluation.trial import open_trial, trial_config
    from posture.export.trajectory_files import write_csv, write_sto

    evaluation = config.evaluation.model_copy(update={"transient": 0.0})  # nothing is left out
    if config.env.ramps(run.env):
        entry.refuse("evaluation.freq", "in a ramp, which the policy was trained on (env.ramp=none ends it)")
        evaluation = evaluation.model_copy(update={"freq": evaluation.freq[:1]})  # one world suffices
    trial = trial_config(run.env, evaluation, config.env, config.device)
    names = ["trajectory_ramp"] if trial.ramp else [f"trajectory_{hertz!r}Hz" for hertz in evaluation.freq]
    run_dir.writable(out, "export.yaml", *(f"{name}.{kind}" for name in names for kind in ("sto", "csv")))
    env, policy = open_trial(model, run, trial, config.device)
    freq = torch.tensor(evaluation.freq, dtype=torch.float64) if trial.ramp is None else None
    trajectory = rollout(env, policy, freq, evaluation.duration)
    (out / "export.yaml").unlink(missing_ok=True)  # it describes earlier files
    for world, name in enumerate(names):
        sto, csv = out / f"{name}.sto", out / f"{name}.csv"
        written = write_sto(trajectory, world, sto, config.in_degrees)
        write_csv(trajectory, world, csv)
        fall = int(trajectory.fall_step[world])
        if not written:
            sto.unlink(missing_ok=True)  # of an earlier export
            print(f"{sto}  not written: the stander fell in the first step")
        else:
            print(f"{sto}  ends at {trajectory.time[fall - 1]:.2f} s, before the fall" if fall >= 0 else sto)
        print(csv)
    description = {
        "policy": str(model),
        "policy_sha256": hashlib.sha256(model.read_bytes()).hexdigest(),
        "in_degrees": config.in_degrees,
        "evaluation": evaluation.model_dump(mode="json", include={"freq", "duration"}),
        "env": as_plain(trial),
    }
    yaml_files.write_yaml(out / "export.yaml", description)
    print(out / "export.yaml")


def write_policy(model: Path, run: TrainConfig, out: Path) -> None:
    """Write the policy of checkpoint `model` as `out`/policy.onnx."""
    from posture.export import onnx_policy
    from posture.learning.networks import load_policy
    from posture.storage import checkpoint

    path = out / "policy.onnx"
    difference = onnx_policy.write_onnx(load_policy(checkpoint.load(model, "cpu"), run, model, "cpu"), run, model, path)
    print(f"{path}  within {difference:.1g} of the policy in torch ({onnx_policy.CHECKED} observations)")


def main() -> None:
    """The command `python -m posture.export`."""
    entry.run("export", ExportConfig, export, check)


if __name__ == "__main__":
    main()
