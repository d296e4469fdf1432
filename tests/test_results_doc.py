"""Documents state the published results as they are: their numbers and verdicts are those of results/reproduction/tables.

Each statement is filled in from the tables and looked for in its document, so that new tables beside an old text fail.
"""

import re
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from posture.analysis.coordination import sign_change_frequency
from posture.analysis.results import read_csv
from posture.reproduce.claims.frequency import switches
from posture.reproduce.claims.targets import targets
from posture.reproduce.claims.verdict import Transitions
from posture.reproduce.experiments import PUBLISHED
from tests.commands import call, table
from tests.posture.reproduce.examples import PAPER, REPORT, TEN

ROOT = Path(__file__).resolve().parents[1]
REPRODUCTION = ROOT / "results" / "reproduction"
SUMMARY = "results/reproduction/summary.md"
WORDS = ["no", "one", "two", "three", "four", "five", "six", "seven", "eight", "nine", "ten"]

STATED = [
    ("README.md", "{seeds} trainings from different seeds"),
    ("README.md", "switch between {low:.2f} and {high:.2f} Hz, on average at {mean:.2f} Hz"),
    ("README.md", "the least torque switches at {least:.2f} Hz; for the reward of these policies it is {reward:.2f} Hz"),
    ("README.md", "The squared torque of the policies is {lowest_cost:.2f} to {highest_cost:.2f} times the least."),
    ("README.md", "their reward's optimum; the target was 0.02 Hz, and is missed"),
    ("README.md", "Their mean switch is {gap:.3f} Hz below that of"),
    ("README.md", "we find in-phase (r {at_100:.2f}), the paper anti-phase"),
    ("docs/results.md", "in-phase at 100 Nm/rad (r {each_at_100} in three trainings;"),
    ("paper.md", "in-phase (r {at_100:.2f}; theory changes sign at 96 Nm/rad)"),
    ("README.md", "in {stiff_or_soft} conditions of the paper's Fig. 13"),
    ("README.md", "to {each_human} Hz in each of three trainings"),
    ("docs/results.md", "{switches_short} Hz (theory for the trained reward: {reward:.2f} Hz)"),
    ("docs/results.md", "theory for the trained reward, {reward:.3f} Hz"),
    ("docs/results.md", "{mean:.3f} Hz on average, {gap:.3f} Hz below; {low:.3f} to {high:.3f} Hz"),
    (
        "docs/results.md",
        "{sinusoid:.2f} Hz for sinusoids, {least:.2f} Hz with the 25 mm tolerance, {reward:.2f} Hz for the reward",
    ),
    ("docs/results.md", "each seed | met | {costs} |"),
    (
        "docs/results.md",
        "is {lowest_cost:.2f} to {highest_cost:.2f} times the least, and highest between 0.6 and 0.75 Hz ({middle})",
    ),
    ("docs/results.md", "rho {rho[frequency_phase]:.2f}: {phase} deg below the switch"),
    ("docs/results.md", "r {r_above} there and {r_at:.3f} at 1.2 Hz"),
    ("docs/results.md", "rho {rho[frequency_cop]:.2f}: widest at 0.75 Hz"),
    ("docs/results.md", "{energy:.0f} J at gamma 20"),
    (
        "docs/results.md",
        "| partly | rho {rho[energy_phase]:.2f}: {phase_of[0]:.0f} deg at gamma 0, {phase_of[5]:.0f} deg at 5, then ",
    ),
    ("docs/results.md", "{centred:.2f} Hz with centred windows, {trailing:.2f} Hz with trailing ones"),
    ("docs/results.md", "falls from {load[0]:.2f} to {load[4]:.2f} and stays positive"),
    ("docs/results.md", "trained with loads, from {load_trained[0]:.2f} to {load_trained[4]:.2f}"),
    ("docs/results.md", "{stiff_or_soft} conditions"),
    ("docs/results.md", "by {amplitude[0]} with amplitude, by {amplitude[1]} with frequency over the same factor of 2"),
    ("docs/introduction.md", "The {seeds_small} seeds of Exp. 1 switch at {switches_and} Hz"),
    ("docs/introduction.md", "Its mean over the {seeds_small} seeds and ten frequencies is {cost:.3f}"),
    ("docs/introduction.md", "switch {gap:.3f} Hz below theory on average"),
    ("docs/introduction.md", "of {targets} targets {missed} were missed"),
    (
        "docs/introduction.md",
        "{sinusoid:.3f} Hz for the cheapest sinusoid, {least:.3f} Hz with the tolerance of 25 mm, {reward:.3f}",
    ),
    ("docs/introduction.md", "cost {load_cost[0]:.2f} times the least without one, and {load_cost[4]:.2f} times with 4 kg"),
    ("docs/learning.md", "({mean:.3f} Hz on average)"),
    ("docs/learning.md", "The policies of seeds 1 to 5 switch between {low:.3f} and {high:.3f} Hz"),
    ("docs/learning.md", "earlier than the linear optimum's, by {gap:.3f} Hz"),
    (
        "docs/human.md",
        "| switch at constant frequency [Hz], of the trials of `fluctuation` | {human} | {switches_of_three} |",
    ),
    ("docs/human.md", "| cost over least cost, mean of the ten | {human_costs} | {costs_of_three} |"),
    ("paper.md", "between {low:.3f} and {high:.3f} Hz, at {lowest_cost:.3f} to {highest_cost:.3f} times the least cost"),
    ("README.md", "cost {published_cost} times the least, and fall above {stood:.2f} Hz"),
    ("paper.md", "at {published_cost} times the least cost, and fall above {stood:.2f} Hz"),
    ("docs/learning.md", "Both policies stand up to {stood:.2f} Hz"),
    (
        "docs/learning.md",
        "costs {cost_of[as_published]} times the least, the one of the code as it was run {cost_of[as_run]} times",
    ),
    ("docs/learning.md", "(r {r_of[as_published]}, and {r_of[as_run]})"),
    (
        "docs/results.md",
        "at {short_cost_of[as_published]} and {short_cost_of[as_run]} times the least cost, and fall above {stood:.2f} Hz",
    ),
    ("docs/results.md", "| {load_of[as_published]:.2f} | {load_of[as_run]:.2f} | the same"),
    (
        "docs/results.md",
        "the same: without load it is {unloaded_of[as_published]:.2f} and {unloaded_of[as_run]:.2f}, too |",
    ),
    (
        "docs/results.md",
        "up to {stood:.2f} Hz r falls from {tracking_of[as_published][0]:.3f} to {tracking_of[as_published][1]:.3f} and "
        "{tracking_of[as_run][1]:.3f}",
    ),
    ("docs/results.md", "does switch, at {best_of[1]:.2f} and {best_of[2]:.2f} Hz"),
    ("docs/results.md", "{best_of[0]:.2f} Hz for the reward of these trainings, {best_of[1]:.2f} Hz with the energy term"),
    (
        "docs/learning.md",
        "That motion switches at {best_of[1]:.2f} Hz, and at {best_of[2]:.3f} Hz for the code as it was run",
    ),
    ("docs/results.md", "| {least:.2f} Hz | {mean:.2f} Hz | anti-phase throughout |"),
    ("docs/results.md", "at 0.3 Hz, by {amplitude_off} % and {speed_off} %"),
    ("docs/results.md", "With hips of 25 Nm/rad the cost is {softest_cost} times the least at 0.5 Hz"),
    ("docs/results.md", "at 75 Nm/rad, up to {between[0]} Hz and from {between[1]} Hz on"),
    ("docs/results.md", "| {cop_of[as_published]} | {cop_of[as_run]} | a policy"),
    ("paper.md", "switch between {human_low:.3f} and {human_high:.3f} Hz"),
    (
        SUMMARY,
        "{claims} claims: {reproduced} reproduced, {partly} partly, {not_reproduced} not reproduced.",
    ),
]
CLAIMS = [
    ("Exp. 1: in-phase up to 0.60 Hz", "frequency_modes"),
    ("Exp. 1: one switch", "frequency_switch"),
    ("Exp. 1: hip range and torque grow", "frequency_hip frequency_ankle"),
    ("Exp. 1: relative phase grows", "frequency_phase"),
    ("Exp. 1: tracking gets worse", "frequency_tracking"),
    ("Exp. 1: the centre of pressure spreads", "frequency_cop"),
    ("Exp. 2: anti-phase where effort costs little", "energy_modes"),
    ("Exp. 2: energy falls with gamma", "energy_energy"),
    ("Exp. 2: relative phase falls with gamma", "energy_phase"),
    ("Exp. 3: anti-phase with soft hips", "stiffness_modes"),
    ("Exp. 3: soft hips move further, at a larger", "stiffness_phase stiffness_motion"),
    ("Exp. 4a: 0.69 Hz in a ramp", "ramp_transition"),
    ("Exp. 4b: anti-phase with 4 kg", "load_modes"),
    ("Fig. 13: stiff hips in-phase, soft hips anti-phase", "map_stiff map_soft"),
    ("Fig. 13: in between", "map_between"),
    ("the target's amplitude", "amplitude"),
]
"""Rows of the first table of docs/results.md, in order, and the verdicts that each is about."""
TARGETS = [
    ("switch within 0.02 Hz", ["Switch of modes in Exp. 1"]),
    ("no falls", ["No falls in Exp. 1"]),
    ("target-head r", ["Target-head correlation"]),
    ("head amplitude and speed", ["Head amplitude", "Head speed"]),
    ("mean cost", ["Cost in Exp. 1"]),
]
"""Rows of its second table, and the targets that each is about."""


