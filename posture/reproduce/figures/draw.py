"""The paper's Figs 2 to 13 and Table 3 redrawn from the results, beside the paper's claims and the theory.

Figures are numbered as in the paper; each has the subject of the paper's figure of that number.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from matplotlib.figure import Figure

from posture.analysis.results import Result
from posture.config.published import Published
from posture.config.reproduce import ReportConfig
from posture.reproduce.claims.seed_means import where
from posture.reproduce.figures import curves, traces
from posture.reproduce.figures.seed_curves import report_figure
from posture.reproduce.figures.stiffness_map import stiffness_map
from posture.reproduce.quantities import FREQ
from posture.reproduce.reproduction import Reproduction


class Plan(NamedTuple):
    """A figure: its height [inch], whether there are results for it, and the function that fills it."""

    height: float
    available: Any
    fill: Callable[[Figure], None]


def draw_report(reproduction: Reproduction, paper: Published, report: ReportConfig, folder: Path) -> dict[str, Path]:
    """Draw every figure for which there are results into `folder`, as PNG files; returns their paths by name."""
    folder.mkdir(parents=True, exist_ok=True)
    drawn = {}
    for name, plan in _plans(reproduction, paper, report).items():
        if plan.available:
            drawn[name] = folder / f"{name}.png"
            with report_figure(plan.height, drawn[name]) as fig:
                plan.fill(fig)
    return drawn


def _plans(reproduction: Reproduction, paper: Published, report: ReportConfig) -> Mapping[str, Plan]:
    """All figures by name."""
    results = reproduction.results
    trial, ramp = reproduction.traces.frequency, reproduction.traces.ramp
    worlds = traces.shown_worlds(trial, report.figures.freq_hz) if trial else []
    loads = traces.load_worlds(reproduction.traces.load)
    stiffness = where(results.get("hip_stiffness", ()), FREQ, [paper.experiment_3.freq_hz])

    def bodies(fig: Figure) -> None:
        assert trial is not None
        ends = report.figures.freq_hz[0], report.figures.freq_hz[-1]
        traces.bodies(fig, trial, ends)

    def pressure(fig: Figure, own: Sequence[Result], _paper: Published) -> None:
        curves.pressure(fig, own, reproduction.body.foot_span)

    def ramped(fig: Figure) -> None:
        assert ramp is not None
        still = math.radians(reproduction.run.evaluation.still_joint_deg)
        own = results.get("ramp", ())
        start = reproduction.ramp_start
        traces.ramp(fig, ramp, own, paper.experiment_4a, reproduction.transitions, start, still)

    def of(experiment: str, height: float, fill: Callable[[Figure, Sequence[Result], Published], None]) -> Plan:
        own = results.get(experiment, ())
        return Plan(height, own, lambda fig: fill(fig, own, paper))

    return {
        "overview": Plan(
            5.0,
            results.get("frequency"),
            lambda fig: curves.recipes(fig, reproduction.recipes, results["frequency"], paper),
        ),
        "figure_2": Plan(9.0, worlds, bodies),
        "figure_3": Plan(6.0, worlds, lambda fig: traces.head_target(fig, worlds)),
        "figure_4": Plan(6.0, worlds, lambda fig: traces.joint_angles(fig, worlds)),
        "figure_5": of("frequency", 6.5, curves.coordination),
        "figure_6": of("frequency", 6.0, curves.ranges),
        "figure_7": of("frequency", 5.0, pressure),
        "figure_8": of("energy", 6.5, curves.effort),
        "figure_9": Plan(8.5, stiffness, lambda fig: curves.stiffness(fig, stiffness, paper)),
        "figure_10": Plan(6.5, ramp, ramped),
        "figure_11": Plan(4.5, loads, lambda fig: traces.joint_angles(fig, loads)),
        "figure_12": of("load", 6.0, curves.load),
        "figure_13": of("hip_stiffness", 5.5, stiffness_map),
        "amplitude": of("amplitude", 5.0, curves.amplitude),
        "engines": of("engines", 6.5, curves.engines),
        "tracking": of("frequency", 7.0, curves.tracking),
    }
