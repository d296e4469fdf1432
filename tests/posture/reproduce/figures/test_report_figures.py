"""The report's figures: drawn for the results there are, and their axes show what the results say."""

import math
import warnings
from collections.abc import Sequence
from dataclasses import replace
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

from posture.analysis.results import LeastCost, RampTransitions, Result
from posture.reproduce.figures import curves, traces
from posture.reproduce.figures.draw import draw_report
from posture.reproduce.figures.seed_curves import (
    BAND_LABEL,
    MEAN_LABEL,
    SEED_LABEL,
    draw_seeds,
    mark_falls,
    report_figure,
    shade_modes,
    values_by_condition,
)
from posture.reproduce.figures.stiffness_map import draw_cells
from posture.reproduce.quantities import FREQ, HIP_ANKLE_R, LOAD
from posture.reproduce.reproduction import Traces
from tests.posture.reproduce.examples import (
    PAPER,
    REPORT,
    TEN,
    TRANSITIONS,
    fallen,
    frequency_result,
    paper_results,
    reproduction,
    result,
    steady,
    swept,
)

FREQUENCY_FIGURES = {"overview", "figure_5", "figure_6", "figure_7", "tracking"}


def draw(folder: Path, results: dict[str, list[Result]], given: Traces = Traces()) -> set[str]:  # noqa: B008
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        drawn = draw_report(reproduction(results, given), PAPER, REPORT, folder)
    assert {path.stem for path in folder.iterdir()} == drawn.keys()
    return set(drawn)


def labelled(ax: Axes, label: str) -> list[Line2D]:
    return [line for line in ax.lines if line.get_label() == label]


def spans(ax: Axes) -> dict[Any, tuple[float, float]]:
    return {p.get_label(): (p.get_x(), p.get_x() + p.get_width()) for p in ax.patches if isinstance(p, Rectangle)}


def test_all_figures_are_drawn_and_none_is_blank(tmp_path: Path) -> None:
    given = Traces(steady(TEN), swept(), {0.0: steady([0.4]), 4.0: steady([0.4], fall_step=900)})
    names = {*(f"figure_{number}" for number in range(2, 14)), "amplitude", "engines", "overview", "tracking"}
    assert draw(tmp_path, paper_results(), given) == names
    for path in tmp_path.iterdir():
        page = matplotlib.image.imread(path)[..., :3]
        assert 900 < page.shape[1] < 1050, path  # 6.5 inches at 150 dpi
        for half in np.array_split(page.mean(axis=-1), 2):
            assert half.std() > 0.03, path
    assert not pyplot.get_fignums()


@pytest.mark.parametrize(
    ("experiment", "figures"),
    [
        ("frequency", FREQUENCY_FIGURES),
        ("energy", {"figure_8"}),
        ("hip_stiffness", {"figure_9", "figure_13"}),
        ("ramp", set()),  # it needs a trajectory
        ("load", {"figure_12"}),
        ("amplitude", {"amplitude"}),
        ("engines", {"engines"}),
    ],
)
def test_one_seed_of_one_experiment_gives_its_figures(experiment: str, figures: set[str], tmp_path: Path) -> None:
    assert draw(tmp_path, {experiment: paper_results(1)[experiment]}) == figures


@pytest.mark.parametrize(
    ("given", "figures"),
    [
        *((Traces(frequency=steady(TEN, fall)), {"figure_2", "figure_3", "figure_4"}) for fall in (700, 40, 1, 0)),
        *((Traces(ramp=swept(fall)), {"figure_10"}) for fall in (-1, 700, 1, 0)),
        (Traces(load={0.0: steady([0.4])}), set()),
        (Traces(load={0.0: steady([0.4]), 4.0: steady([0.4])}), {"figure_11"}),
    ],
)
def test_trajectories_give_their_figures(given: Traces, figures: set[str], tmp_path: Path) -> None:
    assert draw(tmp_path, {}, given) == figures


def test_figures_of_falls_only(tmp_path: Path) -> None:
    results = {name: list(map(fallen, own)) for name, own in paper_results(2).items()}
    assert len(draw(tmp_path, results)) == 11


