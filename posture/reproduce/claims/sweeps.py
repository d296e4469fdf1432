"""The paper's claims beyond Exp. 1: effort, hip stiffness, ramp, load, the map of both, amplitude. Rows in, verdicts out."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from itertools import product
from typing import Any

import numpy as np

from posture.analysis.results import Row
from posture.reproduce.claims.rules import (
    JUDGED_WHERE,
    PATTERN_RULE,
    RHO_REPRODUCED,
    SEED_SHARE,
    Judgement,
    Means,
    Outcome,
    combined,
    contrast,
    known,
    part,
    pattern,
    shown_mode,
    spearman,
    trend,
    trend_rule,
    unfinished,
)
from posture.reproduce.claims.seed_means import Condition, conditions, label, sample, where
from posture.reproduce.claims.verdict import (
    IN_FIGURE,
    NO_RESULTS,
    PARTS_RULE,
    PHASE_IN_THEORY,
    Claim,
    Paper,
    Read,
    Transitions,
    Verdict,
    by_seed,
    judged,
    modes_said,
    predicted,
    values_said,
)

RAMP_HZ = 0.05
"""How near to the paper's a transition in the ramp is the same [Hz]: about half of what separates the two readings of the
paper's window, 0.09 Hz."""
STIFF, SOFT = 150.0, 50.0
"""Paper Fig. 13: above the one it stays in-phase, below the other anti-phase [Nm/rad]."""
MAP_STEP_HZ = 0.05
"""The map's step of frequency [Hz], ours: the paper gives none."""
LOAD_STEP_KG = 0.5
"""Between the paper's ends [kg], ours: the paper gives none."""
AMPLITUDES_M = (0.06, 0.08, 0.1, 0.12)
"""Of the target [m], ours, on either side of the paper's 0.1 m: for others it gives no numbers."""

_MAP = ("hip_k_nm_per_rad", "freq_hz")
_R = ("hip_ankle_r", ".2f", "r")


def energy_claims(rows: Sequence[Row], table: Mapping[str, Any]) -> list[Verdict]:
    """Exp. 2: the weight gamma of effort."""
    by = ("energy_weight",)
    gammas = conditions(table["gamma"])
    modes = dict(zip(gammas, table["mode"], strict=True))
    # The paper's own energies do not fall steadily: a trend as clear as theirs is all that can be asked.
    needed = min(RHO_REPRODUCED, -spearman(table["gamma"], table["energy_j"]))
    energies = dict(zip(gammas, table["energy_j"], strict=True))
    lowest = min(table["target_head_r"])

    def falls_while_tracking(read: Read) -> Judgement:
        return combined(
            trend(read("energy_j"), gammas, -1, "energy", needed), _tracks(read("target_head_r"), gammas, lowest)
        )

    return [
        judged(
            Claim(
                "energy_modes",
                "Exp. 2",
                "With effort free or cheap the motion is anti-phase; with effort dearer it is in-phase.",
                modes_said(modes, by),
                PATTERN_RULE,
                "Theory has no optimum at gamma 0, where no motion is better than another.",
            ),
            rows,
            by,
            lambda read: pattern(read("hip_ankle_r"), modes, by),
            _R,
            whole=True,
        ),
        judged(
            Claim(
                "energy_phase",
                "Exp. 2",
                "The relative phase falls as effort gets dearer.",
                IN_FIGURE,
                trend_rule("relative phase against gamma") + PHASE_IN_THEORY,
            ),
            rows,
            by,
            lambda read: trend(read("relative_phase_deg"), gammas, -1, "relative phase"),
            ("relative_phase_deg", ".0f", "phase [deg]"),
            in_theory=lambda read: trend(read("hip_ankle_r"), gammas, 1, "correlation"),
            sources=("reward",),
        ),
        judged(
            Claim(
                "energy_energy",
                "Exp. 2",
                "Dearer effort lowers the energy spent while the head still follows the target.",
                f"{values_said(energies, by, '.0f')} J; target-head r at least {lowest:g}",
                trend_rule("energy against gamma", needed) + f" (The paper's own numbers give {needed:.2f}.) Tracking holds "
                f"where the mean target-head correlation is at every gamma at least the paper's lowest, {lowest:g}; a gamma "
                "without results, or at which most seeds fell, counts against it." + PARTS_RULE,
            ),
            rows,
            by,
            falls_while_tracking,
            ("energy_j", ".0f", "energy [J]"),
            ("target_head_r", ".4f", "target-head r"),
            in_theory=lambda read: trend(read("energy_j"), gammas, -1, "energy", needed),
            sources=("reward",),
        ),
    ]


