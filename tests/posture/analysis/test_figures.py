"""The figures: all drawn, none blank, falls written out, published values drawn where there are any."""

import re
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import matplotlib
import matplotlib.image
import numpy as np
import pytest
from matplotlib import pyplot

from envs.body.joints import ANKLES
from posture.analysis import figures
from posture.analysis.coordination import measure_trajectory
from posture.analysis.results import Result
from posture.analysis.trajectory import Trajectory

DT, STEPS = 0.02, 1000  # 20 s
SPAN = (-0.0631, 0.1317)
PAPER = {
    "table_3": {
        "freq_hz": [0.3, 0.6, 0.9, 1.2],
        "target_head_r": [0.99, 0.98, 0.97, 0.96],
        "head_amplitude_m": [0.08, 0.081, 0.082, 0.083],
        "head_speed_mps": [0.1, 0.2, 0.3, 0.4],
        "mode": ["in", "in", "anti", "anti"],
    }
}
NAMES = {"head_target", "joint_angles", "angle_plots", "coordination", "ranges", "tracking", "cop"}
AGAINST_FREQUENCY = {"coordination", "ranges", "tracking", "cop"}


def sweep(freq: list[float], fall_step: list[int] | None = None, **changes: Any) -> Trajectory:
    """In-phase below 0.75 Hz and anti-phase above; the head a little late."""
    f, time = np.array(freq), np.arange(STEPS) * DT
    angle = 2 * np.pi * np.nan_to_num(f, nan=0.5) * time[:, None]
    hip, ankle = -0.1 * np.cos(angle) * np.where(f < 0.75, 1, -1), -0.05 * np.cos(angle + 0.2)
    joints = np.stack([hip, ankle, hip, ankle], axis=-1)
    shape = angle.shape
    fields: dict[str, Any] = {
        "time": time, "freq": f, "hip_k": np.full(len(f), 125.0), "ankle_k": np.full(len(f), 25.0),
        "load": np.zeros(len(f)), "target_x": 0.1 - 0.1 * np.cos(angle),
        "head_x": 0.1 - 0.08 * np.cos(angle - 0.1),
        "head_vx": np.sin(angle), "joint_angle": joints, "joint_velocity": joints,
        "joint_torque": 100 * joints,
        "cop_x": 0.03 + 0.04 * np.cos(angle), "torso_height": np.full(shape, 1.29),
        "foot_displacement": np.zeros(shape), "foot_flat": np.ones(shape, dtype=bool),
        "fall_step": np.array(fall_step or [-1] * len(f)), "torque_limit": 100.0, "control_dt": DT,
    }  # fmt: skip
    return Trajectory(**{**fields, **changes})


def measured(trajectory: Trajectory) -> list[Result]:
    return measure_trajectory(trajectory, transient_s=2.0, tolerance_m=0.025, still_joint_deg=0.5)


def drawing(name: str, trajectory: Trajectory, paper: figures.Paper, path: Path) -> None:
    """Draw the figure `name` alone."""
    draw: Callable[..., None] = getattr(figures, f"fig_{name}")
    draw(trajectory, measured(trajectory), paper, path, *([SPAN] if name == "cop" else []))


def text_of(name: str, trajectory: Trajectory, paper: figures.Paper, folder: Path) -> str:
    """The figure as SVG, whose labels are plain text."""
    path = folder / f"{name}.svg"
    with matplotlib.rc_context({"svg.fonttype": "none"}):
        drawing(name, trajectory, paper, path)
    return path.read_text()


def ink(path: Path) -> float:
    """Standard deviation of the grey level, 0 for a blank page."""
    return float(matplotlib.image.imread(path)[..., :3].mean(axis=-1).std())


def test_all_are_drawn_and_none_is_blank(tmp_path: Path) -> None:
    trajectory = sweep([0.3, 0.6, 0.9, 1.2], [-1, -1, -1, 615])
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        paths = figures.draw_all(trajectory, measured(trajectory), PAPER, tmp_path / "new", SPAN)
    assert {path.stem for path in paths} == NAMES
    assert set(paths) == set((tmp_path / "new").iterdir())
    assert all(ink(path) > 0.03 for path in paths)
    assert pyplot.get_fignums() == []


@pytest.mark.parametrize("name", sorted(NAMES))
def test_the_data_is_drawn(name: str, tmp_path: Path) -> None:
    """Other data, another picture: axes and labels alone would be the same."""
    calm = sweep([0.3, 0.6])
    head = 0.1 + 0.7 * (calm.head_x - 0.1) + 0.02 * np.sin(9 * calm.time)[:, None]
    large = sweep(
        [0.3, 0.6],
        head_x=head,
        head_vx=2 * calm.head_vx,
        cop_x=calm.cop_x**2 * 10,
        joint_angle=calm.joint_angle * [2, -1, 2, -1],
        joint_torque=3 * calm.joint_torque,
    )
    drawing(name, calm, None, tmp_path / "calm.png")
    drawing(name, large, None, tmp_path / "large.png")
    assert (tmp_path / "calm.png").read_bytes() != (tmp_path / "large.png").read_bytes()


@pytest.mark.parametrize("name", sorted(NAMES))
def test_a_fall_is_written_out(name: str, tmp_path: Path) -> None:
    # Step 615 of 0.02 s: 12.3 s.
    assert "fell at 12.3 s" in text_of(name, sweep([0.3, 0.6, 0.9], [-1, 615, -1]), PAPER, tmp_path)
    assert "fell" not in text_of(name, sweep([0.3, 0.6, 0.9]), PAPER, tmp_path)


