"""Make a run folder of a checkpoint that rsl-rl's own OnPolicyRunner saved, for evaluation, films and `init`.

python -m posture.import_checkpoint file=model_1500.pt out=runs/imported

Such a file is a pickle. It is read by torch's `weights_only`, which executes nothing, and refused if it needs more.
"""

from pathlib import Path

from posture.cli import entry
from posture.config.errors import ConfigError
from posture.config.import_checkpoint import ImportConfig
from posture.config.reading import read
from posture.config.train import TrainConfig
from posture.storage import provenance, run_dir
from posture.storage.lock import locked


def import_checkpoint(config: ImportConfig, folder: Path) -> None:
    """Write config.yaml, provenance.yaml and model_<n>.pt to `folder`, n being the number of iterations done.

    Raises ConfigError if the checkpoint does not fit the configuration, or if `folder` holds another one.
    """
    if run_dir.newest_model(folder) is not None:
        raise ConfigError(f"{folder}: holds a checkpoint already; out= names another folder")
    file = Path(config.file)
    if run_dir.is_run(file.parent):
        raise ConfigError(f"{file}: is a checkpoint of a run of posture, which ckpt= and init= take as it is")
    from posture.learning.networks import load_network
    from posture.storage import checkpoint

    content = checkpoint.load_unsealed(file)
    index = content.get("iter")
    if type(index) is not int or index < 0:
        raise ConfigError(f"{file}: iter = {index!r:.50}: allowed is the index of an iteration, as rsl-rl saves it")
    done = index + 1
    values = config.model_dump(exclude={"file"}) | {"max_iterations": done}
    run = read(TrainConfig, values, str(file))
    load_network(content, run, "actor", file)
    load_network(content, run, "critic", file)
    with locked(folder):
        provenance.write_config(folder, run, file)
        checkpoint.save(content | {"iter": done}, folder / f"model_{done}.pt")
    print(f"run: {folder}")


def main() -> None:
    """The command `python -m posture.import_checkpoint`."""
    entry.run("import_checkpoint", ImportConfig, import_checkpoint)


if __name__ == "__main__":
    main()
