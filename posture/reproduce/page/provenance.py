"""The provenance section of the report: the trainings, their duration, code and library versions."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import groupby
from typing import Any

from posture.reproduce.page.page import Table
from posture.reproduce.page.text import HOW_IT_WAS_MADE, LEFT_OUT, MIXED
from posture.reproduce.reproduction import Training
from posture.storage import provenance

FEW = 3
"""Trainings that differ from the others are named up to this many."""


def warnings(trainings: Sequence[Training], left_out: Sequence[str]) -> list[str]:
    """Warnings at the top of the page: trainings that differ in code or versions, and results that were left out."""
    texts = []
    if differences := _differences([training for training in trainings if training.done]):
        texts.append(MIXED.format(what="; ".join(differences)))
    if left_out:
        texts.append(LEFT_OUT.format(count=len(left_out), names=", ".join(f"`{name}`" for name in left_out)))
    return texts


def training_table(trainings: Sequence[Training]) -> Table:
    """How many trainings of each experiment are done, and how long they took."""
    rows = []
    for experiment, group in groupby(trainings, key=lambda training: training.experiment):
        own = list(group)
        done = [training for training in own if training.done]
        seeds = ", ".join(map(str, sorted({training.seed for training in done}))) or "-"
        hours = sum(training.seconds for training in done) / 3600
        rows.append([experiment, f"{len(done)} of {len(own)}", seeds, f"{hours:.1f}"])
    caption = "Trainings, and the sum of their hours; several ran at the same time, beside other work"
    return Table(["trainings", "done", "seeds", "hours"], rows, caption, "lrrr")


def how_it_was_made(trainings: Sequence[Training], commands: Sequence[str]) -> str:
    """When, where and with which code and versions the trainings were made, and the commands that repeat everything."""
    starts = [start for training in trainings if training.done for start in training.starts]
    days = [start["started"][:10] for start in starts]

    def listed(values: set[str]) -> str:
        return ", ".join(sorted(values))

    return HOW_IT_WAS_MADE.format(
        first=min(days, default="-"),
        last=max(days, default="-"),
        platforms=listed({start["platform"] for start in starts}),
        pythons=listed({start["python"] for start in starts}),
        versions=listed({f"{name} {version}" for start in starts for name, version in start["versions"].items()}),
        codes=listed({f"`{_code(start)}`" for start in starts}),
        commits=listed({f"`{start['git_commit']}`" for start in starts}),
        commands="\n".join(commands),
    )


def codes(trainings: Sequence[Training]) -> dict[str, Any]:
    """Digests of the code that trained the policies, and of that which evaluated them, as provenance.yaml has them."""
    trained = {_code(start) for training in trainings if training.done for start in training.starts}
    return {"training_code": sorted(trained), "analysis_code": provenance.analysis_code()}


def _code(start: Mapping[str, Any]) -> str:
    """Digest of a training's code; trainings of earlier versions have that of the package `envs` only."""
    return str(start.get("training_code") or start["envs_version"])


def _differences(trainings: Sequence[Training]) -> list[str]:
    """The differences between the starts of the trainings: code, library versions."""
    names: dict[str, dict[str, list[str]]] = {}
    packages = sorted({name for training in trainings for start in training.starts for name in start["versions"]})
    for training in trainings:
        for start in training.starts:
            values = {"code of the task, the physics and the learner": _code(start)}
            values |= {name: start["versions"].get(name, "none") for name in packages}
            for what, value in values.items():
                same = names.setdefault(what, {}).setdefault(str(value), [])
                if training.name not in same:  # it may have been resumed
                    same.append(training.name)
    return [f"{what}: {_counts(found)}" for what, found in names.items() if len(found) > 1]


def _counts(found: dict[str, list[str]]) -> str:
    """As "`1.8.0` in 26 trainings, `1.9.0` in 1 training (seed-1_0123abcd)"; a few trainings are named."""
    parts = []
    for value, names in sorted(found.items(), key=lambda item: -len(item[1])):
        named = f" ({', '.join(names)})" if len(names) <= FEW else ""
        parts.append(f"`{value}` in {len(names)} training{'s' * (len(names) != 1)}{named}")
    return ", ".join(parts)
