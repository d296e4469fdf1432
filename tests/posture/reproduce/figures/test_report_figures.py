"""The report's figures: those drawn for which there are results, none blank, and in their axes what the rows say."""

import math
import warnings
from itertools import product
from pathlib import Path
from typing import Any

import matplotlib.image
import numpy as np
import pytest
from matplotlib import pyplot
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Rectangle

from posture.analysis.results import Row
from posture.analysis.trajectory import Trajectory
from posture.reproduce.figures import curves as report_curves
from posture.reproduce.figures import stiffness_map as report_map
from posture.reproduce.figures import traces as report_traces
from posture.reproduce.figures.all_figures import draw_report
from posture.reproduce.figures.seed_curves import (
    BAND_LABEL,
    SEED_LABEL,
    by_condition,
    draw_seeds,
    mark_falls,
    report_figure,
    shade_modes,
)

DT = 1 / 60
SPAN = (-0.06, 0.13)
TRANSITIONS = {"least": 0.66, "reward": math.nan, "sinusoid": 0.68}
FREQ = [0.15, 0.6, 0.75, 1.5]
PAPER: dict[str, Any] = {
    "table_1": {"target_height_m": 1.7},
    "table_3": {
        "freq_hz": FREQ,
        "target_head_r": [0.998, 0.993, 0.991, 0.967],
        "head_amplitude_m": [0.078, 0.079, 0.079, 0.083],
        "head_speed_mps": [0.05, 0.18, 0.23, 0.48],
        "mode": ["in", "in", "anti", "anti"],
    },
    "table_4": {
        "gamma": [0, 20, 40],
        "target_head_r": [0.99, 0.98, 0.998],
        "energy_j": [1600, 290, 340],
        "mode": ["anti", "in", "in"],
    },
    "experiment_3": {"freq_hz": 0.5, "hip_k_nm_per_rad": [25, 125, 200], "mode": ["anti", "in", "in"]},
    "experiment_4a": {"rate_hz_per_s": 0.036, "duration_s": 25, "window_steps": 300, "transition_hz": 0.69},
    "experiment_4b": {"load_kg": [0, 4], "mode_at_ends": ["in", "anti"]},
}
MEASURED = ("hip_ankle_r", "relative_phase_deg", "target_head_r", "head_amplitude_m", "head_speed_mps", "energy_j",
            "cost_ratio", "hip_range_deg", "ankle_range_deg", "hip_torque_range_nm", "ankle_torque_range_nm", "cop_p05_m",
            "cop_p50_m", "cop_p95_m", "least_hip_ankle_r", "least_phase_mean_deg", "least_energy_j",
            "reward_hip_ankle_r")  # fmt: skip
NAMES = {*(f"figure_{number}" for number in range(2, 14)), "amplitude", "engines", "tracking"}


def row(seed: int, *, fell: bool = False, **changes: Any) -> Row:
    """A row of the results. A seed lies 0.01 above the one before it in every column; a fall has only its conditions."""
    condition = {"seed": seed, "freq_hz": 0.4, "hip_k_nm_per_rad": 125.0, "load_kg": 0.0, "energy_weight": 20.0,
                 "amplitude_m": 0.1, "physics": "sagittal", "valid": not fell, "fell": fell}  # fmt: skip
    values = {name: math.nan if fell else 0.5 + 0.01 * seed for name in MEASURED}
    return {**condition, **values, **changes}


