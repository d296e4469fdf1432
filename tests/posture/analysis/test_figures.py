"""The figures, by what is on their axes: the rows' values, the paper's, falls, units."""

import math
import warnings
from dataclasses import replace
from typing import Any

import matplotlib.image
import numpy as np
import pytest
from matplotlib import pyplot
from matplotlib.figure import Figure
from matplotlib.text import Text

from envs.body.joints import ANKLES
from posture.analysis import figures
from posture.analysis.results import LeastCost, Result
from posture.analysis.trajectory import Trajectory
from posture.config.published import Condition, Table3
from tests.posture.analysis.trials import STEPS, measured, trial, wave

SPAN = (-0.0631, 0.1317)
PAPER = Table3(
    condition=Condition(hip_k=125, ankle_k=25, load=0, amplitude=0.1, energy_weight=20),
    freq_hz=(0.3, 0.6, 0.9, 1.2),
    target_head_r=(0.99, 0.98, 0.97, 0.96),
    head_amplitude_m=(0.08, 0.081, 0.082, 0.083),
    head_speed_mps=(0.1, 0.2, 0.3, 0.4),
    mode=("in", "in", "anti", "anti"),
)
OVER_TIME = ["head_target", "joint_angles", "angle_plots"]
AGAINST_FREQUENCY = ["coordination", "ranges", "tracking", "cop"]


def sweep(freq: list[float], fall_step: list[int] | None = None, **changes: Any) -> Trajectory:
    """In-phase below 0.75 Hz and anti-phase above; the head late by 0.1 rad."""
    phase = [0.1 if f < 0.75 else math.pi - 0.1 for f in np.nan_to_num(freq)]
    time = np.arange(STEPS)[:, None] / 60
    moved = np.nan_to_num(np.array(freq), nan=0.5)
    fields: dict[str, Any] = {
        "head_x": 0.1 - 0.08 * wave(moved, -0.1, time),
        "head_vx": wave(moved, 1.47, time),
        "cop_x": 0.03 + 0.04 * wave(moved, 0.0, time),
        "joint_torque": 10 * wave(moved, 0.0, time)[..., None] * [1.0, 2.0, 1.0, 2.0],
        "fall_step": np.array(fall_step or [-1] * len(freq)),
    }
    return trial(freq, phase, **{**fields, **changes})


def draw(name: str, trajectory: Trajectory, paper: Table3 | None = PAPER, rows: list[Result] | None = None) -> Figure:
    rows = rows or measured(trajectory)
    first = [trajectory] if name in OVER_TIME else []
    last = {"coordination": [paper], "tracking": [paper], "cop": [SPAN]}.get(name, [])
    return getattr(figures, f"fig_{name}")(*first, rows, *last)


def texts(fig: Figure) -> list[str]:
    return [text.get_text() for text in fig.findobj(Text) if text.get_text()]


def line(fig: Figure, panel: int, label: str) -> np.ndarray:
    """Points (N, 2) of the line with this label."""
    (found,) = (line for line in fig.axes[panel].get_lines() if line.get_label() == label)
    return np.array(found.get_xydata())


def points(rows: list[Result], get: Any) -> np.ndarray:
    return np.array([[row.freq_hz, get(row)] for row in rows])


def test_all_are_drawn(tmp_path):
    trajectory = sweep([0.3, 0.6, 0.9, 1.2], [-1, -1, -1, 738])
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        paths = figures.draw_all(trajectory, measured(trajectory), PAPER, tmp_path / "new", SPAN)
    assert {path.stem for path in paths} == {*OVER_TIME, *AGAINST_FREQUENCY}
    assert set(paths) == set((tmp_path / "new").iterdir())
    # The standard deviation of the grey level is 0 for a blank page.
    assert all(matplotlib.image.imread(path)[..., :3].mean(axis=-1).std() > 0.03 for path in paths)
    assert pyplot.get_fignums() == []


@pytest.mark.parametrize("freq", [[0.5], [0.015], [0.1 * n for n in range(1, 13)]])
def test_one_panel_for_each_world(freq):
    trajectory = sweep(freq)
    for name in OVER_TIME:
        panels = [ax for ax in draw(name, trajectory).axes if ax.axison]
        assert [ax.get_title() for ax in panels] == [f"{f:g} Hz" for f in freq]


