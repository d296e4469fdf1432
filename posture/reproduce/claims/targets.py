"""What a well-trained reproduction is asked for, and whether it is met: rows of results in, answers out.

For `results`, `paper` and `transitions` see `posture.reproduce.__main__.claims.all_claims`.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from posture.analysis.results import Row
from posture.reproduce.claims.frequency import switches
from posture.reproduce.claims.rules import MEASURED_SHARE, Means, shown_mode
from posture.reproduce.claims.seed_means import (
    Condition,
    conditions,
    label,
    mean_of,
    sample,
    seed_means,
    theory_means,
    where,
)
from posture.reproduce.claims.sweeps import map_grid, map_modes
from posture.reproduce.claims.verdict import NO_RESULTS, THEORY, Paper, Results, Transitions, by_seed

SWITCH_HZ = 0.05
"""How near the switch must come to theory's [Hz]: a third of the step of paper Table 3."""
LESS_R = 0.005
"""By how much the target-head correlation may be below paper Table 3's."""
MARGIN = 0.03
"""Share by which head amplitude and speed may lie outside what the least-torque motion and the paper have."""
COST = 1.15
"""Mean cost over least cost that is allowed."""
SAME_PATTERN = 0.95
"""Of the conditions: near a switch of modes one in twenty may differ by chance."""

_FREQ = ("freq_hz",)


@dataclass(frozen=True)
class Target:
    """met: None where the results do not say."""

    name: str
    required: str
    measured: str
    met: bool | None


def targets(results: Results, paper: Paper, transitions: Transitions) -> list[Target]:
    """All targets, Exp. 1 first."""
    every = results.get("frequency", ())
    rows = where(every, "freq_hz", paper["table_3"]["freq_hz"])
    stiffness = results.get("hip_stiffness", ())
    third = paper["experiment_3"]
    half_hertz = where(stiffness, "freq_hz", [third["freq_hz"]])
    by_stiffness = dict(zip(conditions(third["hip_k_nm_per_rad"]), third["mode"], strict=True))
    return [
        _switch(every, transitions.get("reward", math.nan)),
        _stands(rows, paper),
        _tracks(rows, paper),
        _between("Head amplitude", "head_amplitude_m", "m", rows, paper),
        _between("Head speed", "head_speed_mps", "m/s", rows, paper),
        _energy(results.get("energy", ()), paper),
        _cost(rows, paper),
        _signs("Modes of Exp. 3", half_hertz, ("hip_k_nm_per_rad",), list(by_stiffness), by_stiffness),
        _signs("Modes of Fig. 13", stiffness, ("hip_k_nm_per_rad", "freq_hz"), map_grid(paper), map_modes(paper)),
    ]


def _switch(rows: Sequence[Row], theory_hz: float) -> Target:
    name = "Switch of modes in Exp. 1"
    if math.isnan(theory_hz):
        return Target(name, "near theory's for the trained reward", "theory has no switch", None)
    required = f"mean over seeds within {SWITCH_HZ:g} Hz of theory's for the trained reward, {theory_hz:.3f} Hz"
    if not rows:
        return Target(name, required, NO_RESULTS, None)
    found = switches(rows)
    away = mean_of(list(found.values())).mean - theory_hz
    measured = by_seed(found)
    if math.isfinite(away):
        measured += f", {away:+.3f} Hz from theory's"
    return Target(name, required, measured, abs(away) <= SWITCH_HZ and not any(map(math.isnan, found.values())))


def _stands(rows: Sequence[Row], paper: Paper) -> Target:
    required = "no seed falls at any of the ten frequencies"
    measured = sample(rows, _FREQ) if rows else NO_RESULTS
    missing = _missing(rows, paper)
    if rows and missing:
        measured += f"; no results at {', '.join(missing)}"
    stood = all(row["valid"] for row in rows)
    return Target("No falls in Exp. 1", required, measured, False if not stood else None if missing else True)


def _tracks(rows: Sequence[Row], paper: Paper) -> Target:
    means = seed_means(rows, _FREQ, "target_head_r")
    least = theory_means(rows, _FREQ, "least_target_head_r")
    table = _table_3(paper, "target_head_r")
    told = []
    for c, mean in means.items():
        short = table[c] - mean.mean
        if mean.n and short > LESS_R:
            own = f", least-torque motion {least[c].mean:.4f}" if c in least else ""
            told.append(f"{label(_FREQ, c)} {mean.text('.4f')}, {short:.4f} below the paper's {table[c]:.4f}{own}")
    return _at_each(
        "Target-head correlation", f"at least paper Table 3's less {LESS_R:g} at each frequency", means, told, rows, paper
    )


def _between(name: str, column: str, unit: str, rows: Sequence[Row], paper: Paper) -> Target:
    """Between the least-torque motion's and paper Table 3's, whichever is larger."""
    means, table = seed_means(rows, _FREQ, column), _table_3(paper, column)
    least = theory_means(rows, _FREQ, f"least_{column}")
    told = []
    for c, mean in means.items():
        ends = sorted((least[c].mean if c in least else table[c], table[c]))
        if mean.n and not ends[0] * (1 - MARGIN) <= mean.mean <= ends[1] * (1 + MARGIN):
            away = mean.mean / ends[0] - 1 if mean.mean < ends[0] else mean.mean / ends[1] - 1
            told.append(f"{label(_FREQ, c)} {mean.text('.4f')} {unit}, {away:+.1%} from {ends[0]:.4f} to {ends[1]:.4f}")
    required = f"at each frequency between the least-torque motion's and paper Table 3's, within {MARGIN:.0%}"
    if rows and not least:
        return Target(name, required, f"no values of the least-torque motion; {sample(rows, _FREQ)}", None)
    return _at_each(name, required, means, told, rows, paper)