def test_falls_have_no_values() -> None:
    results = [result(0.2, 1, load_kg=4.0), fallen(result(0.5, 2, load_kg=4.0)), fallen(result(0.5, 1))]
    at, values = values_by_condition(results, LOAD, HIP_ANKLE_R.measured)
    assert at.tolist() == [0.0, 4.0]
    assert [known.tolist() for known in values] == [[], [0.2]]
    # Not even if a value was recorded.
    recorded = replace(fallen(result()), hip_ankle_r=0.3)
    assert values_by_condition([recorded], LOAD, HIP_ANKLE_R.measured)[1][0].size == 0


def test_mean_interval_and_every_seed_are_drawn() -> None:
    ax = Figure().subplots()
    values = {(0.2, 1): 0.5, (0.2, 2): 0.7, (0.4, 1): -0.3, (0.4, 2): -0.1, (0.6, 1): -0.8}
    results = [result(r, seed, freq_hz=f) for (f, seed), r in values.items()]
    draw_seeds(ax, results, FREQ, HIP_ANKLE_R.measured, factor=10.0)
    (mean,), (seeds,) = labelled(ax, MEAN_LABEL), labelled(ax, SEED_LABEL)
    np.testing.assert_allclose(np.array(mean.get_data()), [[0.2, 0.4, 0.6], [6.0, -2.0, -8.0]])
    drawn = zip(*np.array(seeds.get_data()).tolist(), strict=True)
    assert sorted(drawn) == sorted((f, 10 * r) for (f, _), r in values.items())
    assert seeds.get_markerfacecolor() == "none"
    (band,) = ax.collections
    assert band.get_label() == BAND_LABEL
    corners = band.get_paths()[0].vertices
    # The interval of two seeds is that between them; a single one has none.
    assert corners[:, 0].max() == 0.4
    np.testing.assert_allclose([corners[corners[:, 0] == 0.2, 1].min(), corners[corners[:, 0] == 0.2, 1].max()], [5, 7])


def test_a_condition_in_which_all_fell_interrupts_the_line() -> None:
    ax = Figure().subplots()
    results = [result(freq_hz=0.2), fallen(result(freq_hz=0.4)), result(freq_hz=0.6)]
    draw_seeds(ax, results, FREQ, HIP_ANKLE_R.measured)
    assert np.isnan(np.asarray(labelled(ax, MEAN_LABEL)[0].get_ydata())).tolist() == [False, True, False]
    assert not ax.collections


def test_falls_are_marked_with_their_share() -> None:
    ax = Figure().subplots()
    mark_falls(ax, [result(freq_hz=0.2), fallen(result(seed=2, freq_hz=0.2)), result(freq_hz=1.5)], FREQ)
    assert [(mark.xy[0], mark.get_text()[2:]) for mark in ax.texts] == [(0.2, "1/2")]  # type: ignore[attr-defined]


def test_coordination_is_drawn_with_theory_and_the_papers_modes() -> None:
    results = [replace(frequency_result(hz, s), hip_ankle_r=0.7 - hz) for s in (1, 2) for hz in TEN]
    with report_figure(6.0) as fig:
        curves.coordination(fig, results, PAPER)
    upper = fig.axes[0]
    np.testing.assert_allclose(labelled(upper, MEAN_LABEL)[0].get_xydata(), [(hz, 0.7 - hz) for hz in TEN])
    np.testing.assert_allclose(
        labelled(upper, "torque-optimal")[0].get_xydata(), [(hz, np.tanh(3 * (0.66 - hz))) for hz in TEN]
    )
    assert spans(upper) == {
        "paper: in-phase": pytest.approx((0.15, 0.6)),
        "paper: anti-phase": pytest.approx((0.75, 1.5)),
        "paper: switch between": pytest.approx((0.6, 0.75)),
    }
    ax = Figure().subplots()
    shade_modes(ax, [0, 5, 10, 40], ["anti", "anti", "in", "in"])  # the other order
    assert spans(ax) == {"paper: anti-phase": (0, 5), "paper: in-phase": (10, 40), "paper: switch between": (5, 10)}


def test_paper_table_4_is_drawn_beside_exp_2() -> None:
    with report_figure(6.0) as fig:
        curves.effort(fig, paper_results(1)["energy"], PAPER)
    published = np.column_stack([PAPER.table_4.gamma, PAPER.table_4.energy_j])
    np.testing.assert_allclose(labelled(fig.axes[2], "paper Table 4")[0].get_xydata(), published)


