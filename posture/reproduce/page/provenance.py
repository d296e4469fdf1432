"""Where the results of a report come from: which trainings, what they took, by which code and versions.

Results of different code or versions may stand on one page, but never unsaid: `mixed` says so.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from itertools import groupby
from pathlib import Path
from typing import Any

from posture.cli.jobs import Job
from posture.cli.sweep import fraction_done
from posture.config.train import TrainConfig
from posture.learning.resume import training_seconds
from posture.reproduce.page.page import Block, Commands, Table, Text
from posture.reproduce.page.text import LEFT_OUT, MADE, MIXED
from posture.storage import yaml_files


def mixed(jobs: Sequence[Job]) -> str:
    """In one sentence, in what the code and versions of the trainings differ that are done; empty where they do not."""
    by_run = {job.folder: _starts(job) for job in jobs if fraction_done(job) >= 1}
    differing = []
    if len(codes := _runs_by(by_run, _code)) > 1:
        differing.append(f"code of the task, the physics and the learner: {_told(codes)}")
    for name in sorted({name for starts in by_run.values() for start in starts for name in start["versions"]}):
        if len(found := _runs_by(by_run, _version_of(name))) > 1:
            differing.append(f"{name}: {_told(found)}")
    return MIXED.format(what="; ".join(differing)).strip() if differing else ""


def left_out(names: Sequence[str]) -> str:
    """In one sentence, which results were there and are not on the page; empty where there are none."""
    return LEFT_OUT.format(count=len(names), names=", ".join(names)).strip() if names else ""


def made(jobs: Sequence[Job], commands: Sequence[str]) -> list[Block]:
    """Which trainings there are, what they took, by which code and versions; and the commands."""
    lines, starts = [], []
    for experiment, group in groupby(jobs, key=lambda job: job.folder.parent.name):
        own = list(group)
        done = [job for job in own if fraction_done(job) >= 1]
        hours = sum(training_seconds(job.folder) for job in done) / 3600
        seeds = sorted({job.config.seed for job in done if isinstance(job.config, TrainConfig)})
        lines.append([experiment, f"{len(done)} of {len(own)}", ", ".join(map(str, seeds)) or "-", f"{hours:.1f}"])
        starts += [start for job in done for start in _starts(job)]
    about = {
        "platforms": {start["platform"] for start in starts},
        "pythons": {start["python"] for start in starts},
        "versions": {f"{name} {version}" for start in starts for name, version in start["versions"].items()},
        "codes": {f"`{_code(start)}`" for start in starts},
        "commits": {f"`{start['git_commit']}`" for start in starts},
    }
    days = sorted(start["started"][:10] for start in starts)
    told = {name: ", ".join(sorted(found)) for name, found in about.items()}
    return [
        Table(
            ["trainings", "done", "seeds", "hours"],
            lines,
            "Trainings; the hours of all jobs together, several of which ran at once and beside other work",
            "lrrr",
        ),
        Text(MADE.format(first=days[0], last=days[-1], **told)),
        Commands(commands),
        Text("How to cite this software and the paper: CITATION.cff."),
    ]


def _starts(job: Job) -> list[dict[str, Any]]:
    """What a training's folder says of each of its starts: it may have been resumed."""
    return yaml_files.read_yaml(job.folder / "provenance.yaml") or []


def _code(start: dict[str, Any]) -> str:
    """Digest of the code of a training; trainings of earlier versions have that of the package `envs` alone."""
    return str(start.get("training_code") or start["envs_version"])


def _version_of(package: str) -> Callable[[dict[str, Any]], object]:
    return lambda start: start["versions"].get(package, "none")


def _runs_by(
    by_run: Mapping[Path, Sequence[dict[str, Any]]], key: Callable[[dict[str, Any]], object]
) -> dict[str, list[str]]:
    """Names of runs by what `key` reads in their starts; a run that was resumed may have several."""
    found: dict[str, list[str]] = {}
    for folder, starts in by_run.items():
        for value in sorted({str(key(start)) for start in starts}):
            found.setdefault(value, []).append(folder.name)
    return found


def _told(found: Mapping[str, Sequence[str]]) -> str:
    """`1.8.0 in 26 trainings, 1.9.0 in 1 (seed-1_0123abcd)`: of what few have, which."""
    few = 3
    parts = []
    for value, runs in sorted(found.items(), key=lambda item: -len(item[1])):
        named = f" ({', '.join(runs)})" if len(runs) <= few else ""
        parts.append(f"`{value}` in {len(runs)} trainings{named}")
    return ", ".join(parts)
