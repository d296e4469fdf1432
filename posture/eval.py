"""Evaluate a trained policy: the paper's indices, table and figures.

python -m posture.eval                                   # the latest run
python -m posture.eval ckpt=runs/<run>/model_250.pt
python -m posture.eval ckpt=runs/<sweep>                 # every run of a sweep, and one table
python -m posture.eval ckpt=runs/<run> env.load=2
"""

from pathlib import Path

from posture import cli, run_dir
from posture.config import EvalConfig
from posture.coordination import Row, write_csv


def evaluate_all(config: EvalConfig, _folder: Path) -> None:
    """Evaluate every checkpoint that `ckpt` means, each into its own folder; of a sweep also one table of all."""
    models = run_dir.find_checkpoints(config.ckpt)
    runs = [run_dir.read_config(model.parent) for model in models]
    out = run_dir.output_folder(config.out)
    # Only now, so that bad input is answered before physics takes seconds to import.
    from posture.evaluation import evaluate

    everything: list[Row] = []
    for model, run in zip(models, runs, strict=True):
        folder = model.parent / "evaluation" if out is None else out
        if out is not None and len(models) > 1:
            folder = out / model.parent.name
        if len(models) > 1:
            print(f"== {model.parent.name}")
        rows = evaluate(model, run, config.evaluation, config.env, config.device, folder)
        everything += [{"run": model.parent.name, **row} for row in rows]
    if len(models) > 1:
        table = (Path(config.ckpt) if out is None else out) / "metrics.csv"
        write_csv(everything, table)
        print(f"all runs: {table}")


if __name__ == "__main__":
    cli.run("eval", EvalConfig, evaluate_all)
