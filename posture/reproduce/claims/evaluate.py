"""Verdicts on all claims of the paper. Results in, verdicts out.

A result that is not `valid` (a fall) is counted and named, and never averaged. Experiments and conditions may be missing.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from posture.analysis.results import Result
from posture.config.published import Published
from posture.config.reproduce import ReportConfig
from posture.reproduce.claims.amplitude import amplitude_claim
from posture.reproduce.claims.energy import energy_claims
from posture.reproduce.claims.frequency import frequency_claims
from posture.reproduce.claims.load import load_claim
from posture.reproduce.claims.ramp import ramp_claim
from posture.reproduce.claims.stiffness import map_claims, stiffness_claims
from posture.reproduce.claims.verdict import Transitions, Verdict


def verdicts(
    results: Mapping[str, Sequence[Result]], paper: Published, transitions: Transitions, report: ReportConfig
) -> list[Verdict]:
    """A verdict on every claim, in the paper's order, from `results` by experiment; "not measured" if there are too few.

    Experiments: frequency, energy, hip_stiffness, ramp, load and amplitude, with a result for each seed and condition.
    """
    rules = report.claims
    frequency, energy, stiffness, ramp, load, amplitude = (
        results.get(name, ()) for name in ("frequency", "energy", "hip_stiffness", "ramp", "load", "amplitude")
    )
    return [
        *frequency_claims(frequency, paper, transitions, rules),
        *energy_claims(energy, paper.table_4, rules),
        *stiffness_claims(stiffness, paper.experiment_3, rules),
        ramp_claim(ramp, paper.experiment_4a, transitions, rules),
        load_claim(load, paper.experiment_4b, report),
        *map_claims(stiffness, paper, report),
        amplitude_claim(amplitude, paper.table_3.freq_hz, report),
    ]


def one_policy_verdicts(
    frequency: Sequence[Result],
    ramp: Sequence[Result],
    load: Sequence[Result],
    paper: Published,
    transitions: Transitions,
    report: ReportConfig,
) -> list[Verdict]:
    """Verdicts on the claims about Exp. 1, 4a and 4b, for which one policy for all frequencies is enough."""
    return [
        *frequency_claims(frequency, paper, transitions, report.claims),
        ramp_claim(ramp, paper.experiment_4a, transitions, report.claims),
        load_claim(load, paper.experiment_4b, report),
    ]