def _tracks(means: Means, gammas: Sequence[Condition], lowest: float) -> Judgement:
    by = ("energy_weight",)
    short = [label(by, c) for c in gammas if c not in means or not known(means[c]) or means[c].mean < lowest]
    return part(not short, "tracking holds" if not short else f"tracking does not hold at {', '.join(short)}")


def stiffness_claims(results: Sequence[Row], third: Mapping[str, Any]) -> list[Verdict]:
    """Exp. 3: hip stiffness at one frequency, of the `results` at many."""
    rows = where(results, "freq_hz", [third["freq_hz"]])
    by = ("hip_k_nm_per_rad",)
    modes = dict(zip(conditions(third["hip_k_nm_per_rad"]), third["mode"], strict=True))
    return [
        judged(
            Claim(
                "stiffness_modes",
                "Exp. 3",
                "With soft hips the motion is anti-phase, with stiff hips in-phase.",
                modes_said(modes, by),
                PATTERN_RULE,
            ),
            rows,
            by,
            lambda read: pattern(read("hip_ankle_r"), modes, by),
            _R,
            whole=True,
        ),
        judged(
            Claim(
                "stiffness_phase",
                "Exp. 3",
                "The relative phase falls as the hips get stiffer.",
                IN_FIGURE,
                trend_rule("relative phase against stiffness") + PHASE_IN_THEORY,
            ),
            rows,
            by,
            lambda read: trend(read("relative_phase_deg"), list(modes), -1, "relative phase"),
            ("relative_phase_deg", ".0f", "phase [deg]"),
            in_theory=lambda read: trend(read("hip_ankle_r"), list(modes), 1, "correlation"),
        ),
        judged(
            Claim(
                "stiffness_motion",
                "Exp. 3",
                "Soft hips have to move further.",
                IN_FIGURE,
                trend_rule("the range of the hip's angle against stiffness"),
            ),
            rows,
            by,
            lambda read: trend(read("hip_range_deg"), list(modes), -1, "hip angle"),
            ("hip_range_deg", ".1f", "hip angle [deg]"),
        ),
    ]


def ramp_claim(rows: Sequence[Row], published: Mapping[str, Any], transitions: Transitions) -> Verdict:
    """Exp. 4a: the frequency rises."""
    hz = float(published["transition_hz"])
    claim = Claim(
        "ramp_transition",
        "Exp. 4a",
        "When the frequency rises steadily, the modes switch at one frequency.",
        f"{hz:g} Hz; whether by a centred or a trailing window is not said",
        f"By centred windows, which are not late. Reproduced: every seed switches within {RAMP_HZ:g} Hz of {hz:g} Hz; "
        f"partly: the mean lies within {2 * RAMP_HZ:g} Hz, and at least {SEED_SHARE:.0%} of the seeds switch. Where the "
        "correlation changes sign more than once, the switch is the last of its changes to anti-phase. A trailing window, "
        "which the paper may have used, shows the same switch later, at a higher frequency.",
    )
    theory = predicted(transitions)
    if not rows:
        return claim.verdict("not measured", NO_RESULTS, NO_RESULTS, theory, "")
    texts, means, found = [], [], {}
    for window in ("centred", "trailing"):
        value = {row["seed"]: row.get(f"transition_{window}_hz", math.nan) if row["valid"] else math.nan for row in rows}
        changes = {row["seed"]: row.get(f"crossings_{window}", math.nan) for row in rows if row["valid"]}
        often = [f"seed {seed:g} {n:.0f}" for seed, n in changes.items() if math.isfinite(n) and n != 1]
        texts.append(f"{window} window: {by_seed(value)}" + (f", changes of sign: {', '.join(often)}" if often else ""))
        found[window] = [v for v in value.values() if math.isfinite(v)]
        means.append(f"{f'{np.mean(found[window]):.2f} Hz' if found[window] else 'none'} by {window} windows")
    centred = found["centred"]
    all_near = len(centred) == len(rows) and all(abs(v - hz) <= RAMP_HZ for v in centred)
    near = bool(centred) and abs(float(np.mean(centred)) - hz) <= 2 * RAMP_HZ and len(centred) >= SEED_SHARE * len(rows)
    outcome: Outcome = "reproduced" if all_near else "partly" if near else "not"
    measured = f"{'; '.join(texts)}; {sample(rows, ())}"
    return claim.verdict(outcome, ", ".join(means), measured, theory, f"By theory steady motion switches at {theory}.")


