"""What a reproduction has to show: the paper's claims with our verdicts on them, and the targets that a good one meets.

Rows in, verdicts out. `results` holds by experiment (frequency, energy, hip_stiffness, ramp, load, amplitude) a row a seed
and condition: the columns of `coordination.indices`, least_* of the least-torque motion, and reward_* of the optimum of the
reward that was trained. Experiments and conditions may be missing. A row that is not `valid` (a fall) is counted and named,
never averaged in. `paper` is the content of conf/paper.yaml, `transitions` the switch frequencies of the linear stander
[Hz]: least, reward and sinusoid, nan where there is none.
"""

from __future__ import annotations

from posture.reproduce.claims import sweeps as sweeps
from posture.reproduce.claims.frequency import frequency_claims
from posture.reproduce.claims.targets import Target, targets
from posture.reproduce.claims.verdict import Paper, Results, Transitions, Verdict

__all__ = ["Target", "Verdict", "targets", "verdicts"]


def verdicts(results: Results, paper: Paper, transitions: Transitions) -> list[Verdict]:
    """A verdict on every claim, in the paper's order; "not measured" where there are too few results."""
    stiffness = results.get("hip_stiffness", ())
    return [
        *frequency_claims(results.get("frequency", ()), paper, transitions),
        *sweeps.energy_claims(results.get("energy", ()), paper["table_4"]),
        *sweeps.stiffness_claims(stiffness, paper["experiment_3"]),
        sweeps.ramp_claim(results.get("ramp", ()), paper["experiment_4a"], transitions),
        sweeps.load_claim(results.get("load", ()), paper["experiment_4b"]),
        *sweeps.map_claims(stiffness, paper),
        sweeps.amplitude_claim(results.get("amplitude", ()), paper["table_3"]["freq_hz"]),
    ]
