"""The report of a reproduction: one page of claims, measurements, figures and verdicts, its tables as CSV, and a summary."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from envs.body.segments import read_segments
from posture.analysis.results import Row, write_rows
from posture.config.published import read_published
from posture.config.train import TrainConfig
from posture.reproduce.claims.all_claims import verdicts
from posture.reproduce.claims.targets import Target, targets
from posture.reproduce.claims.verdict import Verdict
from posture.reproduce.figures.all_figures import draw_report
from posture.reproduce.page import page
from posture.reproduce.page import tables as report_tables
from posture.reproduce.page.page import Block, Figure, Section, Table, Text
from posture.reproduce.page.provenance import left_out, made, mixed
from posture.reproduce.page.text import FIGURES, HOW_TO_READ, SUBTITLE, THEORY, TITLE
from posture.reproduce.results import Results
from posture.storage import run_dir
from posture.storage.atomic import replacing


def write_report(results: Results, out: Path, commands: Sequence[str], ramp_start: float) -> Path:
    """Write into `out`: report.html, summary.md, figures/ and tables/ (a tidy CSV for each experiment, one of the verdicts).

    `commands`: those that made the results. `ramp_start`: where the ramp of Exp. 4a began [Hz]. Returns the page's path.
    """
    run_dir.writable(out)
    run, paper = results.first, read_published().model_dump(mode="json")
    claims = verdicts(results.rows, paper, results.transitions)
    aims = targets(results.rows, paper, results.transitions)
    for name, rows in results.rows.items():
        write_rows(_even(rows), out / "tables" / f"{name}.csv")
    write_rows([asdict(claim) for claim in claims], out / "tables" / "verdicts.csv")
    body = read_segments(run.env)
    figures = draw_report(
        results.rows,
        results.traces,
        paper,
        (body.heel_x, body.toe_x),
        results.transitions,
        out / "figures",
        ramp_start=ramp_start,
        still_joint_deg=run.evaluation.still_joint_deg,
    )
    sections = _sections(results, claims, aims, figures, commands)
    subtitle = _subtitle(claims)
    for name, text in (
        ("report.html", page.html(TITLE, subtitle, sections)),
        ("summary.md", page.markdown(TITLE, subtitle, sections, "figures")),
    ):
        with replacing(out / name) as temporary:
            temporary.write_text(text, encoding="utf-8")
    return out / "report.html"


def _subtitle(claims: Sequence[Verdict]) -> str:
    """What became of the claims, in one sentence."""
    count = Counter(report_tables.word(claim.verdict) for claim in claims)
    told = ", ".join(f"{count[word]} {word}" for word in page.Verdict if count[word])
    return SUBTITLE.format(count=len(claims), told=told).strip()


def _sections(
    results: Results,
    claims: Sequence[Verdict],
    aims: Sequence[Target],
    figures: Mapping[str, Path],
    commands: Sequence[str],
) -> list[Section]:
    """The page, top to bottom. Of what was not measured there is neither table nor figure."""
    rows, run, paper = results.rows, results.first, read_published().model_dump(mode="json")
    filled = numbers(run)

    def shown(*names: str) -> list[Block]:
        told = {name: [text.format_map(filled) for text in FIGURES[name]] for name in names if name in figures}
        return [Figure(figures[name], *texts) for name, texts in told.items()]

    def table(make: Callable[[Sequence[Row], Mapping[str, Any]], Table], name: str) -> list[Block]:
        return [make(rows[name], paper)] if name in rows else []

    tables = report_tables
    sections = [
        Section(
            "Verdicts",
            "verdicts",
            [
                *(Text(warning) for warning in warnings(results)),
                Text(HOW_TO_READ.format_map(filled)),
                tables.verdict_table(claims),
                tables.target_table(aims),
            ],
        ),
        Section("Theory", "theory", [Text(_theory(results.transitions))]),
        Section("Body and learning", "body", [tables.body_table(run.env, paper), tables.learning_table(run, paper)]),
        Section(
            "Exp. 1: target frequency",
            "frequency",
            [
                *table(tables.tracking_table, "frequency"),
                *table(tables.mode_table, "frequency"),
                *shown(*(f"figure_{n}" for n in range(2, 8)), "tracking"),
            ],
        ),
        Section("Exp. 2: effort", "energy", [*table(tables.energy_table, "energy"), *shown("figure_8")]),
        Section("Exp. 3: hip stiffness", "stiffness", [*table(tables.stiffness_table, "hip_stiffness"), *shown("figure_9")]),
        Section("Exp. 4a: rising frequency", "ramp", [*table(tables.ramp_table, "ramp"), *shown("figure_10")]),
        Section("Exp. 4b: load", "load", [*table(tables.load_table, "load"), *shown("figure_11", "figure_12")]),
        Section("Frequency by hip stiffness", "map", shown("figure_13")),
        Section("Amplitude", "amplitude", shown("amplitude")),
        Section(
            "Other physics",
            "engines",
            [*([tables.engine_table(rows["engines"])] if "engines" in rows else []), *shown("engines")],
        ),
        Section("Claim by claim", "rules", [Text(_said(claim)) for claim in claims]),
        Section("How this was made", "made", made(results.jobs, commands)),
    ]
    return [section for section in sections if section.blocks]


def numbers(run: TrainConfig) -> dict[str, float]:
    """The numbers that stand in words and captions, by the names that text.py has for them."""
    paper = read_published().model_dump(mode="json")
    return {
        "travel": 2 * run.env.amplitude,
        "amplitude": run.env.amplitude,
        "tolerance_mm": 1e3 * run.evaluation.tolerance,
        "duration": run.evaluation.duration,
        "energy_hz": paper["table_4"]["freq_hz"],
        "stiffness_hz": paper["experiment_3"]["freq_hz"],
        "ramp_rate": paper["experiment_4a"]["rate_hz_per_s"],
        "window_steps": paper["experiment_4a"]["window_steps"],
        "load_kg": paper["experiment_4b"]["load_kg"][-1],
        "load_hz": paper["experiment_4b"]["freq_hz"],
    }


def warnings(results: Results) -> list[str]:
    """What a reader has to know of the results as a whole before any number."""
    return [text for text in (mixed(results.jobs), left_out(results.left_out)) if text]


def _said(claim: Verdict) -> str:
    """All that there is to say of a claim, and the rule by which it was judged."""
    parts = {
        "Published": claim.published,
        "Measured": claim.measured,
        "Theory": claim.theory,
        "Rule": claim.rule,
        "Remark": claim.comment,
    }
    told = " ".join(f"**{name}:** {_sentence(text)}" for name, text in parts.items() if text)
    return f"**{claim.experiment}. {claim.claim}** {_sentence(report_tables.word(claim.verdict).capitalize())} {told}"


def _sentence(text: str) -> str:
    return text if text.endswith((".", ")")) else f"{text}."


def _theory(transitions: Mapping[str, float]) -> str:
    return THEORY.format_map({name: "none" if math.isnan(f) else f"{f:.3f} Hz" for name, f in transitions.items()})


def _even(rows: Sequence[Row]) -> list[Row]:
    """All rows with all columns, nan where a row has none."""
    columns = dict.fromkeys(name for row in rows for name in row)
    return [{name: row.get(name, math.nan) for name in columns} for row in rows]