def load_claim(rows: Sequence[Row], published: Mapping[str, Any]) -> Verdict:
    """Exp. 4b: a load on the trunk."""
    by = ("load_kg",)
    light, heavy = conditions(published["load_kg"])
    loads = conditions(_steps(light[0], heavy[0], LOAD_STEP_KG))
    modes = dict(zip((light, heavy), published["mode_at_ends"], strict=True))

    def judge(read: Read) -> Judgement:
        r = read("hip_ankle_r")
        falls = trend(r, loads, -1, "correlation")
        if light not in r or heavy not in r:
            return Judgement("not measured", f"no results at {label(by, light)} or {label(by, heavy)}")
        as_published = all(shown_mode(r[c]) == f"{mode}-phase" for c, mode in modes.items())
        ends = [f"{r[c].mean:.2f} at {label(by, c)}{'' if known(r[c]) else ' (most seeds fell)'}" for c in modes]
        return combined(falls, part(as_published, f"from {' to '.join(ends)}"))

    return judged(
        Claim(
            "load_modes",
            "Exp. 4b",
            "As load is added to the upper body, the correlation falls from positive to negative.",
            modes_said(modes, by),
            f"Falls: {trend_rule('the correlation against load')} (Every {LOAD_STEP_KG:g} kg, for the paper names the ends "
            f"alone.) Becomes negative: its mean is positive at {label(by, light)} and negative at {label(by, heavy)}, and "
            "most seeds stood at both." + PARTS_RULE,
            "The paper does not say where it put the load; ours is at the trunk's centre of mass.",
        ),
        rows,
        by,
        judge,
        _R,
        whole=True,
    )


def map_grid(paper: Paper) -> list[Condition]:
    """The conditions of the map of paper Fig. 13: hip stiffness [Nm/rad] and frequency [Hz]."""
    figure = paper["figure_13"]
    low, high = figure["freq_range_hz"]
    return [(float(k), freq) for k in figure["hip_k_nm_per_rad"] for freq in _steps(low, high, MAP_STEP_HZ)]


def _steps(low: float, high: float, step: float) -> list[float]:
    return [round(low + i * step, 6) for i in range(round((high - low) / step) + 1)]


def map_modes(paper: Paper) -> dict[Condition, str]:
    """The mode that paper Fig. 13 shows, in those of its conditions for which the paper names one."""
    return {c: "in" if c[0] > STIFF else "anti" for c in map_grid(paper) if not SOFT <= c[0] <= STIFF}


def map_claims(rows: Sequence[Row], paper: Paper) -> list[Verdict]:
    """Fig. 13: hip stiffness by frequency."""
    return [
        _one_mode("map_stiff", f"With stiff hips (above {STIFF:g} Nm/rad) the motion is in-phase", "in", rows, paper),
        _one_mode("map_soft", f"With soft hips (below {SOFT:g} Nm/rad) the motion is anti-phase", "anti", rows, paper),
        _between(rows, paper),
    ]


def _one_mode(key: str, claim: str, wanted: str, rows: Sequence[Row], paper: Paper) -> Verdict:
    """Where the map has one mode at all frequencies."""
    modes = {c: mode for c, mode in map_modes(paper).items() if mode == wanted}
    hip_k = sorted({k for k, _ in modes})
    return judged(
        Claim(key, "Fig. 13", f"{claim} at every frequency.", f"{wanted}-phase at {_range(hip_k, modes)}", PATTERN_RULE),
        where(rows, "hip_k_nm_per_rad", hip_k),
        _MAP,
        lambda read: pattern(read("hip_ankle_r"), modes, _MAP),
        _R,
        sources=("least",),
    )