@cache
def results(name):
    return read_csv(REPRODUCTION / "tables" / f"{name}.csv")


@cache
def verdicts():
    return {row["key"]: row for row in table(REPRODUCTION / "tables" / "verdicts.csv")}


def transitions():
    """Of theory: least torque, optimum of the trained reward, least-torque sinusoid [Hz], each to three decimals."""
    return Transitions(*map(float, re.findall(r"([\d.]+) Hz \(", verdicts()["frequency_switch"]["theory"])))


@cache
def judged_targets():
    found = {name: results(name) for name in ("frequency", "energy", "hip_stiffness")}
    return {target.name: target for target in targets(found, PAPER, transitions(), REPORT)}


def missed_by(name):
    """Percent by which the one frequency that misses this target misses it."""
    (percent,) = re.findall(r"[+-]([\d.]+)%", judged_targets()[name].measured)
    return percent


def costs_of(name):
    """By seed, the mean over the ten frequencies of cost over least cost."""
    ten = [row for row in results(name) if row.freq_hz in TEN]
    return [
        np.mean([row.cost_ratio for row in ten if row.origin.seed == seed]) for seed in sorted({r.origin.seed for r in ten})
    ]


def means(name, by, of):
    """By the value of `by`, the mean of `of` over the seeds."""
    return {value: np.mean([of(row) for row in results(name) if by(row) == value]) for value in map(by, results(name))}