@pytest.mark.parametrize("name", sorted(NAMES))
@pytest.mark.parametrize("fall_step", [0, 999])
def test_a_sweep_in_which_all_fall(name: str, fall_step: int, tmp_path: Path) -> None:
    time = f"fell at {fall_step * DT:.1f} s"
    assert text_of(name, sweep([0.3, 0.6], [fall_step] * 2), PAPER, tmp_path).count(time) >= 2


def test_a_world_that_blew_up_is_marked(tmp_path: Path) -> None:
    angle = sweep([0.3, 0.6]).joint_angle.copy()
    angle[500:, 0] = np.nan
    for name in NAMES:
        assert "not finite" in text_of(name, sweep([0.3, 0.6], joint_angle=angle), None, tmp_path)


@pytest.mark.parametrize("name", ["coordination", "tracking"])
@pytest.mark.parametrize("paper", [None, {}, {"table_3": {}}, {"table_3": {"freq_hz": [0.3]}}, {"table_1": {"a": 1}}])
def test_nothing_published_is_drawn_where_there_is_nothing(name: str, paper: figures.Paper, tmp_path: Path) -> None:
    assert ">paper" not in text_of(name, sweep([0.3, 0.9]), paper, tmp_path)


def test_published_values_are_drawn(tmp_path: Path) -> None:
    trajectory = sweep([0.3, 0.9])
    assert "paper Table 3" in text_of("tracking", trajectory, PAPER, tmp_path)
    modes = text_of("coordination", trajectory, PAPER, tmp_path)
    assert all(label in modes for label in ("paper, in-phase", "paper, anti-phase", "paper, switch between"))


def test_foot_span_is_drawn_where_it_is(tmp_path: Path) -> None:
    cop = text_of("cop", sweep([0.3, 0.9]), None, tmp_path)
    assert "heel contact ends, -63 mm" in cop
    assert "toe contact ends, 132 mm" in cop


def test_draw_all_passes_the_foot_span_on(tmp_path: Path) -> None:
    trajectory = sweep([0.3, 0.9])
    figures.draw_all(trajectory, measured(trajectory), None, tmp_path, SPAN)
    drawing("cop", trajectory, None, tmp_path / "alone.png")
    assert (tmp_path / "cop.png").read_bytes() == (tmp_path / "alone.png").read_bytes()


def test_units_are_on_the_axes(tmp_path: Path) -> None:
    units = {
        "head_target": ["[m]", "[s]"], "joint_angles": ["[deg]", "[s]"], "angle_plots": ["[deg]"],
        "coordination": ["[deg]", "[Hz]"], "ranges": ["[deg]", "[Nm per joint]", "[Hz]"],
        "tracking": ["[m]", "[m/s]", "[Hz]"], "cop": ["[mm]", "[Hz]"],
    }  # fmt: skip
    for name, expected in units.items():
        text = text_of(name, sweep([0.3, 0.9]), None, tmp_path)
        assert [unit for unit in expected if unit not in text] == []


def test_a_still_joint_is_shown_as_undefined(tmp_path: Path) -> None:
    angle = sweep([0.3, 0.6]).joint_angle.copy()
    angle[:, 0, ANKLES] = 0.01
    for name, label in {"coordination": "ours, undefined", "angle_plots": "undefined"}.items():
        assert label in text_of(name, sweep([0.3, 0.6], joint_angle=angle), None, tmp_path)
        assert label not in text_of(name, sweep([0.3, 0.6]), None, tmp_path)


def test_a_ramp_has_no_figures_against_frequency(tmp_path: Path) -> None:
    trajectory = sweep([np.nan])
    paths = figures.draw_all(trajectory, measured(trajectory), PAPER, tmp_path, SPAN)
    assert {path.stem for path in paths} == NAMES - AGAINST_FREQUENCY
    assert "ramp" in text_of("head_target", trajectory, None, tmp_path)


def test_worlds_that_share_a_frequency_are_told_apart(tmp_path: Path) -> None:
    text = text_of("angle_plots", sweep([0.5] * 3, hip_k=np.array([25.0, 75, 150])), None, tmp_path)
    assert all(f"0.5 Hz, hip {k} Nm/rad" in text for k in (25, 75, 150))


@pytest.mark.parametrize("freq", [[0.5], [0.015], [0.1 * n for n in range(1, 13)]])
def test_any_number_of_worlds(freq: list[float], tmp_path: Path) -> None:
    trajectory = sweep(freq)
    assert len(figures.draw_all(trajectory, measured(trajectory), PAPER, tmp_path, SPAN)) == len(NAMES)


def test_no_load_on_the_feet_leaves_the_axes(tmp_path: Path) -> None:
    trajectory = sweep([0.5, 0.6], cop_x=np.full((STEPS, 2), np.nan))
    assert "toe contact" in text_of("cop", trajectory, None, tmp_path)


def test_panels_keep_the_limits_of_those_who_stood(tmp_path: Path) -> None:
    """A head thrown 50 m away in a fall changes no valid world's panel."""
    head = sweep([0.3, 0.6]).head_x.copy()
    head[600:, 1] = 50
    thrown = text_of("head_target", sweep([0.3, 0.6], [-1, 615], head_x=head), None, tmp_path)
    labels = re.findall(r">(\d+(?:\.\d+)?)<", thrown)
    assert "0.20" in labels
    assert not {"20", "40", "50"} & set(labels)
