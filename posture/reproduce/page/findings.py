"""The main findings of a reproduction, in a sentence or two each, for the top of its page."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from posture.config.published import Published
from posture.reproduce.claims.frequency import switches
from posture.reproduce.claims.rules import Outcome
from posture.reproduce.claims.seed_means import conditions, mean_of, sample, where
from posture.reproduce.claims.targets import costs_of_seeds
from posture.reproduce.claims.verdict import Verdict, in_hz
from posture.reproduce.experiments import RECIPES
from posture.reproduce.page.tables import switch_text
from posture.reproduce.quantities import FREQ
from posture.reproduce.reproduction import Recipe, Reproduction


def findings(
    reproduction: Reproduction,
    verdicts: Sequence[Verdict],
    by_recipe: Mapping[str, Sequence[Verdict]],
    paper: Published,
) -> str:
    """A numbered list in Markdown, without what was not measured; empty if that is all. `by_recipe`: verdicts from each
    training of Exp. 1."""
    measured = {verdict.key: verdict for verdict in verdicts if verdict.verdict is not Outcome.NOT_MEASURED}
    found = [
        _switch(reproduction, measured, paper),
        _theory(reproduction, paper),
        _stiffness(measured),
        _as_published(reproduction.recipes, by_recipe),
        _not_reproduced(measured),
    ]
    return "\n".join(f"{number}. {text}" for number, text in enumerate(filter(None, found), 1))


def _switch(reproduction: Reproduction, measured: Mapping[str, Verdict], paper: Published) -> str:
    if "frequency_modes" not in measured:
        return ""
    verdict, own = measured["frequency_modes"], reproduction.results["frequency"]
    mean = mean_of(list(switches(own).values()))
    switch = f"The modes switch at {mean.text('.3f')} Hz" if mean.n else "There is no single switch"
    return (
        f"**Slow targets give in-phase, fast ones anti-phase: {verdict.verdict}**, {verdict.finding} "
        f"({sample(own, (FREQ,))}). {switch}; the paper's at {paper.experiment_4a.transition_hz:g} Hz in a ramp."
    )


def _theory(reproduction: Reproduction, paper: Published) -> str:
    at = reproduction.transitions
    ten = paper.table_3.freq_hz
    own = where(reproduction.results.get("frequency", ()), FREQ, ten)
    cost = mean_of(list(costs_of_seeds(own, conditions(ten)).values()))
    learned = f" The policies' squared torque is {cost.text('.3f')} times the least." if cost.n else ""
    return (
        f"**Where theory has the switch, without learning:** {in_hz(at.least)} in the motion of least torque, "
        f"{in_hz(at.reward)} in the best motion for the trained reward.{learned}"
    )


def _stiffness(measured: Mapping[str, Verdict]) -> str:
    parts = {"map_stiff": "Stiff hips give in-phase", "map_soft": "soft hips anti-phase", "stiffness_modes": "Exp. 3"}
    own = {name: measured[key] for key, name in parts.items() if key in measured}
    texts = [f"{name}: {verdict.verdict} ({verdict.finding})" for name, verdict in own.items()]
    return f"**Hip stiffness.** {'; '.join(texts)}." if texts else ""


def _as_published(recipes: Sequence[Recipe], by_recipe: Mapping[str, Sequence[Verdict]]) -> str:
    texts = []
    for recipe in recipes:
        outcomes = [verdict.verdict for verdict in by_recipe[recipe.name]]
        texts.append(
            f"{RECIPES[recipe.name]}: {switch_text(recipe.frequency)} (best for its reward: {in_hz(recipe.reward_hz)}), "
            f"{outcomes.count(Outcome.REPRODUCED)} of {len(outcomes)} claims reproduced"
        )
    return f"**The training matters.** Switch of modes in Hz: {'; '.join(texts)}." if texts else ""


def _not_reproduced(measured: Mapping[str, Verdict]) -> str:
    claims = [verdict for verdict in measured.values() if verdict.verdict is Outcome.NOT]
    texts = [f"{verdict.claim.rstrip('.')} ({verdict.experiment}: {verdict.finding})" for verdict in claims]
    return f"**Not reproduced:** {'; '.join(texts)}." if texts else ""
