"""Targets for a well-trained reproduction, and whether they are met. Results in, targets out."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from posture.analysis.results import Result
from posture.config.published import Published
from posture.config.reproduce import ReportConfig
from posture.reproduce.claims.frequency import switches
from posture.reproduce.claims.rules import mode_of
from posture.reproduce.claims.seed_means import (
    Condition,
    Means,
    conditions,
    label,
    labels,
    mean_of,
    sample,
    seed_means,
    theory_means,
    where,
)
from posture.reproduce.claims.stiffness import map_grid, map_modes
from posture.reproduce.claims.verdict import NO_RESULTS, THEORY, Transitions, by_seed
from posture.reproduce.quantities import (
    COST_RATIO,
    ENERGY,
    ENERGY_WEIGHT,
    FREQ,
    HEAD_AMPLITUDE,
    HEAD_SPEED,
    HIP_ANKLE_R,
    HIP_K,
    TARGET_HEAD_R,
    Quantity,
    Variable,
)

BY = (FREQ,)


@dataclass(frozen=True)
class Target:
    """met: None if the results do not show it."""

    name: str
    required: str
    measured: str
    met: bool | None


def targets(
    results: Mapping[str, Sequence[Result]], paper: Published, transitions: Transitions, report: ReportConfig
) -> list[Target]:
    """All targets, those of Exp. 1 first."""
    frequency, energy, stiffness = (results.get(name, ()) for name in ("frequency", "energy", "hip_stiffness"))
    table, third = paper.table_3, paper.experiment_3
    own = where(frequency, FREQ, table.freq_hz)
    ten = conditions(table.freq_hz)
    amplitudes, speeds = (dict(zip(ten, column, strict=True)) for column in (table.head_amplitude_m, table.head_speed_mps))
    modes = dict(zip(conditions(third.hip_k_nm_per_rad), third.mode, strict=True))
    at_one = where(stiffness, FREQ, [third.freq_hz])
    share = report.targets.modes_share
    measured_share = report.claims.measured_share
    return [
        _switch(frequency, transitions.reward, report.targets.switch_hz),
        _no_falls(own, ten),
        _tracks(own, dict(zip(ten, table.target_head_r, strict=True)), report.targets.tracking),
        _between("Head amplitude", "m", HEAD_AMPLITUDE, own, amplitudes, report.targets.head_motion_share),
        _between("Head speed", "m/s", HEAD_SPEED, own, speeds, report.targets.head_motion_share),
        _energy(energy, paper),
        _cost(own, ten, report.targets.cost_ratio),
        _modes("Modes of Exp. 3", at_one, (HIP_K,), list(modes), modes, share, measured_share),
        _modes(
            "Modes of Fig. 13",
            stiffness,
            (HIP_K, FREQ),
            map_grid(paper, report),
            map_modes(paper, report),
            share,
            measured_share,
        ),
    ]


def _switch(results: Sequence[Result], theory_hz: float, margin_hz: float) -> Target:
    name = "Switch of modes in Exp. 1"
    if math.isnan(theory_hz):
        return Target(name, "close to that in theory for the trained reward", "no switch in theory", None)
    required = f"mean over seeds within {margin_hz:g} Hz of that in theory for the trained reward, {theory_hz:.3f} Hz"
    if not results:
        return Target(name, required, NO_RESULTS, None)
    found = switches(results)
    away = mean_of(list(found.values())).mean - theory_hz
    measured = by_seed(found) + (f", {away:+.3f} Hz from that in theory" if math.isfinite(away) else "")
    return Target(name, required, measured, abs(away) <= margin_hz and not any(map(math.isnan, found.values())))


def _no_falls(results: Sequence[Result], ten: Sequence[Condition]) -> Target:
    present = conditions([result.freq_hz for result in results])
    missing = [c for c in ten if c not in present]
    measured = sample(results, BY) if results else NO_RESULTS
    if results and missing:
        measured += f"; no results at {labels(BY, missing)}"
    stood = all(result.valid for result in results)
    met = None if stood and missing else stood
    return Target("No falls in Exp. 1", "no seed falls at any of the ten frequencies", measured, met)


def _tracks(results: Sequence[Result], published: Mapping[Condition, float], margin: float) -> Target:
    means = seed_means(results, BY, TARGET_HEAD_R.measured)
    least = theory_means(results, BY, TARGET_HEAD_R.least)
    misses = []
    for c, mean in means.items():
        below = published[c] - mean.mean
        if mean.n and below > margin:
            theory = f", least-torque motion {least[c].mean:.4f}" if c in least else ""
            misses.append(f"{label(BY, c)} {mean.text('.4f')}, {below:.4f} below the paper's {published[c]:.4f}{theory}")
    required = f"at most {margin:g} below paper Table 3 at each frequency"
    return _at_each("Target-head correlation", required, means, misses, results, published)


def _between(
    name: str,
    unit: str,
    quantity: Quantity,
    results: Sequence[Result],
    published: Mapping[Condition, float],
    margin: float,
) -> Target:
    """Between the values of the least-torque motion and of paper Table 3, whichever is larger, within `margin`."""
    required = f"at each frequency between the least-torque motion and paper Table 3, within {margin:.0%}"
    means = seed_means(results, BY, quantity.measured)
    least = theory_means(results, BY, quantity.least)
    if results and not least:
        return Target(name, required, f"no values of the least-torque motion; {sample(results, BY)}", None)
    misses = []
    for c, mean in means.items():
        low, high = sorted((least[c].mean if c in least else published[c], published[c]))
        if mean.n and not low * (1 - margin) <= mean.mean <= high * (1 + margin):
            away = mean.mean / (low if mean.mean < low else high) - 1
            misses.append(f"{label(BY, c)} {mean.text('.4f')} {unit}, {away:+.1%} from {low:.4f} to {high:.4f}")
    return _at_each(name, required, means, misses, results, published)


def _at_each(
    name: str,
    required: str,
    means: Means,
    misses: Sequence[str],
    results: Sequence[Result],
    published: Mapping[Condition, float],
) -> Target:
    """The target where `misses` describes the conditions that miss it."""
    if not results:
        return Target(name, required, NO_RESULTS, None)
    known = [c for c, mean in means.items() if mean.n]
    unknown = [c for c in published if c not in known]
    measured = f"met at {len(known) - len(misses)} of {len(known)} frequencies"
    if misses:
        measured += f"; missed at {'; '.join(misses)}"
    if unknown:
        measured += f"; no value at {labels(BY, unknown)}"
    return Target(name, required, f"{measured}; {sample(results, BY)}", False if misses else None if unknown else True)


def _energy(results: Sequence[Result], paper: Published) -> Target:
    gamma, by = paper.table_3.condition.energy_weight, (ENERGY_WEIGHT,)
    allowed = dict(zip(paper.table_4.gamma, paper.table_4.energy_j, strict=True))[gamma]
    name, required = f"Energy of Exp. 2 at gamma {gamma:g}", f"at most the paper's {allowed:g} J"
    own = where(results, ENERGY_WEIGHT, [gamma])
    if not own:
        return Target(name, required, NO_RESULTS, None)
    (mean,) = seed_means(own, by, ENERGY.measured).values()
    measured = f"{mean.text('.1f')} J; {sample(own, by)}"
    return Target(name, required, measured, mean.mean <= allowed if mean.n else None)


def costs_of_seeds(results: Sequence[Result], ten: Sequence[Condition]) -> dict[int, float]:
    """By seed, the mean over its conditions of cost over least cost [-]; without the seeds that lack one of `ten`."""
    ratios = {}
    for seed in sorted({result.origin.seed for result in results}):
        own = seed_means([result for result in results if result.origin.seed == seed], BY, COST_RATIO.measured)
        if all(c in own and own[c].n for c in ten):
            ratios[seed] = float(np.mean([mean.mean for mean in own.values()]))
    return ratios


def _cost(results: Sequence[Result], ten: Sequence[Condition], allowed: float) -> Target:
    """Only seeds that stood at all ten frequencies count: a mean without the costly ones would be too low."""
    name = "Cost in Exp. 1"
    required = f"mean over the ten frequencies of cost over least cost at most {allowed:g} for each seed"
    if not results:
        return Target(name, required, NO_RESULTS, None)
    ratios = costs_of_seeds(results, ten)
    if not ratios:
        return Target(name, required, f"no seed with a cost at all ten; {sample(results, BY)}", None)
    mean = mean_of(list(ratios.values()))
    each = ", ".join(f"seed {seed} {ratio:.3f}" for seed, ratio in ratios.items())
    measured = f"{each}; mean {mean.text('.3f')}; {sample(results, BY)}"
    return Target(name, required, measured, all(ratio <= allowed for ratio in ratios.values()))


def _modes(
    name: str,
    results: Sequence[Result],
    by: Sequence[Variable],
    grid: Sequence[Condition],
    published: Mapping[Condition, str],
    share: float,
    measured_share: float,
) -> Target:
    """Modes compared with the paper's, where it names them, and with those in theory.

    A theory counts if it has a mode in at least `measured_share` of our conditions.
    """
    required = f"the same as the paper's or those in theory in at least {share:.0%} of the conditions"
    ours = {c: mode_of(mean) for c, mean in seed_means(results, by, HIP_ANKLE_R.measured).items() if c in grid}
    if not ours:
        return Target(name, required, NO_RESULTS, None)
    references = {"the paper": {c: f"{mode}-phase" for c, mode in published.items() if c in ours}}
    for theory, source in THEORY.items():
        means = theory_means(results, by, HIP_ANKLE_R.in_theory(theory))
        modes = {c: mode_of(mean) for c, mean in means.items() if c in ours}
        if len(modes) >= measured_share * len(ours):
            references[source] = modes
    texts, same = [], []
    for source, modes in references.items():
        if not modes:
            continue
        agree = sum(ours[c] == mode for c, mode in modes.items())
        texts.append(f"as {source} in {agree} of {len(modes)}{' that it names' if len(modes) < len(ours) else ''}")
        if agree >= share * len(modes):
            same.append(source)
    verdict = f"the pattern of {' and of '.join(same)}" if same else "neither pattern"
    measured = f"{', '.join(texts)}: {verdict}"
    missing = len(grid) - len(ours)
    if missing:
        measured += f"; no results in {missing} of {len(grid)} conditions"
    return Target(name, required, f"{measured}; {sample(results, by)}", None if missing else bool(same))