def all_rows(seeds: tuple[int, ...] = (1, 2, 3)) -> dict[str, list[Row]]:
    grid = product(seeds, [25.0, 125.0, 200.0], [0.25, 0.5])
    return {
        "frequency": [row(s, freq_hz=f, fell=f == 1.5 and s == 2) for s in seeds for f in FREQ],
        "energy": [row(s, energy_weight=g) for s in seeds for g in (0.0, 20.0, 40.0)],
        "hip_stiffness": [row(s, hip_k_nm_per_rad=k, freq_hz=f, hip_ankle_r=(k - 100) / 100) for s, k, f in grid],
        "ramp": [row(s, freq_hz=math.nan, transition_centred_hz=0.7, transition_trailing_hz=math.nan) for s in seeds],
        "load": [row(s, load_kg=load) for s in seeds for load in (0.0, 4.0)],
        "amplitude": [row(s, amplitude_m=a, freq_hz=f) for s in seeds for a in (0.08, 0.1) for f in FREQ],
        "engines": [
            row(s, physics=name, freq_hz=f, fell=name == "mujoco" and f == 1.5)
            for s in seeds for name in ("sagittal", "mujoco", "mujoco_c") for f in FREQ
        ],
    }  # fmt: skip


def trial(phase: np.ndarray, freq: list[float], fall_step: int = -1) -> Trajectory:
    """Worlds whose target has the phase (T, W) [rad]; hip and ankle in-phase up to a momentary 0.7 Hz, anti-phase above. The
    first world may fall."""
    speed = np.gradient(phase, DT, axis=0) / (2 * np.pi)
    hip, ankle = 0.1 * np.cos(phase) * np.where(speed < 0.7, 1, -1), 0.05 * np.cos(phase)
    joints = np.stack([hip, ankle, hip, ankle], axis=-1)
    fields: dict[str, Any] = {
        "time": np.arange(len(phase)) * DT, "freq": np.array(freq), "hip_k": np.full(len(freq), 125.0),
        "ankle_k": np.full(len(freq), 25.0), "load": np.zeros(len(freq)), "target_x": 0.1 - 0.1 * np.cos(phase),
        "head_x": 0.1 - 0.08 * np.cos(phase), "head_vx": np.sin(phase), "joint_angle": joints, "joint_velocity": joints,
        "joint_torque": joints, "cop_x": np.zeros_like(phase), "torso_height": np.ones_like(phase),
        "foot_displacement": np.zeros_like(phase), "foot_flat": np.ones(phase.shape, dtype=bool),
        "fall_step": np.array([fall_step] + [-1] * (len(freq) - 1)), "torque_limit": 100.0, "control_dt": DT,
    }  # fmt: skip
    return Trajectory(**fields)


def steady(freq: list[float], fall_step: int = -1) -> Trajectory:
    return trial(2 * np.pi * np.arange(1500)[:, None] * DT * np.array(freq), freq, fall_step)


def all_traces() -> dict[str, Trajectory]:
    time = np.arange(1500) * DT
    swept = trial((np.pi * 0.036 * time**2)[:, None], [math.nan])
    return {"frequency": steady(FREQ), "ramp": swept, "load_0": steady([0.4]), "load_4": steady([0.4], fall_step=900)}


def report(rows: dict[str, list[Row]], traces: dict[str, Trajectory], folder: Path) -> dict[str, Path]:
    return draw_report(rows, traces, PAPER, SPAN, TRANSITIONS, folder, ramp_start=0.0, still_joint_deg=0.5)


def labelled(ax: Axes, label: str) -> list[Line2D]:
    return [line for line in ax.lines if line.get_label() == label]


def told(fig: Figure) -> str:
    """What the annotations of all panels say."""
    return " ".join(text.get_text() for ax in fig.axes for text in ax.texts)


def test_all_are_drawn_and_none_is_blank(tmp_path: Path) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        drawn = report(all_rows(), all_traces(), tmp_path / "new")
    assert drawn.keys() == NAMES
    for name, path in drawn.items():
        page = matplotlib.image.imread(path)[..., :3]
        assert path == tmp_path / "new" / f"{name}.png"
        assert 900 < page.shape[1] < 1050, name  # 6.5 inches of 150 dots
        for half in np.array_split(page.mean(axis=-1), 2):
            assert half.std() > 0.03, name
    assert not pyplot.get_fignums()