def test_signals_of_the_last_three_cycles():
    """0.5 Hz: 120 samples a cycle. World 1 fell at step 738, and its last cycles are those before."""
    trajectory = sweep([0.5, 0.5], [-1, 738])
    for world, steps in ((0, slice(5640, 6000)), (1, slice(379, 739))):
        head = draw("head_target", trajectory)
        assert line(head, world, "head") == pytest.approx(np.stack([trajectory.time, trajectory.head_x[:, world]], 1)[steps])
        assert line(head, world, "target")[:, 1] == pytest.approx(trajectory.target_x[steps, world])
        angles = draw("joint_angles", trajectory)
        hip, ankle = np.degrees(trajectory.hip[steps, world]), np.degrees(trajectory.ankle[steps, world])
        assert line(angles, world, "hip (flexion negative)")[:, 1] == pytest.approx(hip)
        assert line(angles, world, "ankle (forward lean negative)")[:, 1] == pytest.approx(ankle)
        (curve,) = draw("angle_plots", trajectory).axes[world].get_lines()
        assert curve.get_xydata() == pytest.approx(np.stack([ankle, hip], 1))


def test_coordination_against_frequency():
    rows = measured(sweep([0.9, 0.3, 0.6]))
    rising = sorted(rows, key=lambda row: row.freq_hz)
    fig = draw("coordination", sweep([0.3]), rows=rows)
    assert line(fig, 0, "ours, in-phase") == pytest.approx(points(rising[:2], lambda row: row.hip_ankle_r))
    assert line(fig, 0, "ours, anti-phase") == pytest.approx(points(rising[2:], lambda row: row.hip_ankle_r))
    phase = line(fig, 1, "by maxima (paper's, doubled)")
    assert phase == pytest.approx(points(rising, lambda row: row.relative_phase_deg))
    (bars,) = fig.axes[1].containers
    assert bars[0].get_xydata() == pytest.approx(points(rising, lambda row: abs(row.phase_mean_deg)))


def test_ranges_and_tracking_against_frequency():
    trajectory = sweep([0.3, 0.6])
    rows = measured(trajectory)
    fig = draw("ranges", trajectory)
    assert line(fig, 0, "hip") == pytest.approx(points(rows, lambda row: row.hip_range_deg))
    assert line(fig, 0, "ankle") == pytest.approx(points(rows, lambda row: row.ankle_range_deg))
    torques = [np.array(drawn.get_ydata()) for drawn in fig.axes[1].get_lines()]
    assert torques == [pytest.approx([20, 20], rel=1e-3), pytest.approx([40, 40], rel=1e-3)]  # 2 x 10 and 2 x 20 Nm
    fig = draw("tracking", trajectory)
    for panel, name in enumerate(("target_head_r", "head_amplitude_m", "head_speed_mps")):
        assert line(fig, panel, "ours") == pytest.approx(points(rows, lambda row, name=name: getattr(row, name)))
        published = np.stack([PAPER.freq_hz, getattr(PAPER, name)], 1)
        assert line(fig, panel, "paper Table 3") == pytest.approx(published)


def test_centre_of_pressure_in_millimetres():
    (row,) = measured(sweep([0.5]))
    ax = draw("cop", sweep([0.5])).axes[0]
    levels = {round(float(y), 6) for drawn in ax.get_lines() for y in drawn.get_ydata()}
    expected = [-0.0631, 0.1317, row.cop_p05_m, row.cop_p25_m, row.cop_p50_m, row.cop_p75_m, row.cop_p95_m]
    assert levels == {round(1e3 * x, 6) for x in expected}
    assert {"heel contact ends, -63 mm", "toe contact ends, 132 mm"} <= set(texts(ax.figure))


def test_the_motion_of_least_cost_is_drawn_where_the_rows_have_it():
    trajectory = sweep([0.3, 0.6])
    least = LeastCost(hip_ankle_r=-0.25, hip_range_deg=7.0, ankle_range_deg=5.0)
    rows = [replace(row, least=least) for row in measured(trajectory)]
    assert line(draw("coordination", trajectory, rows=rows), 0, "torque-optimal")[:, 1].tolist() == [-0.25] * 2
    ranges = draw("ranges", trajectory, rows=rows)
    assert line(ranges, 0, "hip, torque-optimal")[:, 1].tolist() == [7.0] * 2
    assert line(ranges, 0, "ankle, torque-optimal")[:, 1].tolist() == [5.0] * 2
    for name in ("coordination", "ranges"):
        assert not any("optimal" in text for text in texts(draw(name, trajectory)))


