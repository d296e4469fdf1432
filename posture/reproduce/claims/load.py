"""The paper's claim on Exp. 4b: a load on the trunk."""

from __future__ import annotations

from collections.abc import Sequence

from posture.analysis.results import Result
from posture.config.published import Experiment4b
from posture.config.reproduce import ReportConfig
from posture.reproduce.claims.rules import PARTS_RULE, Judgement, Outcome, combined, mode_of, part, trend, trend_rule
from posture.reproduce.claims.seed_means import conditions, label, steps
from posture.reproduce.claims.verdict import Claim, Read, Verdict, judged, modes_in_words
from posture.reproduce.quantities import HIP_ANKLE_R, LOAD

BY = (LOAD,)


def load_claim(results: Sequence[Result], published: Experiment4b, report: ReportConfig) -> Verdict:
    """Exp. 4b."""
    rules, step = report.claims, report.grid.load_step_kg
    loads = conditions(steps(*published.load_kg, step))
    modes = dict(zip(conditions(published.load_kg), published.mode_at_ends, strict=True))
    light, heavy = modes

    def judge(read: Read) -> Judgement:
        means = read(HIP_ANKLE_R)
        if light not in means or heavy not in means:
            return Judgement(Outcome.NOT_MEASURED, f"no results at {label(BY, light)} or {label(BY, heavy)}")
        ends = [f"{means[c].mean:.2f} at {label(BY, c)}{'' if means[c].is_known else ' (most seeds fell)'}" for c in modes]
        as_published = all(mode_of(means[c]) == f"{mode}-phase" for c, mode in modes.items())
        return combined(trend(means, loads, -1, "correlation", rules), part(as_published, f"from {' to '.join(ends)}"))

    return judged(
        Claim(
            "load_modes",
            "Exp. 4b",
            "As load is added to the upper body, the correlation falls from positive to negative.",
            modes_in_words(modes, BY),
            f"Falls: {trend_rule('the correlation against load', rules)} (Every {step:g} kg, since the paper names the ends "
            f"only.) Becomes negative: its mean is positive at {label(BY, light)} and negative at {label(BY, heavy)}, and "
            "most seeds did not fall at either." + PARTS_RULE,
            "The paper does not say where the load was attached; here it is at the trunk's centre of mass.",
        ),
        results,
        BY,
        judge,
        HIP_ANKLE_R,
        at_all=True,
    )