@pytest.mark.parametrize(
    ("experiment", "figures"),
    [
        ("frequency", {"figure_5", "figure_6", "figure_7", "tracking"}),
        ("energy", {"figure_8"}),
        ("hip_stiffness", {"figure_9", "figure_13"}),
        ("ramp", set()),  # the rows alone have no trace to show
        ("load", {"figure_12"}),
        ("amplitude", {"amplitude"}),
        ("engines", {"engines"}),
    ],
)
def test_one_seed_of_one_experiment_gives_its_figures_alone(experiment: str, figures: set[str], tmp_path: Path) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        drawn = report({experiment: all_rows((1,))[experiment]}, {}, tmp_path)
    assert drawn.keys() == figures
    assert {path.stem for path in tmp_path.iterdir()} == figures


@pytest.mark.parametrize(
    ("names", "figures"),
    [
        (["frequency"], {"figure_2", "figure_3", "figure_4"}),
        (["ramp"], {"figure_10"}),
        (["load_0"], set()),
        (["load_0", "load_4"], {"figure_11"}),
    ],
)
def test_traces_alone_give_their_figures(names: list[str], figures: set[str], tmp_path: Path) -> None:
    traces = all_traces()
    assert report({}, {name: traces[name] for name in names}, tmp_path).keys() == figures


def test_nothing_is_drawn_of_nothing_and_all_may_have_fallen(tmp_path: Path) -> None:
    assert report({"energy": []}, {}, tmp_path) == {}
    gone = {"valid": False, "fell": True, **dict.fromkeys(MEASURED, math.nan)}
    fallen = {name: [{**found, **gone} for found in rows] for name, rows in all_rows().items()}
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert len(report(fallen, {"frequency": steady(FREQ, fall_step=700)}, tmp_path)) == 13


def test_a_paper_without_tables_leaves_ours(tmp_path: Path) -> None:
    drawn = draw_report(all_rows(), all_traces(), {}, SPAN, {}, tmp_path, ramp_start=0.0, still_joint_deg=0.5)
    # The height of the target, the frequency of Exp. 3 and the ramp are the paper's.
    assert drawn.keys() == NAMES - {"figure_2", "figure_9", "figure_10"}


def test_by_condition_keeps_conditions_and_leaves_falls_out() -> None:
    rows = [row(1, load_kg=4.0, hip_ankle_r=0.2), row(2, load_kg=4.0, fell=True), row(1, load_kg=0.0, fell=True)]
    at, values = by_condition(rows, "load_kg", "hip_ankle_r")
    assert at.tolist() == [0.0, 4.0]
    assert [found.tolist() for found in values] == [[], [0.2]]
    # A fall whose value was recorded all the same does not count, either; nor a column that is not there.
    assert by_condition([row(1, fell=True, hip_ankle_r=0.3)], "load_kg", "hip_ankle_r")[1][0].size == 0
    assert by_condition([row(1)], "load_kg", "unknown")[1][0].size == 0


def test_mean_band_and_every_seed_are_in_the_axes() -> None:
    ax = Figure().subplots()
    values = {(0.2, 1): 0.5, (0.2, 2): 0.7, (0.4, 1): -0.3, (0.4, 2): -0.1, (0.6, 1): -0.8}
    rows = [row(seed, freq_hz=f, hip_ankle_r=r) for (f, seed), r in values.items()]
    draw_seeds(ax, rows, "freq_hz", "hip_ankle_r", factor=10.0, label="ours")
    (mean,) = labelled(ax, "ours")
    np.testing.assert_allclose(np.array(mean.get_data()), [[0.2, 0.4, 0.6], [6.0, -2.0, -8.0]])
    (seeds,) = labelled(ax, SEED_LABEL)
    assert sorted(zip(*np.array(seeds.get_data()).tolist(), strict=True)) == sorted(
        (f, 10 * r) for (f, _), r in values.items()
    )
    assert seeds.get_markerfacecolor() == "none"
    (band,) = ax.collections
    assert band.get_label() == BAND_LABEL
    corners = band.get_paths()[0].vertices
    # Of two seeds the interval reaches from the one to the other; of one there is none.
    assert corners[:, 0].max() == 0.4
    np.testing.assert_allclose([corners[corners[:, 0] == 0.2, 1].min(), corners[corners[:, 0] == 0.2, 1].max()], [5, 7])


