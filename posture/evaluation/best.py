"""The best checkpoint of a run: that with the fewest falls in the run's own evaluation, and among those the least cost.

best.pt     a copy of that checkpoint
best.yaml   its iteration and figures, and those of every checkpoint that was compared
"""

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from envs.body.joints import JOINTS
from posture.analysis.results import Result, read_csv
from posture.config.train import TrainConfig
from posture.evaluation.trial import AS_TRAINED, is_current
from posture.storage import run_dir, yaml_files
from posture.storage.atomic import replacing


@dataclass(frozen=True)
class Score:
    """Figures of the checkpoint after `iteration` iterations.

    falls: frequencies at which it falls. cost_ratio: mean over the other frequencies of cost over least cost [-]; nan if it
    falls at all of them, or if one of them has no least cost.
    """

    iteration: int
    falls: int
    cost_ratio: float


def score(iteration: int, rows: Sequence[Result]) -> Score:
    """The figures of a checkpoint from its results at each frequency."""
    ratios = [row.cost_ratio for row in rows if row.valid]
    return Score(iteration, len(rows) - len(ratios), float(np.mean(ratios)) if ratios else math.nan)


def objective(rows: Sequence[Result]) -> float:
    """What a search for hyper-parameters minimises: the mean over the frequencies of cost over least cost [-].

    A fall counts as the greatest cost there is, the torque limit at every joint all the time.
    """
    return float(np.mean([row.cost_ratio if row.valid else len(JOINTS) / row.least.cost for row in rows]))


def evaluation_folder(run: Path, config: TrainConfig, iteration: int) -> Path:
    """Where posture.eval writes the run's own evaluation of a checkpoint."""
    return run / ("evaluation" if iteration >= config.max_iterations else f"evaluation_model_{iteration}")


def scores(run: Path, config: TrainConfig) -> list[Score]:
    """The figures of the checkpoints that were evaluated as `config` says, in the order of their iterations."""
    found, newest = [], run_dir.newest_model(run)
    for model in sorted(run_dir.models(run), key=run_dir.iteration_of):
        iteration = run_dir.iteration_of(model)
        places = [evaluation_folder(run, config, iteration), *([run / "evaluation"] if model == newest else [])]
        for place in places:
            if is_current(place, model, config, config.evaluation, AS_TRAINED, config.device):
                found.append(score(iteration, read_csv(place / "metrics.csv")))
                break
    return found


def best(found: Sequence[Score]) -> Score | None:
    """The best, of equal ones the first; None if all fall at every frequency."""
    standing = [one for one in found if math.isfinite(one.cost_ratio)]
    return min(standing, key=lambda one: (one.falls, one.cost_ratio), default=None)


def has_plateaued(found: Sequence[Score], patience: int) -> bool:
    """Whether `patience` evaluations followed the best one. While every policy falls, none is waited for."""
    leader = best(found)
    return leader is not None and len(found) - 1 - found.index(leader) >= patience


def keep_best(run: Path, config: TrainConfig) -> Score | None:
    """Write best.pt and best.yaml, and return the best; without one remove them."""
    found = scores(run, config)
    leader = best(found)
    if leader is None:
        for name in run_dir.BEST:
            (run / name).unlink(missing_ok=True)
        return None
    with replacing(run / "best.pt") as temporary:
        temporary.write_bytes((run / f"model_{leader.iteration}.pt").read_bytes())
    yaml_files.write_yaml(
        run / "best.yaml",
        asdict(leader) | {"frequencies": len(config.evaluation.freq), "compared": [asdict(one) for one in found]},
    )
    return leader
