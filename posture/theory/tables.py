"""The theory's tables: what the torque-optimal stander does in each experiment of the paper."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from envs.body.segments import Segments
from envs.config import EnvConfig
from posture.analysis.coordination import Row, mode
from posture.config.published import read_published
from posture.config.theory import TheoryConfig
from posture.theory.optimum import bound
from posture.theory.prediction import predict
from posture.theory.program import InfeasibleError
from posture.theory.stander import linearise
from posture.theory.transition import bound_transition, hip_ankle_correlation, reward_transition, sinusoid_transition

# Row column: (heading over unit, factor, format).
Columns = dict[str, tuple[str, float, str]]

_CONDITION: Columns = {
    "freq_hz": ("f [Hz]", 1, "g"),
    "hip_k_nm_per_rad": ("hip k [Nm/rad]", 1, "g"),
    "load_kg": ("load [kg]", 1, "g"),
}
_OPTIMUM: Columns = {
    "sinusoid_hip_ankle_r": ("sinusoid r", 1, ".3f"),
    "sinusoid_cost": ("sinusoid cost", 1, ".4f"),
    "least_hip_ankle_r": ("least r", 1, ".3f"),
    "least_cost": ("least cost", 1, ".4f"),
    "least_mode": ("mode", 1, ""),
    "paper_mode": ("paper", 1, ""),
    "least_energy_j": ("energy [J]", 1, ".0f"),
    "least_hip_range_deg": ("hip [deg]", 1, ".1f"),
    "least_ankle_range_deg": ("ankle [deg]", 1, ".1f"),
    "least_hip_torque_range_nm": ("hip [Nm]", 1, ".1f"),
    "least_ankle_torque_range_nm": ("ankle [Nm]", 1, ".1f"),
    "least_cop_min_m": ("CoP from [mm]", 1e3, ".0f"),
    "least_cop_max_m": ("CoP to [mm]", 1e3, ".0f"),
    "cop_binds": ("CoP binds", 1, ""),
}
_TRANSITIONS: Columns = {
    "hip_k_nm_per_rad": ("hip k [Nm/rad]", 1, "g"),
    "ankle_k_nm_per_rad": ("ankle k [Nm/rad]", 1, "g"),
    "load_kg": ("load [kg]", 1, "g"),
    "tolerance_m": ("tolerance [mm]", 1e3, "g"),
    "sinusoid_transition_hz": ("sinusoid f* [Hz]", 1, ".3f"),
    "least_transition_hz": ("least f* [Hz]", 1, ".3f"),
}


@dataclass(frozen=True)
class Table:
    """Rows under a name (of the file) and a title (of the print), and how columns are shown."""

    name: str
    title: str
    rows: list[Row]
    columns: Columns

    def text(self) -> str:
        """Fixed width, headings over units, right-aligned; a dash where there is no value."""
        columns = {name: column for name, column in self.columns.items() if name in self.rows[0]}
        headings = [(*heading.rsplit(" ", 1), "")[:2] for heading, _, _ in columns.values()]
        cells = [[_cell(row[name], factor, spec) for name, (_, factor, spec) in columns.items()] for row in self.rows]
        lines = [*map(list, zip(*headings, strict=True)), *cells]
        widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
        text = ["  ".join(cell.rjust(width) for cell, width in zip(line, widths, strict=True)) for line in lines]
        return "\n".join([text[0], text[1].rstrip(), "-" * len(text[0]), *text[2:]])


def all_tables(body: Segments, config: TheoryConfig) -> list[Table]:
    """Every table, in the order of the paper. Raises InfeasibleError where the stander as configured cannot follow."""
    return [
        experiment_1(body, config),
        experiment_3(body, config),
        experiment_4b(body, config),
        figure_13(body, config),
        around(body, config),
        switch(body, config),
    ]


def experiment_1(body: Segments, config: TheoryConfig) -> Table:
    """Exp. 1: the stander as configured, at every frequency of the evaluation."""
    published = _published(config, "table_3", "freq_hz", ())
    rows = [_predicted(body, config, freq, {}, published) for freq in config.evaluation.freq]
    for row in rows:
        if not row["feasible"]:  # ask again, for the reason
            bound(linearise(body, config.env), row["freq_hz"], config.env.amplitude, config.head_tolerance)
    return Table(
        "experiment_1", f"Exp. 1: hip {config.env.hip_k:g} Nm/rad, load {config.env.load:g} kg", rows, _of("freq_hz")
    )


def experiment_3(body: Segments, config: TheoryConfig) -> Table:
    """Exp. 3: hip stiffness swept at one frequency."""
    freq, published = config.experiment_3.freq, _published(config, "experiment_3", "hip_k_nm_per_rad", ("hip_k",))
    rows = [_predicted(body, config, freq, {"hip_k": k}, published) for k in config.experiment_3.hip_k]
    return Table("experiment_3", f"Exp. 3: {freq:g} Hz, load {config.env.load:g} kg", rows, _of("hip_k_nm_per_rad"))


def experiment_4b(body: Segments, config: TheoryConfig) -> Table:
    """Exp. 4b: load swept at one frequency."""
    sweep = config.experiment_4b
    published = _published(config, "experiment_4b", "load_kg", ("load",))
    rows = [_predicted(body, config, sweep.freq, {"load": m}, published) for m in _steps(sweep.load, sweep.step)]
    return Table("experiment_4b", f"Exp. 4b: {sweep.freq:g} Hz, hip {config.env.hip_k:g} Nm/rad", rows, _of("load_kg"))


def figure_13(body: Segments, config: TheoryConfig) -> Table:
    """Fig. 13: a row a hip stiffness: both transition frequencies, and the bound's correlation at each frequency."""
    grid = _steps(config.figure_13.freq, config.figure_13.step)
    rows = []
    for hip_k in config.figure_13.hip_k:
        row = _transitions(body, config, config.head_tolerance, hip_k=hip_k)
        stander = linearise(body, varied(config.env, hip_k=hip_k))
        for freq in grid:
            try:
                r = hip_ankle_correlation(bound(stander, freq, config.env.amplitude, config.head_tolerance))
            except InfeasibleError:
                r = math.nan
            row[f"r_at_{freq:g}_hz"] = r
            row[f"mode_at_{freq:g}_hz"] = mode(r).removesuffix("-phase")
        rows.append(row)
    modes: Columns = {f"mode_at_{freq:g}_hz": (f"{freq:g} Hz", 1, "") for freq in grid}
    shown = {name: _TRANSITIONS[name] for name in ("hip_k_nm_per_rad", "sinusoid_transition_hz", "least_transition_hz")}
    title = f"Fig. 13: transition frequency and least-cost modes, load {config.env.load:g} kg"
    return Table("figure_13", title, rows, shown | modes)