def test_a_condition_in_which_all_fell_breaks_the_line() -> None:
    ax = Figure().subplots()
    rows = [row(1, freq_hz=0.2), row(1, freq_hz=0.4, fell=True), row(1, freq_hz=0.6)]
    draw_seeds(ax, rows, "freq_hz", "hip_ankle_r", label="ours")
    assert np.isnan(np.asarray(labelled(ax, "ours")[0].get_ydata())).tolist() == [False, True, False]
    assert not ax.collections


def test_falls_are_marked_with_their_share() -> None:
    ax = Figure().subplots()
    mark_falls(ax, [row(1, freq_hz=0.2), row(2, freq_hz=0.2, fell=True), row(1, freq_hz=1.5)], "freq_hz")
    assert [(mark.xy[0], mark.get_text()[2:]) for mark in ax.texts] == [(0.2, "1/2")]  # type: ignore[attr-defined]
    with report_figure(6.0) as fig:
        report_curves.coordination(fig, all_rows()["frequency"], PAPER)
    assert told(fig).count("1/3") == 2  # in both panels


def test_the_correlation_is_drawn_beside_theory_and_the_papers_modes() -> None:
    rows = [row(s, freq_hz=f, hip_ankle_r=0.7 - f, least_hip_ankle_r=0.6 - f) for s in (1, 2) for f in FREQ]
    with report_figure(6.0) as fig:
        report_curves.coordination(fig, rows, PAPER)
    upper = fig.axes[0]
    np.testing.assert_allclose(labelled(upper, "mean of the seeds")[0].get_xydata(), [(f, 0.7 - f) for f in FREQ])
    np.testing.assert_allclose(labelled(upper, "torque-optimal")[0].get_xydata(), [(f, 0.6 - f) for f in FREQ])
    spans = {p.get_label(): (p.get_x(), p.get_x() + p.get_width()) for p in upper.patches if isinstance(p, Rectangle)}
    assert spans == {
        "paper: in-phase": pytest.approx((0.15, 0.6)),
        "paper: anti-phase": pytest.approx((0.75, 1.5)),
        "paper: switch between": pytest.approx((0.6, 0.75)),
    }


def test_modes_that_come_in_either_order_are_shaded() -> None:
    ax = Figure().subplots()
    shade_modes(ax, [0, 5, 10, 40], ["anti", "anti", "in", "in"])
    spans = {p.get_label(): (p.get_x(), p.get_width()) for p in ax.patches if isinstance(p, Rectangle)}
    assert spans == {"paper: anti-phase": (0, 5), "paper: in-phase": (10, 30), "paper: switch between": (5, 5)}


def test_table_4_stands_beside_exp_2_and_exp_3_is_that_at_its_frequency(tmp_path: Path) -> None:
    with report_figure(6.0) as fig:
        report_curves.effort(fig, all_rows()["energy"], PAPER)
    (energy,) = labelled(fig.axes[2], "paper Table 4")
    assert energy.get_xydata().tolist() == [[0, 1600], [20, 290], [40, 340]]  # type: ignore[union-attr]
    elsewhere = [row(1, hip_k_nm_per_rad=k, freq_hz=0.25) for k in (25.0, 125.0)]
    assert report({"hip_stiffness": elsewhere}, {}, tmp_path).keys() == {"figure_13"}


