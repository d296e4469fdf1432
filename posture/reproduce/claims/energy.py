"""The paper's claims on Exp. 2: the weight of effort in the reward, gamma."""

from __future__ import annotations

from collections.abc import Sequence

from posture.analysis.results import Result
from posture.config.published import Table4
from posture.config.reproduce import ClaimRules
from posture.reproduce.claims.rules import (
    PARTS_RULE,
    Judgement,
    combined,
    part,
    pattern,
    pattern_rule,
    spearman,
    trend,
    trend_rule,
)
from posture.reproduce.claims.seed_means import Condition, Means, conditions, labels
from posture.reproduce.claims.verdict import (
    IN_FIGURE,
    PHASE_IN_THEORY,
    Claim,
    Read,
    Verdict,
    judged,
    modes_in_words,
    values_in_words,
)
from posture.reproduce.quantities import ENERGY, ENERGY_WEIGHT, HIP_ANKLE_R, RELATIVE_PHASE, TARGET_HEAD_R

BY = (ENERGY_WEIGHT,)


def energy_claims(results: Sequence[Result], table: Table4, rules: ClaimRules) -> list[Verdict]:
    """Exp. 2."""
    gammas = conditions(table.gamma)
    modes = dict(zip(gammas, table.mode, strict=True))
    energies = dict(zip(gammas, table.energy_j, strict=True))
    # The paper's own energies do not fall steadily: no clearer trend than theirs can be required.
    needed = min(rules.rho_reproduced, -spearman(table.gamma, table.energy_j))
    lowest = min(table.target_head_r)

    def energy_falls(read: Read) -> Judgement:
        return trend(read(ENERGY), gammas, -1, "energy", rules, needed)

    return [
        judged(
            Claim(
                "energy_modes",
                "Exp. 2",
                "The motion is anti-phase when effort costs little or nothing, and in-phase when it costs more.",
                modes_in_words(modes, BY),
                pattern_rule(rules),
                "At gamma 0 theory has no optimum, since no motion is better than another.",
            ),
            results,
            BY,
            lambda read: pattern(read(HIP_ANKLE_R), modes, BY, rules),
            HIP_ANKLE_R,
            at_all=True,
        ),
        judged(
            Claim(
                "energy_phase",
                "Exp. 2",
                "The relative phase falls as effort costs more.",
                IN_FIGURE,
                trend_rule("relative phase against gamma", rules) + PHASE_IN_THEORY,
            ),
            results,
            BY,
            lambda read: trend(read(RELATIVE_PHASE), gammas, -1, "relative phase", rules),
            RELATIVE_PHASE,
            in_theory=lambda read: trend(read(HIP_ANKLE_R), gammas, 1, "correlation", rules),
            theories=("reward",),
        ),
        judged(
            Claim(
                "energy_energy",
                "Exp. 2",
                "As effort costs more, less energy is spent while the head still follows the target.",
                f"{values_in_words(energies, BY, '.0f')} J; target-head r at least {lowest:g}",
                trend_rule("energy against gamma", rules, needed)
                + f" (The paper's own numbers give {needed:.2f}.) The head "
                f"follows if the mean target-head correlation is at least the paper's lowest, {lowest:g}, at every gamma; a "
                "gamma without results, or at which most seeds fell, counts against it." + PARTS_RULE,
            ),
            results,
            BY,
            lambda read: combined(energy_falls(read), _follows(read(TARGET_HEAD_R), gammas, lowest)),
            ENERGY,
            TARGET_HEAD_R,
            in_theory=energy_falls,
            theories=("reward",),
        ),
    ]


def _follows(means: Means, gammas: Sequence[Condition], lowest: float) -> Judgement:
    missed = [c for c in gammas if c not in means or not means[c].is_known or means[c].mean < lowest]
    return part(not missed, f"the head does not follow at {labels(BY, missed)}" if missed else "the head follows")