def test_the_map_is_the_mean_over_seeds_that_stood() -> None:
    def at(k: float, hz: float, r: float, seed: int, theory: float) -> Result:
        return result(r, seed, hip_k_nm_per_rad=k, freq_hz=hz, least=LeastCost(hip_ankle_r=theory))

    results = [
        at(50, 0.1, 0.6, 1, 0.9),
        at(50, 0.1, 0.2, 2, 0.9),
        at(50, 0.2, -0.4, 1, -0.9),
        fallen(at(50, 0.2, 1.0, 2, -0.9)),
        at(75, 0.1, 0.8, 1, 0.9),
        fallen(at(75, 0.2, 0.5, 1, math.nan)),
    ]
    ax = Figure().subplots()
    mesh = draw_cells(ax, results)
    drawn = np.ma.filled(np.ma.asarray(mesh.get_array()).astype(float), np.nan).reshape(2, 2)
    np.testing.assert_allclose(drawn, [[0.4, 0.8], [-0.4, np.nan]])  # a row for each frequency, a column for each stiffness
    hatched = [p.get_xy() for p in ax.patches if isinstance(p, Rectangle) and p.get_hatch()]
    np.testing.assert_allclose(sorted(hatched), [(37.5, 0.15), (62.5, 0.15)])
    # Ours crosses zero halfway between 0.1 and 0.2 Hz at 50 Nm/rad.
    zero = np.concatenate([path.vertices for path in ax.collections[-2].get_paths()])
    np.testing.assert_allclose(zero[np.argmin(zero[:, 0])], [50, 0.15])


def test_the_ramp_shows_its_zeros_beside_the_papers() -> None:
    results = [result(seed=seed, ramp=RampTransitions(0.7, 1, math.nan, math.nan)) for seed in (1, 2, 3)]
    with report_figure(6.0) as fig:
        traces.ramp(fig, swept(), results, PAPER.experiment_4a, TRANSITIONS, 0.0, 0.0)
    lower = fig.axes[1]
    f, r = labelled(lower, "correlation, centred window")[0].get_data()
    crossing = float(np.asarray(f)[np.nanargmin(np.abs(np.asarray(r)))])
    assert abs(crossing - 0.7) < 0.02  # where the made-up trajectory switches
    assert np.asarray(labelled(lower, "zero of a seed, centred")[0].get_xdata()).tolist() == [0.7] * 3
    assert not labelled(lower, "zero of a seed, trailing")  # all nan
    assert labelled(lower, "paper: 0.69 Hz")
    assert "theory: 0.66-0.68 Hz" in [patch.get_label() for patch in lower.patches]


def test_panels_show_the_nearest_frequencies_and_name_falls() -> None:
    found = traces.shown_worlds(steady([0.2, 1.4, 0.8]), REPORT.figures.freq_hz)
    assert [(world.title, world.number) for world in found] == [("0.2 Hz", 0), ("0.8 Hz", 2), ("1.4 Hz", 1)]
    with report_figure(4.0) as fig:
        traces.joint_angles(fig, traces.load_worlds({0.0: steady([0.4]), 4.0: steady([0.4], fall_step=900)}))
    assert [ax.get_title() for ax in fig.axes] == [
        "load 0 kg, 0.4 Hz: hip-ankle correlation 1.00",
        "load 4 kg, 0.4 Hz: hip-ankle correlation 1.00, fell at 15.0 s",
    ]


@pytest.mark.parametrize(
    ("fall_step", "steps"),
    [
        (-1, [800, 900, 1000, 1100, 1200]),
        (900, [400, 500, 600, 700, 800]),
        (150, [0, 100, 149, 149, 149]),  # the last step before the fall
        (1, [0, 0, 0, 0, 0]),
        (0, []),
    ],
)
def test_the_last_whole_cycle_is_shown(fall_step: int, steps: Sequence[int]) -> None:
    # 1500 steps of 1/60 s at 0.15 Hz are three whole cycles of 400 steps; two before step 900.
    assert traces.cycle_steps(steady([0.15], fall_step), 0) == steps