def by_freq(column):
    return means("frequency", lambda row: row.freq_hz, lambda row: getattr(row, column))


def human_switches():
    """By seed, of the policies with the senses of people, in the repeated trials of posture.dynamics."""
    rows = table(REPRODUCTION / "dynamics" / "fluctuation.csv")
    own = [[row for row in rows if row["seed"] == seed] for seed in sorted({row["seed"] for row in rows})]
    return [
        sign_change_frequency(*([float(row[key]) for row in each] for key in ("freq_hz", "hip_ankle_r"))) for each in own
    ]


def listed(values, decimals):
    return ", ".join(f"{value:.{decimals}f}" for value in values)


def span(values, decimals):
    return f"{min(values):.{decimals}f} to {max(values):.{decimals}f}"


@cache
def numbers():
    """What the statements are filled in with."""
    found, costs, theory, human = switches(results("frequency")), costs_of("frequency"), transitions(), human_switches()
    hz = [found[seed] for seed in sorted(found)]
    cost, tracking, phase = map(by_freq, ("cost_ratio", "target_head_r", "relative_phase_deg"))
    rho = {key: re.findall(r"rho = ([+-][\d.]+)", row["finding"]) for key, row in verdicts().items()}
    outcomes = [row["verdict"] for row in verdicts().values()]
    same = [re.search(r"in (\d+) of (\d+)", verdicts()[key]["finding"]).groups() for key in ("map_stiff", "map_soft")]
    published = {name: [row for row in results(name) if row.valid] for name in PUBLISHED}
    load, load_trained = (
        means(name, lambda row: row.load_kg, lambda row: row.hip_ankle_r) for name in ("load", "load_trained")
    )
    at_100 = [row.hip_ankle_r for row in results("hip_stiffness") if (row.hip_k_nm_per_rad, row.freq_hz) == (100.0, 0.5)]
    return {
        "seeds": WORDS[len(hz)].capitalize(),
        "seeds_small": WORDS[len(hz)],
        "low": min(hz),
        "high": max(hz),
        "mean": np.mean(hz),
        "switches_short": listed(hz, 2),
        "switches_and": " and ".join(listed(hz, 3).rsplit(", ", 1)),
        "switches_of_three": listed(hz[:3], 3),
        "least": theory.least,
        "reward": theory.reward,
        "sinusoid": theory.sinusoid,
        "gap": theory.reward - np.mean(hz),
        "lowest_cost": min(costs),
        "highest_cost": max(costs),
        "costs": listed(costs, 3),
        "costs_of_three": listed(costs[:3], 2),
        "cost": np.mean(costs),
        "middle": span([ratio for freq, ratio in cost.items() if 0.6 <= freq <= 0.75], 2),
        "r_above": span([r for freq, r in tracking.items() if freq > 1.2], 3),
        "r_at": tracking[1.2],
        "phase": span([deg for freq, deg in phase.items() if freq <= 0.6], 0),
        "rho": {key: float(found[0]) for key, found in rho.items() if found},
        "phase_of": means("energy", lambda row: row.origin.energy_weight, lambda row: row.relative_phase_deg),
        "at_100": np.mean(at_100),
        "each_at_100": " and ".join(listed(at_100, 2).rsplit(", ", 1)),
        "energy": means("energy", lambda row: row.origin.energy_weight, lambda row: row.energy_j)[20],
        "centred": np.mean([row.ramp.transition_centred_hz for row in results("ramp")]),
        "trailing": np.mean([row.ramp.transition_trailing_hz for row in results("ramp")]),
        "load": load,
        "load_trained": load_trained,
        "load_cost": means("load", lambda row: row.load_kg, lambda row: row.cost_ratio),
        "stiff_or_soft": " of ".join(str(sum(map(int, counts))) for counts in zip(*same, strict=True)),
        "amplitude": re.findall(r"by ([\d.]+) with", verdicts()["amplitude"]["finding"]),
        "stood": max(row.freq_hz for own in published.values() for row in own),
        "published_cost": span([row.cost_ratio for own in published.values() for row in own], 1),
        "cost_of": {name: span([row.cost_ratio for row in own], 2) for name, own in published.items()},
        "short_cost_of": {name: span([row.cost_ratio for row in own], 1) for name, own in published.items()},
        "r_of": {
            name: " to ".join(f"{end(row.hip_ankle_r for row in own):.2f}" for end in (max, min))
            for name, own in published.items()
        },
        "load_of": {name: results(f"load_{name}")[-1].hip_ankle_r for name in PUBLISHED},
        "unloaded_of": {name: results(f"load_{name}")[0].hip_ankle_r for name in PUBLISHED},
        "tracking_of": {name: (own[0].target_head_r, own[-1].target_head_r) for name, own in published.items()},
        "best_of": [float(hz) for hz in re.findall(r"best for its reward: ([\d.]+) Hz", text(SUMMARY))],
        "amplitude_off": missed_by("Head amplitude"),
        "speed_off": missed_by("Head speed"),
        "softest_cost": span(
            [row.cost_ratio for row in results("hip_stiffness") if (row.hip_k_nm_per_rad, row.freq_hz) == (25.0, 0.5)], 1
        ),
        "between": re.search(
            r"at 75 Nm/rad in-phase up to ([\d.]+) Hz, anti-phase from ([\d.]+) Hz", verdicts()["map_between"]["finding"]
        ).groups(),
        "cop_of": {
            name: " to ".join(f"{1e3 * (row.cop_p95_m - row.cop_p05_m):.0f} mm" for row in (own[0], own[-1]))
            for name, own in published.items()
        },
        "human": listed(human, 3),
        "each_human": " or ".join(sorted({f"{each:.2f}" for each in human})),
        "human_low": min(human),
        "human_high": max(human),
        "human_costs": listed(costs_of("human"), 2),
        "targets": WORDS[len(judged_targets())],
        "missed": WORDS[[target.met for target in judged_targets().values()].count(False)],
        "claims": len(outcomes),
        "reproduced": outcomes.count("reproduced"),
        "partly": outcomes.count("partly"),
        "not_reproduced": outcomes.count("not reproduced"),
    }


