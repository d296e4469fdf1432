"""The table of one evaluation, a line a world: for the terminal and for Markdown.

`paper` is the content of conf/paper.yaml. Where a world's frequency is one of paper Table 3, the published
values stand beside ours; pass None where the other conditions are not that table's. Where the rows have the columns
of the torque-optimal stander, cost over least cost and the optimum's correlation follow, with the shares of time in which
the head is beyond the tolerance and a foot is not flat, since only where both are zero is the optimum a bound.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from posture.analysis.coordination import Row

Paper = Mapping[str, Any] | None

# Row column: (heading with unit, format). Those that paper Table 3 has too come first.
_CONDITIONS = {
    "freq_hz": ("f [Hz]", "g"),
    "hip_k_nm_per_rad": ("hip k [Nm/rad]", "g"),
    "ankle_k_nm_per_rad": ("ankle k [Nm/rad]", "g"),
    "load_kg": ("load [kg]", "g"),
}
_PUBLISHED = {
    "mode": ("mode", ""),
    "target_head_r": ("target-head r", ".4f"),
    "head_amplitude_m": ("amplitude [m]", ".4f"),
    "head_speed_mps": ("speed [m/s]", ".4f"),
}
_OURS = {
    "hip_ankle_r": ("hip-ankle r", ".3f"),
    "relative_phase_deg": ("phase [deg]", ".0f"),
    "energy_j": ("energy [J]", ".0f"),
    "cost": ("cost", ".4f"),
}
_THEORY = {
    "cost_ratio": ("cost/least", ".2f"),
    "least_hip_ankle_r": ("least's r", ".3f"),
    "beyond_tolerance_share": ("beyond tolerance", ".3f"),
    "foot_not_flat_share": ("not flat", ".3f"),
}
_NOTHING = "-"


def evaluation_table(rows: Sequence[Row], paper: Paper) -> str:
    """Fixed-width table for the terminal: headings over units, a rule, a line a world; right-aligned."""
    headings, *worlds = _cells(rows, paper)
    split = [(*heading.rsplit(" ", 1), "")[:2] for heading in headings]
    lines = [*map(list, zip(*split, strict=True)), *worlds]
    widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
    text = ["  ".join(cell.rjust(width) for cell, width in zip(line, widths, strict=True)) for line in lines]
    return "\n".join([text[0], text[1].rstrip(), "-" * len(text[0]), *text[2:]])


def markdown_table(rows: Sequence[Row], paper: Paper) -> str:
    """The same table in Markdown, columns right-aligned."""
    lines = ["| " + " | ".join(line) + " |" for line in _cells(rows, paper)]
    return "\n".join([lines[0], "|" + " ---: |" * (lines[0].count("|") - 1), *lines[1:]])


def _cells(rows: Sequence[Row], paper: Paper) -> list[list[str]]:
    """Headings, then the cells of each world. Stiffness and load show only where worlds differ in them."""
    conditions = {
        name: column for name, column in _CONDITIONS.items() if name == "freq_hz" or len({row[name] for row in rows}) > 1
    }
    published = [_published(row["freq_hz"], paper) for row in rows]
    beside = any(published)
    ours = {**_OURS, **(_THEORY if any("cost_ratio" in row for row in rows) else {})}
    heading = [title for title, _ in conditions.values()]
    for title, _ in _PUBLISHED.values():
        heading += [title, "paper"] if beside else [title]
    lines = [heading + [title for title, _ in ours.values()]]
    for row, theirs in zip(rows, published, strict=True):
        line = ["ramp" if math.isnan(row["freq_hz"]) else _cell(row, "freq_hz", "g")]
        line += [_cell(row, name, spec) for name, (_, spec) in conditions.items() if name != "freq_hz"]
        for name, (_, spec) in _PUBLISHED.items():
            line.append(_fate(row) if name == "mode" else _cell(row, name, spec))
            if beside:
                line.append(_cell(theirs, name, spec))
        lines.append(line + [_cell(row, name, spec) for name, (_, spec) in ours.items()])
    return lines


def _published(freq: float, paper: Paper) -> Row:
    """The values of paper Table 3 at `freq` [Hz] under our column names; empty at other frequencies."""
    table = (paper or {}).get("table_3", {})
    for i, f in enumerate(table.get("freq_hz", ())):
        if math.isclose(f, freq, rel_tol=1e-6):
            row = {name: table[name][i] for name in _PUBLISHED if name in table}
            return {**row, "mode": f"{row['mode']}-phase"} if "mode" in row else row
    return {}


def _fate(row: Row) -> str:
    """The mode; of a world without one, why."""
    if row["fell"]:
        return f"fell {row['fall_time_s']:.1f} s"
    return str(row["mode"]) if row["valid"] else "not finite"


def _cell(row: Row, name: str, spec: str) -> str:
    """One formatted value; a dash where there is none."""
    value = row.get(name, math.nan)
    return _NOTHING if isinstance(value, float) and math.isnan(value) else format(value, spec)
