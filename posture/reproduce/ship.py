"""Run folders reduced to what evaluation needs: the policy (tens of kilobytes), configuration and provenance.

One of each condition comes with the package, in posture/pretrained/<condition>/: `ckpt=pretrained` is the policy of Exp. 1,
`ckpt=pretrained/<condition>` any other. `universal` is one for many bodies (experiment=map). The policies of all seeds lie
beside the report, in policies/<experiment>/<job>/. Copied into runs/, they are evaluated there and not trained again.
"""

import re
import tempfile
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

from posture.cli import signals
from posture.cli.jobs import Job
from posture.cli.sweep import fraction_done
from posture.config.errors import ConfigError
from posture.config.train import TrainConfig
from posture.storage import checkpoint, provenance, run_dir, yaml_files
from posture.storage.run_dir import PRETRAINED


def ship(jobs: Iterable[Job], seed: int, into: Path = PRETRAINED) -> list[Path]:
    """Copy the policies of those `jobs` that are done and have this `seed`; they replace earlier ones."""
    shipped = []
    for job in jobs:
        assert isinstance(job.config, TrainConfig)
        model = run_dir.newest_model(job.folder)
        if job.config.seed != seed or fraction_done(job) < 1 or model is None:
            continue
        shipped.append(ship_policy(model, into / condition_name(job)))
        print(shipped[-1])
    return shipped


def archive(jobs: Mapping[str, Sequence[Job]], into: Path) -> list[Path]:
    """Copy the policies of those `jobs` that are done to `into`/<experiment>/<job>; they replace those of the same jobs."""
    archived = []
    for experiment, own in jobs.items():
        for job in own:
            model = run_dir.newest_model(job.folder)
            if fraction_done(job) >= 1 and model is not None:
                archived.append(ship_policy(model, into / experiment / job.folder.name))
    print(f"{into}: {len(archived)} policies")
    return archived


def duration(run: Path) -> float:
    """How long a training took [s]; also of a folder that `ship_policy` made. Raises ConfigError if that is not there."""
    model = run_dir.newest_model(run)
    if model is None or (run / "resume.pt").exists():
        from posture.learning.resume import training_seconds  # imported here because torch is slow

        return training_seconds(run)
    try:
        return float(checkpoint.load(model, "cpu")["seconds"])
    except (KeyError, TypeError, ValueError):
        raise ConfigError(f"{model}: does not say how long the training took") from None


def ship_policy(model: Path, folder: Path) -> Path:
    """Copy the policy of checkpoint `model` to `folder`, with the configuration and provenance of its run; return it.

    What `folder` held is replaced once everything is written beside it. Raises ConfigError if a file of the run is damaged.
    """
    content, seconds = checkpoint.load(model, "cpu"), duration(model.parent)
    policy = checkpoint.as_policy(content)["actor_state_dict"]
    # The folder of the run means nothing elsewhere.
    config = yaml_files.read_yaml(model.parent / "config.yaml") | {"resume": None}
    starts = provenance.whole_starts(model.parent)
    for start in starts:
        kept = [part for part in start["command"] if not part.startswith(("hydra.run.dir=", "out="))]
        start["command"] = [re.sub("^resume=.*/", "resume=", part) for part in kept]
    folder.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(prefix=f".{folder.name}-", dir=folder.parent) as beside:
        new, old = Path(beside) / "new", Path(beside) / "old"
        new.mkdir()
        checkpoint.save({"actor_state_dict": policy, "iter": content["iter"], "seconds": seconds}, new / model.name)
        yaml_files.write_yaml(new / "config.yaml", config)
        yaml_files.write_yaml(new / "provenance.yaml", starts)
        with signals.blocked():
            if folder.exists():
                folder.rename(old)
            new.rename(folder)
    return folder


def condition_name(job: Job) -> str:
    """Folder of a shipped policy: what is swept (`energy_weight-5`, `hip_k-75`), or else `default` for Exp. 1, `universal`
    for one of many bodies, or the experiment."""
    swept = re.sub(r"_?seed-\d+_[0-9a-f]{8}$", "", job.folder.name)
    experiment = job.folder.parent.name
    return swept or {"frequency": "default", "map": "universal"}.get(experiment, experiment)
