"""The paper's claim on Exp. 4a: the target's frequency rises during a trial."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence

import numpy as np

from posture.analysis.results import RampTransitions, Result
from posture.config.published import Experiment4a
from posture.config.reproduce import ClaimRules
from posture.reproduce.claims.rules import graded
from posture.reproduce.claims.seed_means import sample
from posture.reproduce.claims.verdict import Claim, Transitions, Verdict, by_seed

WINDOWS: Mapping[str, Callable[[RampTransitions], tuple[float, float]]] = {
    "centred": lambda ramp: (ramp.transition_centred_hz, ramp.crossings_centred),
    "trailing": lambda ramp: (ramp.transition_trailing_hz, ramp.crossings_trailing),
}
"""By the kind of window: frequency of the transition [Hz] and number of sign changes."""


def ramp_claim(results: Sequence[Result], published: Experiment4a, transitions: Transitions, rules: ClaimRules) -> Verdict:
    """Exp. 4a."""
    paper_hz = published.transition_hz
    claim = Claim(
        "ramp_transition",
        "Exp. 4a",
        "When the frequency rises steadily, the modes switch at one frequency.",
        f"{paper_hz:g} Hz; whether with a centred or a trailing window is not stated",
        "With centred windows, which do not lag. Reproduced: every seed switches within "
        f"{rules.ramp_reproduced_hz:g} Hz of {paper_hz:g} Hz. Partly: the mean is within {rules.ramp_partly_hz:g} Hz of it, "
        f"and at least {rules.seeds_share:.0%} of the seeds switch. If the correlation changes sign more than once, the "
        "switch is its last change to anti-phase. A trailing window, which the paper may have used, shows the same switch "
        "later, at a higher frequency.",
    )
    if not results:
        return claim.not_measured(str(transitions))
    texts, findings, found = [], [], {}
    for window, read in WINDOWS.items():
        hz = {result.origin.seed: read(result.ramp)[0] if result.valid else math.nan for result in results}
        changes = {result.origin.seed: read(result.ramp)[1] for result in results if result.valid}
        others = [f"seed {seed} {n:.0f}" for seed, n in changes.items() if math.isfinite(n) and n != 1]
        texts.append(f"{window} window: {by_seed(hz)}" + (f", changes of sign: {', '.join(others)}" if others else ""))
        found[window] = [value for value in hz.values() if math.isfinite(value)]
        mean = f"{np.mean(found[window]):.2f} Hz" if found[window] else "none"
        findings.append(f"{mean} with {window} windows")
    centred = found["centred"]
    outcome, _ = graded(
        len(centred) == len(results) and all(abs(hz - paper_hz) <= rules.ramp_reproduced_hz for hz in centred),
        len(centred) >= max(rules.seeds_share * len(results), 1)
        and abs(float(np.mean(centred)) - paper_hz) <= rules.ramp_partly_hz,
        "",
    )
    measured = f"{'; '.join(texts)}; {sample(results, ())}"
    comment = f"In theory, steady motion switches at {transitions}."
    return claim.verdict(outcome, ", ".join(findings), measured, str(transitions), comment)
