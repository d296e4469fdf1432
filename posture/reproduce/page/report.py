"""Write the report of a reproduction: the page, a summary in Markdown, figures, and tables as CSV."""

from __future__ import annotations

import shutil
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path

from posture.analysis.results import write_csv, write_rows
from posture.config.published import Published
from posture.config.reproduce import ReportConfig
from posture.config.train import TrainConfig
from posture.reproduce.claims.evaluate import one_policy_verdicts, verdicts
from posture.reproduce.claims.rules import Outcome
from posture.reproduce.claims.targets import targets
from posture.reproduce.claims.verdict import Transitions, Verdict, in_hz
from posture.reproduce.experiments import EVALUATIONS, TRAININGS
from posture.reproduce.figures.draw import draw_report
from posture.reproduce.page import page, tables, text
from posture.reproduce.page.findings import findings
from posture.reproduce.page.page import Figure, Section
from posture.reproduce.page.provenance import codes, how_it_was_made, training_table, warnings
from posture.reproduce.reproduction import Reproduction
from posture.storage import yaml_files
from posture.storage.atomic import replacing


def write_report(
    reproduction: Reproduction, paper: Published, report: ReportConfig, out: Path, commands: Sequence[str]
) -> Path:
    """Write report.html, summary.md, provenance.yaml, figures/ and tables/ (a CSV for each experiment, one of the verdicts)
    into `out`. Tables and figures that an earlier report had and this one has not are removed.

    `commands`: those that produced the results. Returns the page's path.
    """
    claims = verdicts(reproduction.results, paper, reproduction.transitions, report)
    for name, results in reproduction.results.items():
        write_csv(results, out / "tables" / f"{name}.csv")
    write_rows([asdict(claim) for claim in claims], out / "tables" / "verdicts.csv")
    figures = draw_report(reproduction, paper, report, out / "figures")
    for name, made in (("many_bodies", reproduction.many_bodies), ("dynamics", reproduction.dynamics)):
        if made:
            figures[name] = Path(shutil.copy(made.figure, out / "figures" / f"{name}.png"))
    for name in {*TRAININGS, *EVALUATIONS} - reproduction.results.keys():
        (out / "tables" / f"{name}.csv").unlink(missing_ok=True)
    for name in text.FIGURES.keys() - figures.keys():
        (out / "figures" / f"{name}.png").unlink(missing_ok=True)
    sections = _sections(reproduction, paper, report, claims, figures, commands)
    count = Counter(claim.verdict for claim in claims)
    outcomes = ", ".join(f"{count[outcome]} {outcome}" for outcome in Outcome if count[outcome])
    subtitle = text.SUBTITLE.format(count=len(claims), outcomes=outcomes)
    yaml_files.write_yaml(out / "provenance.yaml", codes(reproduction.trainings))
    for name, write in (("report.html", page.html), ("summary.md", page.markdown)):
        with replacing(out / name) as temporary:
            temporary.write_text(write(text.TITLE, subtitle, sections), encoding="utf-8")
    return out / "report.html"


