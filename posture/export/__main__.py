"""A trained policy for other tools: its trajectories as OpenSim storage files and CSV, and itself as ONNX.

python -m posture.export                                          # the shipped policy at the ten frequencies, and as ONNX
python -m posture.export ckpt=runs/<run> evaluation.freq=[0.3,0.9]
python -m posture.export ckpt=latest what=[trajectories] in_degrees=true env.load=4
python -m posture.export ckpt=latest what=[policy]
"""

import hashlib
from pathlib import Path

from envs.config import as_plain
from posture.cli import entry
from posture.config.errors import ConfigError
from posture.config.export import ExportConfig
from posture.config.train import TrainConfig
from posture.storage import run_dir, yaml_files


def export(config: ExportConfig, job: Path) -> None:
    """Write what `config.what` names, and print each file. Writes export.yaml beside the trajectories, which says what was
    rolled out. `job`: the folder of a sweep's job, where its files go."""
    models = run_dir.find_checkpoints(config.ckpt)
    if len(models) > 1:
        raise ConfigError(f"ckpt: {config.ckpt} holds {len(models)} policies; allowed is one, for example {models[0]}")
    (model,) = models
    # Imported here, and in the functions below, because they are slow.
    from posture.export import onnx_policy
    from posture.learning.networks import load_policy
    from posture.storage import checkpoint

    run = run_dir.read_config(model.parent)
    load_policy(checkpoint.load(model, config.device), run, model, "cpu")
    if "policy" in config.what:
        onnx_policy.check_installed()
    if config.out is not None:
        out = Path(config.out) / job.name if entry.in_sweep() else Path(config.out)
    else:
        out = (job if entry.in_sweep() else Path(run_dir.folder_for(str(run_dir.RUNS), None))) / "export"
    if "trajectories" in config.what:
        write_trajectories(config, model, run, out)
    if "policy" in config.what:
        write_policy(model, run, out)


def write_trajectories(config: ExportConfig, model: Path, run: TrainConfig, out: Path) -> None:
    """Roll out the policy of checkpoint `model` as `posture.eval` does, and write a .sto and a .csv a frequency to `out`."""
    import torch

    from envs.task.head_tracking import HeadTrackingEnv
    from posture.evaluation.rollout import rollout
    from posture.evaluation.trial import trial_config
    from posture.export.recording import write_csv, write_sto
    from posture.learning.networks import load_policy
    from posture.learning.progress import preparing
    from posture.storage import checkpoint

    evaluation = config.evaluation
    if config.env.ramp or run.env.ramp:  # of which all worlds have the same
        evaluation = evaluation.model_copy(update={"freq": evaluation.freq[:1]})
    trial = trial_config(run.env, evaluation, config.env, config.device)
    run_dir.writable(out)
    with preparing():
        env = HeadTrackingEnv(trial, run.seed, config.device)
        policy = load_policy(checkpoint.load(model, config.device), run, model, env.sim.device)
        env.warm_up()
    freq = torch.tensor(evaluation.freq, dtype=torch.float64) if trial.ramp is None else None
    trajectory = rollout(env, policy, freq, evaluation.duration)
    (out / "export.yaml").unlink(missing_ok=True)  # what it says is about to be untrue
    for world, hertz in enumerate(evaluation.freq):
        name = "trajectory_ramp" if freq is None else f"trajectory_{hertz!r}Hz"
        sto, csv = out / f"{name}.sto", out / f"{name}.csv"
        written = write_sto(trajectory, world, sto, config.in_degrees)
        write_csv(trajectory, world, csv)
        fall = int(trajectory.fall_step[world])
        if not written:
            sto.unlink(missing_ok=True)  # one of an earlier export would be of another trial
            print(f"{sto}  not written: fell in the first step")
        else:
            print(f"{sto}  ends at {trajectory.time[fall - 1]:.2f} s, before the fall" if fall >= 0 else sto)
        print(csv)
    about = {
        "policy": str(model),
        "policy_sha256": hashlib.sha256(model.read_bytes()).hexdigest(),
        "in_degrees": config.in_degrees,
        "evaluation": evaluation.model_dump(mode="json"),
        "env": as_plain(trial),
    }
    yaml_files.write_yaml(out / "export.yaml", about)
    print(out / "export.yaml")


def write_policy(model: Path, run: TrainConfig, out: Path) -> None:
    """Write the policy of checkpoint `model` as `out`/policy.onnx."""
    from posture.export import onnx_policy
    from posture.learning.networks import load_policy
    from posture.storage import checkpoint

    run_dir.writable(out)
    path = out / "policy.onnx"
    difference = onnx_policy.write_onnx(load_policy(checkpoint.load(model, "cpu"), run, model, "cpu"), run, model, path)
    print(f"{path}  within {difference:.1g} of the policy in torch ({onnx_policy.CHECKED} observations)")


def main() -> None:
    """The command `python -m posture.export`."""
    entry.run("export", ExportConfig, export)


if __name__ == "__main__":
    main()
