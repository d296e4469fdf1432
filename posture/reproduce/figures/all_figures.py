"""The paper's Figs 2-13 and Table 3 redrawn from our results over several seeds, beside the paper's claims and the theory.

Numbered as in the paper (its experiments, and which figures show them: conf/experiment/). Each shows what the paper's figure
of that number is about, in our own way.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from matplotlib.figure import Figure

from posture.analysis.results import Row
from posture.analysis.trajectory import Trajectory
from posture.reproduce.figures import curves
from posture.reproduce.figures import traces as over_time
from posture.reproduce.figures.seed_curves import report_figure
from posture.reproduce.figures.stiffness_map import stiffness_map

SHOWN_FREQ = (0.15, 0.75, 1.5)
"""[Hz] Ends of Exp. 1, and where the paper's modes have just switched: what Figs 3 and 4 show, and Fig. 2 the ends of."""


class Plan(NamedTuple):
    """A figure: its height [inch], what it needs (drawn only where all is there), and what fills it."""

    height: float
    needs: Sequence[Any]
    fill: Callable[[Figure], None]


def draw_report(
    rows: Mapping[str, Sequence[Row]],
    traces: Mapping[str, Trajectory],
    paper: Mapping[str, Any],
    foot_span: tuple[float, float],
    transitions: Mapping[str, float],
    folder: str | Path,
    *,
    ramp_start: float,
    still_joint_deg: float,
) -> dict[str, Path]:
    """Draw into `folder` every figure for which there are results, as a PNG, and return the paths by name.

    `rows` by experiment, a row a seed and condition, `valid` false for a fall. `traces` of the first seed by name. `paper`
    is the content of conf/paper.yaml, `foot_span` the (heel, toe) end of ground contact in the foot frame [m], `transitions`
    the switch frequencies by theory [Hz]: least, reward, sinusoid. `ramp_start` [Hz] is where the ramp begins; a joint that
    moves less than `still_joint_deg` [deg] in a window of it has no correlation.
    """
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    drawn = {}
    for name, plan in plans(rows, traces, paper, foot_span, transitions, ramp_start, still_joint_deg).items():
        if all(plan.needs):
            drawn[name] = folder / f"{name}.png"
            with report_figure(plan.height, drawn[name]) as fig:
                plan.fill(fig)
    return drawn


def plans(
    rows: Mapping[str, Sequence[Row]],
    traces: Mapping[str, Trajectory],
    paper: Mapping[str, Any],
    foot_span: tuple[float, float],
    transitions: Mapping[str, float],
    ramp_start: float,
    still_joint_deg: float,
) -> dict[str, Plan]:
    """All figures by name, those that lack results included; arguments as in `draw_report`."""
    frequency, energy, loads = (rows.get(name, ()) for name in ("frequency", "energy", "load"))
    grid, amplitudes, engines = (rows.get(name, ()) for name in ("hip_stiffness", "amplitude", "engines"))
    at = paper.get("experiment_3", {}).get("freq_hz", math.nan)
    stiffness = [row for row in grid if math.isclose(row["freq_hz"], at)]
    trial, ramp = traces.get("frequency"), traces.get("ramp")
    worlds = over_time.shown_worlds(trial, SHOWN_FREQ) if trial else []
    laden = over_time.load_worlds(traces)
    height = over_time.target_height(paper)
    still = math.radians(still_joint_deg)

    def bodies(fig: Figure) -> None:
        assert trial is not None and height is not None
        over_time.bodies(fig, trial, height, (SHOWN_FREQ[0], SHOWN_FREQ[-1]))

    def ramped(fig: Figure) -> None:
        assert ramp is not None
        over_time.ramp(fig, ramp, rows.get("ramp", ()), paper, transitions, ramp_start, still)

    return {
        "figure_2": Plan(9.0, [worlds, height], bodies),
        "figure_3": Plan(6.0, [worlds], lambda fig: over_time.head_target(fig, worlds)),
        "figure_4": Plan(6.0, [worlds], lambda fig: over_time.joint_angles(fig, worlds)),
        "figure_5": Plan(6.5, [frequency], lambda fig: curves.coordination(fig, frequency, paper)),
        "figure_6": Plan(6.0, [frequency], lambda fig: curves.ranges(fig, frequency, paper)),
        "figure_7": Plan(5.0, [frequency], lambda fig: curves.pressure(fig, frequency, paper, foot_span)),
        "figure_8": Plan(6.5, [energy], lambda fig: curves.effort(fig, energy, paper)),
        "figure_9": Plan(8.5, [stiffness], lambda fig: curves.stiffness(fig, stiffness, paper)),
        "figure_10": Plan(6.5, [ramp is not None, paper.get("experiment_4a")], ramped),
        "figure_11": Plan(4.5, [laden], lambda fig: over_time.joint_angles(fig, laden)),
        "figure_12": Plan(6.0, [loads], lambda fig: curves.load(fig, loads, paper)),
        "figure_13": Plan(5.5, [grid], lambda fig: stiffness_map(fig, grid, paper)),
        "amplitude": Plan(5.0, [amplitudes], lambda fig: curves.amplitude(fig, amplitudes, paper)),
        "engines": Plan(6.5, [engines], lambda fig: curves.engines(fig, engines, paper)),
        "tracking": Plan(7.0, [frequency], lambda fig: curves.tracking(fig, frequency, paper)),
    }