def text(document):
    return " ".join((ROOT / document).read_text(encoding="utf-8").split())


@pytest.mark.parametrize(("document", "statement"), STATED)
def test_a_statement_is_what_the_tables_say(document, statement):
    stated = statement.format(**numbers())
    assert stated in text(document), stated


def rows_after(header):
    """Cells of the table in docs/results.md with this header, row by row."""
    _, _, below = (ROOT / "docs" / "results.md").read_text(encoding="utf-8").partition(header + "\n")
    lines = below.split("\n\n")[0].splitlines()[1:]
    assert lines
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in lines]


def test_every_claim_has_the_verdict_of_the_report():
    stated = rows_after("| claim of the paper | verdict | what we found |")
    assert len(stated) == len(CLAIMS) and {key for _, keys in CLAIMS for key in keys.split()} == set(verdicts())
    for (claim, verdict, _), (start, keys) in zip(stated, CLAIMS, strict=True):
        assert claim.startswith(start)
        assert {verdict} == {verdicts()[key]["verdict"] for key in keys.split()}, claim


def test_every_target_is_met_or_missed_as_in_the_report():
    stated = rows_after("| target | | measured |")
    for (target, met, _), (start, names) in zip(stated, TARGETS, strict=True):
        assert target.startswith(start)
        assert {met} == {"met" if judged_targets()[name].met else "missed" for name in names}, target


def test_the_table_of_seeds_has_their_switches():
    section = (ROOT / "docs" / "learning.md").read_text(encoding="utf-8").partition("## The default, seeds 1 to 5")[2]
    rows = re.findall(r"^\| (\d) \|.*\| ([\d.]+) \|$", section.partition("\n## ")[0], flags=re.M)
    assert dict(rows) == {str(seed): f"{hz:.3f}" for seed, hz in switches(results("frequency")).items()}


@pytest.mark.slow
def test_hips_of_100_are_as_the_shipped_policies_find_them(monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    found = {}
    for name in PUBLISHED:
        trial = ["env.hip_k=100", "evaluation.freq=[0.5]", "evaluation.figures=false"]
        call(monkeypatch, "eval", f"ckpt=pretrained/{name}", f"out={name}", *trial)
        (found[name],) = read_csv(Path(name) / "metrics.csv")
    assert found["as_run"].fell and not found["as_published"].fell
    assert f"| anti-phase (r {found['as_published'].hip_ankle_r:.2f}) | falls | a policy" in text("docs/results.md")