def _sections(
    reproduction: Reproduction,
    paper: Published,
    report: ReportConfig,
    claims: Sequence[Verdict],
    figures: Mapping[str, Path],
    commands: Sequence[str],
) -> list[Section]:
    """The sections of the page. Tables and figures without results, and empty sections, are left out."""
    run, results, trainings = reproduction.run, reproduction.results, reproduction.trainings
    numbers = numbers_in_text(run, paper)
    frequency, energy, stiffness, ramp, load, load_trained, engines = (
        results.get(name) for name in ("frequency", "energy", "hip_stiffness", "ramp", "load", "load_trained", "engines")
    )
    many_bodies = reproduction.many_bodies

    def shown(*names: str) -> list[Figure]:
        words = {name: [words.format(**numbers) for words in text.FIGURES[name]] for name in names if name in figures}
        return [Figure(figures[name], *alt_and_caption) for name, alt_and_caption in words.items()]

    overview: list[str | page.Table] = [
        *warnings(trainings, reproduction.left_out),
        text.HOW_TO_READ.format(**numbers),
        tables.verdict_table(claims),
        tables.target_table(targets(results, paper, reproduction.transitions, report)),
        text.STRICTER,
    ]
    by_recipe = {
        own.name: one_policy_verdicts(own.frequency, own.ramp, own.load, paper, reproduction.transitions, report)
        for own in reproduction.recipes
    }
    published: list[str | page.Table] = []
    if by_recipe:
        published = [
            text.AS_PUBLISHED,
            tables.recipe_table(reproduction.recipes, energy or [], stiffness or [], paper),
            tables.recipe_verdict_table(by_recipe),
        ]
    body = [
        tables.body_table(reproduction.body, run.env.torque_limit, paper),
        tables.learning_table(run, paper.table_2),
    ]
    exp_1 = (
        [tables.tracking_table(frequency, paper.table_3), tables.mode_table(frequency, paper.table_3)] if frequency else []
    )
    exp_2 = [tables.energy_table(energy, paper.table_4)] if energy else []
    exp_3 = [tables.stiffness_table(stiffness, paper.experiment_3)] if stiffness else []
    exp_4a = [tables.ramp_table(ramp, paper.experiment_4a)] if ramp else []
    exp_4b = [tables.load_table(load, paper.experiment_4b, "policies trained without load")] if load else []
    if load_trained:
        exp_4b.append(tables.load_table(load_trained, paper.experiment_4b, "policies trained with loads"))
    in_all = [tables.agreement_table(many_bodies), tables.many_switches_table(many_bodies)] if many_bodies else []
    of_people = [tables.dynamics_table(reproduction.dynamics)] if reproduction.dynamics else []
    in_engines = [tables.engine_table(engines)] if engines else []
    sections = [
        Section("In short", "short", [*shown("overview"), findings(reproduction, claims, by_recipe, paper)]),
        Section("Verdicts", "verdicts", overview),
        Section("Theory", "theory", [_theory(reproduction.transitions)]),
        Section("Body and learning", "body", body),
        Section(
            "Exp. 1: target frequency",
            "frequency",
            [*exp_1, *shown(*(f"figure_{number}" for number in range(2, 8)), "tracking")],
        ),
        Section("As published", "published", published),
        Section("Exp. 2: effort", "energy", [*exp_2, *shown("figure_8")]),
        Section("Exp. 3: hip stiffness", "stiffness", [*exp_3, *shown("figure_9")]),
        Section("Exp. 4a: rising frequency", "ramp", [*exp_4a, *shown("figure_10")]),
        Section("Exp. 4b: load", "load", [*exp_4b, *shown("figure_11", "figure_12")]),
        Section("Frequency and hip stiffness", "map", shown("figure_13")),
        Section("One policy for many bodies", "bodies", [*in_all, *shown("many_bodies")]),
        Section("Senses and muscles of people", "human", [*of_people, *shown("dynamics")]),
        Section("Amplitude", "amplitude", shown("amplitude")),
        Section("Other physics engines", "engines", [*in_engines, *shown("engines")]),
        Section("Claim by claim", "rules", [_in_full(claim) for claim in claims]),
        Section("How this was made", "made", [training_table(trainings), how_it_was_made(trainings, commands)]),
    ]
    return [section for section in sections if section.blocks]


def numbers_in_text(run: TrainConfig, paper: Published) -> dict[str, float]:
    """The numbers that page/text.py refers to, by name."""
    return {
        "travel": 2 * run.env.amplitude,
        "tolerance_mm": 1e3 * run.evaluation.tolerance,
        "duration": run.evaluation.duration,
        "energy_hz": paper.table_4.freq_hz,
        "stiffness_hz": paper.experiment_3.freq_hz,
        "ramp_rate": paper.experiment_4a.rate_hz_per_s,
        "window_steps": paper.experiment_4a.window_steps,
        "load_kg": paper.experiment_4b.load_kg[-1],
        "load_hz": paper.experiment_4b.freq_hz,
    }


def _in_full(claim: Verdict) -> str:
    """A claim in full, and the rule by which it was judged."""
    parts = {
        "Published": claim.published,
        "Measured": claim.measured,
        "Theory": claim.theory,
        "Rule": claim.rule,
        "Comment": claim.comment,
    }
    texts = [f"**{name}:** {_sentence(words)}" for name, words in parts.items() if words]
    return f"**{claim.experiment}. {claim.claim}** {claim.verdict.capitalize()}. {' '.join(texts)}"


def _sentence(words: str) -> str:
    return words if words.endswith((".", ")")) else f"{words}."


def _theory(transitions: Transitions) -> str:
    return text.THEORY.format(**{name: in_hz(hz) for name, hz in asdict(transitions).items()})