@pytest.mark.parametrize("name", [*OVER_TIME, *AGAINST_FREQUENCY])
def test_worlds_that_are_not_valid_are_marked(name):
    assert not any("fell" in text or "finite" in text for text in texts(draw(name, sweep([0.3, 0.6]))))
    assert sum("fell at 12.3 s" in text for text in texts(draw(name, sweep([0.3, 0.6, 0.9], [-1, 738, -1])))) == 1
    assert sum("fell at 0.0 s" in text for text in texts(draw(name, sweep([0.3, 0.6], [0, 0])))) == 2
    angle = sweep([0.3, 0.6]).joint_angle.copy()
    angle[500:, 0] = np.nan
    assert sum("not finite" in text for text in texts(draw(name, sweep([0.3, 0.6], joint_angle=angle)))) == 1


@pytest.mark.parametrize("name", ["coordination", "tracking"])
def test_nothing_published_is_drawn_where_there_is_nothing(name):
    assert not any("paper" in text for text in texts(draw(name, sweep([0.3, 0.9]), None)) if "doubled" not in text)


def test_published_modes_are_shaded():
    spans = draw("coordination", sweep([0.3])).axes[0].patches
    edges = {span.get_label(): (span.get_x(), span.get_x() + span.get_width()) for span in spans}
    assert edges == {
        "paper, in-phase": pytest.approx((0.3, 0.6)),
        "paper, anti-phase": pytest.approx((0.9, 1.2)),
        "paper, switch between": pytest.approx((0.6, 0.9)),
    }


@pytest.mark.parametrize(
    ("name", "units"),
    [
        ("head_target", ["[m]", "[s]"]),
        ("joint_angles", ["[deg]", "[s]"]),
        ("angle_plots", ["[deg]"]),
        ("coordination", ["[deg]", "[Hz]"]),
        ("ranges", ["[deg]", "[Nm per joint]", "[Hz]"]),
        ("tracking", ["[m]", "[m/s]", "[Hz]"]),
        ("cop", ["[mm]", "[Hz]"]),
    ],
)
def test_units_are_on_the_axes(name, units):
    drawn = " ".join(texts(draw(name, sweep([0.3, 0.9]))))
    assert [unit for unit in units if unit not in drawn.replace("mean head\nspeed", "")] == []


def test_a_still_joint_is_shown_as_undefined():
    angle = sweep([0.3, 0.6]).joint_angle.copy()
    angle[:, 0, ANKLES] = 0.01
    fig = draw("coordination", sweep([0.3, 0.6], joint_angle=angle))
    assert line(fig, 0, "ours, undefined").tolist() == [[0.3, 0.0]]
    assert "undefined" in texts(draw("angle_plots", sweep([0.3, 0.6], joint_angle=angle)))
    assert "undefined" not in texts(draw("angle_plots", sweep([0.3, 0.6])))


def test_a_ramp_has_no_figures_against_frequency(tmp_path):
    trajectory = sweep([math.nan])
    paths = figures.draw_all(trajectory, measured(trajectory), PAPER, tmp_path, SPAN)
    assert [path.stem for path in paths] == OVER_TIME
    fig = draw("head_target", trajectory)
    assert fig.axes[0].get_title() == "ramp" and len(line(fig, 0, "head")) == STEPS


def test_titles_name_the_conditions_that_differ():
    titles = [ax.get_title() for ax in draw("angle_plots", sweep([0.5] * 3, hip_k=np.array([25.0, 75, 150]))).axes]
    assert titles[:3] == [f"0.5 Hz, hip {k} Nm/rad" for k in (25, 75, 150)]


def test_no_load_on_the_feet_leaves_the_axes():
    fig = draw("cop", sweep([0.5, 0.6], cop_x=np.full((STEPS, 2), np.nan)))
    assert "toe contact ends, 132 mm" in texts(fig)


def test_panels_have_the_limits_of_the_valid_worlds():
    """A head thrown 50 m away in a fall changes no valid world's panel."""
    head = sweep([0.3, 0.6]).head_x.copy()
    head[700:, 1] = 50
    calm, thrown = (draw("head_target", sweep([0.3, 0.6], [-1, 738], **c)) for c in ({}, {"head_x": head}))
    assert [ax.get_ylim() for ax in thrown.axes] == [ax.get_ylim() for ax in calm.axes]