def _between(rows: Sequence[Row], paper: Paper) -> Verdict:
    """Where the map's mode depends on the frequency; stiffnesses that Exp. 3 has in-phase at its upper end are left out."""
    third = paper["experiment_3"]
    ends = zip(third["hip_k_nm_per_rad"], third["mode"], strict=True)
    hip_k = [float(k) for k, mode in ends if SOFT <= k <= STIFF and mode == "anti"]
    grid = [c for c in map_grid(paper) if c[0] in hip_k]
    names = ", ".join(f"{k:g}" for k in hip_k)
    return judged(
        Claim(
            "map_between",
            "Fig. 13",
            "Between, the mode depends on the frequency: in-phase when slow, anti-phase when fast.",
            f"{SOFT:g} to {STIFF:g} Nm/rad; by Exp. 3 {names} Nm/rad are anti-phase at {third['freq_hz']:g} Hz",
            f"Of the stiffnesses from {SOFT:g} to {STIFF:g} Nm/rad, those that Exp. 3 has anti-phase at "
            f"{third['freq_hz']:g} Hz: {names}. Reproduced: at each of these all in-phase frequencies, "
            "by the sign of the mean correlation, lie below all anti-phase ones; partly: so at one, or the in-phase ones "
            f"lower on average. {JUDGED_WHERE}",
        ),
        where(rows, "hip_k_nm_per_rad", hip_k),
        _MAP,
        lambda read: _goes_over(read("hip_ankle_r"), grid),
        _R,
        sources=("least",),
    )


def _range(hip_k: Sequence[float], grid: Iterable[Condition]) -> str:
    freqs = sorted({f for _, f in grid})
    return f"{', '.join(f'{k:g}' for k in hip_k)} Nm/rad, {freqs[0]:g} to {freqs[-1]:g} Hz"


def _goes_over(means: Means, grid: Sequence[Condition]) -> Judgement:
    if lacking := unfinished(means, grid):
        return lacking
    told, clean, tends = [], 0, 0
    for hip_k in sorted({k for k, _ in grid}):
        shown = {f: shown_mode(means[k, f]) for k, f in grid if k == hip_k and (k, f) in means}
        slow, fast = ([f for f, mode in shown.items() if mode == wanted] for wanted in ("in-phase", "anti-phase"))
        if slow and fast and max(slow) < min(fast):
            clean += 1
            told.append(f"at {hip_k:g} Nm/rad in-phase up to {max(slow):g} Hz, anti-phase from {min(fast):g} Hz on")
            continue
        text = f"at {hip_k:g} Nm/rad in-phase at {len(slow)}, anti-phase at {len(fast)} of {len(shown)} frequencies"
        if slow and fast and np.mean(slow) < np.mean(fast):
            tends += 1
            text += ", the in-phase ones lower on average"
        told.append(text)
    outcome: Outcome = "reproduced" if clean == len(told) else "partly" if clean or tends else "not"
    return Judgement(outcome, ", ".join(told))


def amplitude_claim(results: Sequence[Row], freqs: Sequence[float]) -> Verdict:
    """The amplitude of the target, by frequency: those of paper Table 3, `freqs` [Hz]."""
    by = ("amplitude_m", "freq_hz")
    grid = [(*a, *f) for a, f in product(conditions(AMPLITUDES_M), conditions(freqs))]
    return judged(
        Claim(
            "amplitude",
            "Amplitude",
            "The target's amplitude changes coordination less clearly than its frequency does.",
            "in the text only",
            f"Amplitudes of {AMPLITUDES_M[0]:g} to {AMPLITUDES_M[-1]:g} m differ by a factor of "
            f"{AMPLITUDES_M[-1] / AMPLITUDES_M[0]:.2g}, frequencies of {min(freqs):g} to {max(freqs):g} Hz by one of "
            f"{max(freqs) / min(freqs):.2g}; they are compared over the same factor. Between amplitudes: the largest less "
            "the least mean correlation at a frequency, averaged over the frequencies. Between frequencies: the same at an "
            "amplitude, from each frequency on up to that factor, averaged over these ranges and the amplitudes. "
            "Reproduced: the first is at most half of the second; partly: it is less. Judged where all conditions have "
            "results in which most seeds stood.",
        ),
        where(where(results, "amplitude_m", AMPLITUDES_M), "freq_hz", freqs),
        by,
        lambda read: contrast(read("hip_ankle_r"), grid),
        sources=("least",),
    )