def test_the_map_is_the_mean_over_seeds_that_stood() -> None:
    rows = [
        row(1, hip_k_nm_per_rad=50.0, freq_hz=0.1, hip_ankle_r=0.6, least_hip_ankle_r=0.9),
        row(2, hip_k_nm_per_rad=50.0, freq_hz=0.1, hip_ankle_r=0.2, least_hip_ankle_r=0.9),
        row(1, hip_k_nm_per_rad=50.0, freq_hz=0.2, hip_ankle_r=-0.4, least_hip_ankle_r=-0.9),
        row(2, hip_k_nm_per_rad=50.0, freq_hz=0.2, fell=True, hip_ankle_r=1.0),
        row(1, hip_k_nm_per_rad=75.0, freq_hz=0.1, hip_ankle_r=0.8, least_hip_ankle_r=0.9),
        row(1, hip_k_nm_per_rad=75.0, freq_hz=0.2, fell=True),
    ]
    ax = Figure().subplots()
    mesh = report_map.draw_plane(ax, rows)
    drawn = np.ma.filled(np.ma.asarray(mesh.get_array()).astype(float), np.nan).reshape(2, 2)
    np.testing.assert_allclose(drawn, [[0.4, 0.8], [-0.4, np.nan]])  # a frequency a line, a stiffness a column
    hatched = [p.get_xy() for p in ax.patches if isinstance(p, Rectangle) and p.get_hatch()]
    np.testing.assert_allclose(sorted(hatched), [(37.5, 0.15), (62.5, 0.15)])
    # Ours crosses zero halfway between 0.1 and 0.2 Hz at 50 Nm/rad.
    zero = np.concatenate([path.vertices for path in ax.collections[-2].get_paths()])
    np.testing.assert_allclose(zero[np.argmin(zero[:, 0])], [50, 0.15])


def test_the_ramp_shows_its_zeros_beside_the_papers() -> None:
    rows, swept = all_rows()["ramp"], all_traces()["ramp"]
    with report_figure(6.0) as fig:
        report_traces.ramp(fig, swept, rows, PAPER, TRANSITIONS, 0.0, 0.0)
    lower = fig.axes[1]
    f, r = labelled(lower, "correlation, centred window")[0].get_data()
    crossing = float(np.asarray(f)[np.nanargmin(np.abs(np.asarray(r)))])
    assert abs(crossing - 0.7) < 0.02  # where this stander switches
    assert np.asarray(labelled(lower, "zero of a seed, centred")[0].get_xdata()).tolist() == [0.7] * 3
    assert not labelled(lower, "zero of a seed, trailing")  # all nan
    assert labelled(lower, "paper: 0.69 Hz")
    assert "theory: 0.66-0.68 Hz" in [patch.get_label() for patch in lower.patches]


def test_worlds_are_those_nearest_and_a_fall_is_told() -> None:
    found = report_traces.shown_worlds(steady([0.2, 1.4, 0.8]), (0.15, 0.75, 1.5))
    assert [world.title for world in found] == ["0.2 Hz", "0.8 Hz", "1.4 Hz"]
    assert [world.number for world in found] == [0, 2, 1]
    with report_figure(4.0) as fig:
        report_traces.joint_angles(fig, report_traces.load_worlds(all_traces()))
    assert [ax.get_title() for ax in fig.axes] == [
        "load 0 kg, 0.4 Hz: hip-ankle correlation 1.00",
        "load 4 kg, 0.4 Hz: hip-ankle correlation 1.00, fell at 15.0 s",
    ]


def test_a_cycle_is_the_last_whole_one_before_the_end_or_the_fall() -> None:
    # 1500 steps of 1/60 s at 0.15 Hz: 400 steps a cycle, three of them whole; before step 900, two.
    assert report_traces.cycle_steps(steady([0.15]), 0) == [800, 900, 1000, 1100, 1200]
    assert report_traces.cycle_steps(steady([0.15], fall_step=900), 0) == [400, 500, 600, 700, 800]
    assert report_traces.cycle_steps(steady([0.15], fall_step=150), 0) == [0, 100, 150, 150, 150]
