"""The tables of the report, and the numbers in its text."""

import math
from dataclasses import replace

from posture.analysis.results import NO_LEAST, NO_RAMP, RampTransitions
from posture.cli.jobs import check
from posture.config.train import TrainConfig
from posture.reproduce.claims.evaluate import one_policy_verdicts
from posture.reproduce.page.page import Table
from posture.reproduce.page.report import numbers_in_text
from posture.reproduce.page.tables import (
    energy_table,
    engine_table,
    mode_table,
    ramp_table,
    recipe_verdict_table,
    switch_text,
)
from posture.reproduce.page.text import FIGURES, HOW_TO_READ
from tests.posture.reproduce.examples import (
    PAPER,
    REPORT,
    TEN,
    TRANSITIONS,
    changed,
    fallen,
    flipped,
    frequency_result,
    paper_results,
    result,
    with_r,
)

EXAMPLE = paper_results()


def cells(table: Table, heading: str) -> list[str]:
    return [row[list(table.headings).index(heading)] for row in table.rows]


def test_falls_are_counted_and_the_mode_of_a_few_is_not_named() -> None:
    results = changed(EXAMPLE["frequency"], fallen, lambda t: t.freq_hz == 1.5 and t.origin.seed > 1)
    results = changed(results, with_r(-0.4), lambda t: t.freq_hz == 0.15 and t.origin.seed == 1)
    table = mode_table(results, PAPER.table_3)
    assert cells(table, "stood") == ["3/3"] * 14 + ["1/3"]
    assert cells(table, "mode")[0] == "in-phase (1 of 3 not)" and cells(table, "mode")[-1] == "no mode"
    energy = changed(EXAMPLE["energy"], fallen, lambda t: t.origin.seed == 3)
    assert set(cells(energy_table(energy, PAPER.table_4), "stood")) == {"2/3"}


def test_tables_without_theory_and_cost() -> None:
    results = [replace(frequency_result(hz, seed), least=NO_LEAST, cost_ratio=math.nan) for hz in TEN for seed in (1, 2)]
    table = mode_table(results, PAPER.table_3)
    assert set(cells(table, "cost / least")) == set(cells(table, "least-torque r")) == {"-"}
    results = changed(results, with_r(0.5), lambda t: t.freq_hz == 1.5 and t.origin.seed == 2)
    last = engine_table(results).rows[-1]
    assert last[0] == "switch [Hz]" and last[1].endswith("(none in 1 of 2)")
    ramp = [result(ramp=RampTransitions(0.7, 3, math.nan, math.nan))]
    assert list(ramp_table(ramp, PAPER.experiment_4a).rows[0]) == ["seed 1", "0.70", "3", "-", "-"]


def test_each_training_is_judged_by_its_own_results() -> None:
    """One that is as the paper reports, and one that has the other mode in every trial and does not switch in the ramp."""
    frequency, ramp, load = (EXAMPLE[name] for name in ("frequency", "ramp", "load"))
    other = changed(frequency, flipped), changed(ramp, lambda t: replace(t, ramp=NO_RAMP)), changed(load, flipped)
    by_recipe = {"frequency": (frequency, ramp, load), "as_run": other}
    table = recipe_verdict_table({k: one_policy_verdicts(*own, PAPER, TRANSITIONS, REPORT) for k, own in by_recipe.items()})
    ours, theirs = cells(table, "ours"), cells(table, "authors' code as it was run")
    assert all(cell.startswith("reproduced: ") for cell in ours) and len(ours) == 9
    # Modes and switch of Exp. 1, the ramp and the load; ranges, tracking and centre of pressure are those of the paper.
    failed = [row[0].split(":")[0] for row, cell in zip(table.rows, theirs, strict=True) if cell.startswith("not ")]
    assert failed == ["Exp. 1", "Exp. 1", "Exp. 4a", "Exp. 4b"]
    assert "not reproduced: the paper's mode in 0 of 10 conditions" in theirs[0]


def test_where_a_training_switches_or_which_mode_it_has() -> None:
    assert switch_text([frequency_result(hz) for hz in TEN]) == "0.690"  # 0.6 + 0.15 * 0.2636 / (0.2636 + 0.1781)
    anti = changed([frequency_result(hz) for hz in TEN], with_r(-0.9))
    fast_falls = changed(anti, fallen, lambda t: t.freq_hz > 1)
    assert switch_text(fast_falls) == "none, anti-phase in all trials that stood"
    back = changed(anti, with_r(0.9), lambda t: t.freq_hz == 1.5)  # it changes the other way
    assert switch_text(back).startswith("-")


def test_numbers_in_the_text_are_those_of_the_configuration() -> None:
    (job,) = check("train", TrainConfig, ["env.amplitude=0.15", "evaluation.tolerance=0.03", "evaluation.duration=50"]).jobs
    assert isinstance(job.config, TrainConfig)
    numbers = numbers_in_text(job.config, PAPER)
    intro = HOW_TO_READ.format(**numbers)
    assert "over 0.3 m" in intro and "within 30 mm" in intro
    texts = {name: " ".join(text.format(**numbers) for text in pair) for name, pair in FIGURES.items()}
    assert "0.036 Hz/s" in texts["figure_10"] and "300 steps" in texts["figure_10"]
    assert "0.4 Hz; energy during 50 s" in texts["figure_8"] and "0.5 Hz" in texts["figure_9"]
    assert "4 kg" in texts["figure_11"] and "0.4 Hz" in texts["figure_12"]