def _at_each(name: str, required: str, means: Means, misses: Sequence[str], rows: Sequence[Row], paper: Paper) -> Target:
    """The target where `misses` names the conditions that miss it."""
    if not rows:
        return Target(name, required, NO_RESULTS, None)
    known = [c for c, mean in means.items() if mean.n]
    measured = f"met at {len(known) - len(misses)} of {len(known)} frequencies"
    if misses:
        measured += f"; missed at {'; '.join(misses)}"
    if lacking := [label(_FREQ, c) for c in _table_3(paper, "target_head_r") if c not in known]:
        measured += f"; no value at {', '.join(lacking)}"
    met = False if misses else None if lacking else True
    return Target(name, required, f"{measured}; {sample(rows, _FREQ)}", met)


def _energy(results: Sequence[Row], paper: Paper) -> Target:
    gamma, table = paper["table_3"]["condition"]["energy_weight"], paper["table_4"]
    allowed = dict(zip(conditions(table["gamma"]), table["energy_j"], strict=True))[conditions([gamma])[0]]
    name, required = f"Energy of Exp. 2 at gamma {gamma:g}", f"at most the paper's {allowed:g} J"
    rows = where(results, "energy_weight", [gamma])
    if not rows:
        return Target(name, required, NO_RESULTS, None)
    mean = seed_means(rows, ("energy_weight",), "energy_j")[conditions([gamma])[0]]
    measured = f"{mean.text('.1f')} J; {sample(rows, ('energy_weight',))}"
    return Target(name, required, measured, mean.mean <= allowed if mean.n else None)


def _cost(rows: Sequence[Row], paper: Paper) -> Target:
    """Only seeds that stood at all ten frequencies have a mean: without the dear ones it would flatter."""
    name = "Cost in Exp. 1"
    required = f"mean over the ten frequencies of cost over least cost at most {COST:g}"
    if not rows:
        return Target(name, required, NO_RESULTS, None)
    ratios = {}
    for seed in sorted({row["seed"] for row in rows}):
        own = seed_means([row for row in rows if row["seed"] == seed], _FREQ, "cost_ratio")
        if all(c in own and own[c].n for c in _table_3(paper, "target_head_r")):
            ratios[seed] = float(np.mean([mean.mean for mean in own.values()]))
    if not ratios:
        return Target(name, required, f"no seed with a cost at all ten; {sample(rows, _FREQ)}", None)
    mean = mean_of(list(ratios.values()))
    told = ", ".join(f"seed {seed:g} {ratio:.3f}" for seed, ratio in ratios.items())
    return Target(name, required, f"{told}; mean {mean.text('.3f')}; {sample(rows, _FREQ)}", mean.mean <= COST)


def _signs(
    name: str, rows: Sequence[Row], by: Sequence[str], grid: Sequence[Condition], published: Mapping[Condition, str]
) -> Target:
    """Modes against the paper's, where it names them, and against theory's."""
    required = f"as the paper's or as theory's in at least {SAME_PATTERN:.0%} of the conditions"
    ours = {c: shown_mode(mean) for c, mean in seed_means(rows, by, "hip_ankle_r").items() if c in grid}
    if not ours:
        return Target(name, required, NO_RESULTS, None)
    references = {"the paper": {c: f"{mode}-phase" for c, mode in published.items()}}
    for prefix, source in THEORY.items():
        means = theory_means(rows, by, f"{prefix}_hip_ankle_r")
        modes = {c: shown_mode(mean) for c, mean in means.items() if c in ours}
        if modes and len(modes) >= MEASURED_SHARE * len(ours):
            references[source] = modes
    told, same = [], []
    for source, modes in references.items():
        both = ours.keys() & modes.keys()
        if not both:
            continue
        agree = sum(ours[c] == modes[c] for c in both)
        named = " that it names" if len(both) < len(ours) else ""
        told.append(f"as {source} in {agree} of {len(both)}{named}")
        if agree >= SAME_PATTERN * len(both):
            same.append(source)
    measured = f"{', '.join(told)}: {f'the pattern of {_and(same)}' if same else 'neither pattern'}"
    missing = len(grid) - len(ours)
    if missing:
        measured += f"; no results in {missing} of {len(grid)} conditions"
    return Target(name, required, f"{measured}; {sample(rows, by)}", None if missing else bool(same))


def _and(names: Iterable[str]) -> str:
    return " and of ".join(names)


def _table_3(paper: Paper, column: str) -> dict[Condition, float]:
    table = paper["table_3"]
    return dict(zip(conditions(table["freq_hz"]), table[column], strict=True))


def _missing(rows: Sequence[Row], paper: Paper) -> list[str]:
    there = set(conditions([row["freq_hz"] for row in rows]))
    return [label(_FREQ, c) for c in conditions(paper["table_3"]["freq_hz"]) if c not in there]