def around(body: Segments, config: TheoryConfig) -> Table:
    """How the transition moves with ankle stiffness, load and tolerance, one at a time."""
    values, tolerance = config.around, config.head_tolerance
    rows = [
        *({"varied": "ankle_k", **_transitions(body, config, tolerance, ankle_k=k)} for k in values.ankle_k),
        *({"varied": "load", **_transitions(body, config, tolerance, load=m)} for m in values.load),
        *({"varied": "tolerance", **_transitions(body, config, t)} for t in values.tolerance if t < config.env.amplitude),
    ]
    return Table("around", "Transition frequency, one parameter varied", rows, {"varied": ("varied", 1, ""), **_TRANSITIONS})


def switch(body: Segments, config: TheoryConfig) -> Table:
    """The transition of the stander as configured, and that of the configured reward with its energy term."""
    row = _transitions(body, config, config.head_tolerance)
    try:
        found = reward_transition(linearise(body, config.env), config.env, config.head_tolerance, config.search)
    except ValueError:  # no weight on torques, so no motion is preferred
        found = None
    row["reward_transition_hz"] = math.nan if found is None else found
    columns = {**_TRANSITIONS, "reward_transition_hz": ("reward f* [Hz]", 1.0, ".3f")}
    return Table("transition", "Transition frequency: closed form, least cost, configured reward", [row], columns)


def _of(condition: str) -> Columns:
    """What is shown of an optimum, under the condition that its table sweeps."""
    return {condition: _CONDITION[condition], **_OPTIMUM}


def varied(config: EnvConfig, **changes: float) -> EnvConfig:
    """`config` with some of its numbers changed, checked anew."""
    return EnvConfig.model_validate(config.model_dump() | changes)


def _predicted(
    body: Segments, config: TheoryConfig, freq: float, changes: Mapping[str, float], published: Mapping[float, str]
) -> Row:
    """The prediction for the stander with `changes`, beside the mode that `published` has for it."""
    row = predict(body, varied(config.env, **changes), freq, config.head_tolerance, config.evaluation.duration)
    if published:
        row["paper_mode"] = published.get(next(iter(changes.values()), freq), "-")
    return row


def _transitions(body: Segments, config: TheoryConfig, tolerance: float, **changes: float) -> Row:
    """The closed form's and the bound's transition frequency of one condition; nan where there is none."""
    env = varied(config.env, **changes)
    stander = linearise(body, env)
    found = {
        "sinusoid_transition_hz": sinusoid_transition(stander, config.search),
        "least_transition_hz": bound_transition(stander, env.amplitude, tolerance, config.search),
    }
    return {
        "hip_k_nm_per_rad": env.hip_k,
        "ankle_k_nm_per_rad": env.ankle_k,
        "load_kg": env.load,
        "tolerance_m": tolerance,
        **{name: math.nan if f is None else f for name, f in found.items()},
    }


def _published(config: TheoryConfig, table: str, column: str, swept: Sequence[str]) -> dict[float, str]:
    """The paper's mode at each value of `column`; none where the stander differs from the paper's in more than `swept`."""
    published = read_published().model_dump(mode="json")
    condition = published["table_3"]["condition"]
    if any(getattr(config.env, key) != value for key, value in condition.items() if key not in swept):
        return {}
    content = published[table]
    modes = content.get("mode", content.get("mode_at_ends"))
    return {value: f"{name}-phase" for value, name in zip(content[column], modes, strict=True)}


def _steps(span: tuple[float, float], step: float) -> list[float]:
    """Values from one end to the other, by `step`, both ends included."""
    low, high = span
    values = [float(f"{value:.10g}") for value in np.arange(low, high + 1e-9, step)]
    return values if math.isclose(values[-1], high) else [*values, high]


def _cell(value: object, factor: float, spec: str) -> str:
    if isinstance(value, float):
        return "-" if math.isnan(value) else format(value * factor, spec)
    return str(value)
