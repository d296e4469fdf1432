"""The results of a reproduction: the data for verdicts, figures and the page."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from posture.analysis.results import Result
from posture.analysis.trajectory import Array, Trajectory
from posture.config.published import Published
from posture.config.train import TrainConfig
from posture.reproduce.claims.verdict import Transitions


@dataclass(frozen=True)
class Training:
    """A training of an experiment, done or not. starts: the entries of its provenance.yaml, one for each start."""

    experiment: str
    name: str
    seed: int
    done: bool = False
    seconds: float = 0.0
    starts: list[dict[str, Any]] = field(default_factory=list)


@dataclass(frozen=True)
class Traces:
    """Trajectories of the first seed: Exp. 1 (a world for each frequency), the ramp, and each load [kg]."""

    frequency: Trajectory | None = None
    ramp: Trajectory | None = None
    load: dict[float, Trajectory] = field(default_factory=dict)


@dataclass(frozen=True)
class ManyBodies:
    """What `posture.map` wrote about the policies of the experiment `map`: its figure, and its tables as text by column."""

    figure: Path
    agreement: list[dict[str, str]]
    transitions: list[dict[str, str]]


@dataclass(frozen=True)
class Dynamics:
    """What `posture.dynamics` wrote about the policies of the experiment `human`: its figure, and its findings as text."""

    figure: Path
    findings: list[dict[str, str]]


@dataclass(frozen=True)
class Recipe:
    """One way of training a policy for all frequencies of Exp. 1, as `RECIPES` names it, and its results.

    frequency, ramp, load: of Exp. 1, 4a and 4b. reward_hz: where the optimum of its reward switches [Hz]; nan where it does
    not. soft_hip_r, low_weight_r: hip-ankle correlation [-] of that optimum at the conditions of `last_anti_phase`.
    """

    name: str
    frequency: list[Result]
    ramp: list[Result]
    load: list[Result]
    reward_hz: float
    soft_hip_r: float
    low_weight_r: float


@dataclass(frozen=True, eq=False)
class Body:
    """The body as simulated, without load.

    mass [kg], height [m]. com: centre of mass at rest [m], (3,). hip_range, ankle_range: lower and upper limit [deg], (2,).
    foot_span: rear and front end of ground contact in the foot frame [m].
    """

    mass: float
    height: float
    com: Array
    hip_range: Array
    ankle_range: Array
    foot_span: tuple[float, float]


@dataclass(frozen=True)
class Reproduction:
    """All results.

    results: by experiment, one for each seed and condition. run: configuration of the first policy of Exp. 1. left_out:
    folders with results of other code, another configuration or another policy. ramp_start: first frequency of Exp. 4a [Hz].
    recipes: ours first; empty where there is no other.
    """

    results: dict[str, list[Result]]
    traces: Traces
    transitions: Transitions
    body: Body
    trainings: list[Training]
    run: TrainConfig
    left_out: list[str]
    ramp_start: float
    many_bodies: ManyBodies | None = None
    dynamics: Dynamics | None = None
    recipes: Sequence[Recipe] = ()


def last_anti_phase(paper: Published) -> tuple[float, float]:
    """The largest hip stiffness [Nm/rad] of Exp. 3 and the largest gamma of Exp. 2 that are anti-phase in the paper."""
    third, fourth = paper.experiment_3, paper.table_4
    return (
        max(k for k, mode in zip(third.hip_k_nm_per_rad, third.mode, strict=True) if mode == "anti"),
        max(gamma for gamma, mode in zip(fourth.gamma, fourth.mode, strict=True) if mode == "anti"),
    )
