"""Run folders reduced to what evaluation needs, small enough to come with the package: posture/pretrained/<condition>/.

Each has the policy alone (tens of kilobytes), the run's configuration and its provenance. `ckpt=pretrained` is the policy of
Exp. 1, `ckpt=pretrained/<condition>` any other.
"""

import re
import shutil
from collections.abc import Iterable
from pathlib import Path

from posture.cli.jobs import Job
from posture.cli.sweep import fraction_done
from posture.config.train import TrainConfig
from posture.storage import checkpoint, run_dir
from posture.storage.run_dir import PRETRAINED

SHIPPED_SEED = 1
"""Always this one: not the best, but the first."""


def ship(jobs: Iterable[Job], into: Path = PRETRAINED) -> list[Path]:
    """Copy the policies of `jobs` that are done and of the shipped seed, in place of those that are there."""
    made = []
    for job in jobs:
        assert isinstance(job.config, TrainConfig)
        model = run_dir.newest_model(job.folder)
        if job.config.seed != SHIPPED_SEED or fraction_done(job) < 1 or model is None:
            continue
        content = checkpoint.load(model, "cpu")
        folder = into / name(job)
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir(parents=True)
        checkpoint.save({"actor_state_dict": content["actor_state_dict"], "iter": content["iter"]}, folder / model.name)
        for file in ("config.yaml", "provenance.yaml"):
            shutil.copyfile(job.folder / file, folder / file)
        made.append(folder)
        print(folder)
    return made


def name(job: Job) -> str:
    """What a shipped policy is called: `default` of Exp. 1, of the others what is swept (`energy_weight-5`, `hip_k-75`)."""
    swept = re.sub(r"_?seed-\d+_[0-9a-f]{8}$", "", job.folder.name)
    return swept or "default"
