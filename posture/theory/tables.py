"""The theory's tables: the torque-optimal stander in each experiment of the paper."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Generic, TypeVar

import numpy as np

from envs.body.segments import Segments
from envs.config import EnvConfig
from posture.analysis.coordination import mode
from posture.analysis.results import Row, as_row, columns_of
from posture.analysis.table import Column, text_table
from posture.config.published import read_published
from posture.config.theory import TheoryConfig
from posture.theory.nonlinear import exact_bound, exact_stander
from posture.theory.optimum import bound
from posture.theory.prediction import Prediction, predict
from posture.theory.program import InfeasibleError
from posture.theory.stander import Stander, linearise
from posture.theory.transition import (
    bound_transition,
    hip_ankle_correlation,
    reward_transition,
    sinusoid_transition,
    transition_frequency,
)

R = TypeVar("R")


@dataclass(frozen=True)
class Transitions:
    """Transition frequencies of the stander under one condition; nan where there is none."""

    hip_k_nm_per_rad: float
    ankle_k_nm_per_rad: float
    load_kg: float
    tolerance_m: float  # of the head around the target
    sinusoid_transition_hz: float  # of the closed form
    least_transition_hz: float  # of the bound


@dataclass(frozen=True)
class TransitionsAround:
    """The transitions with one parameter varied."""

    varied: str  # ankle_k, load or tolerance
    transitions: Transitions = columns_of("")


@dataclass(frozen=True)
class AllTransitions:
    """The transitions with those of the exact equations, and of the configured reward's optimum."""

    transitions: Transitions = columns_of("")
    exact_transition_hz: float = math.nan
    reward_transition_hz: float = math.nan


@dataclass(frozen=True)
class ModeMapRow:
    """The transitions at one hip stiffness, and the bound's hip-ankle correlation at each frequency [Hz]."""

    transitions: Transitions
    r: Mapping[float, float]

    def as_row(self) -> Row:
        """As in the CSV file: columns r_at_<f>_hz and mode_at_<f>_hz for each frequency f."""
        row = as_row(self.transitions)
        for freq, r in self.r.items():
            row |= {f"r_at_{freq:g}_hz": r, f"mode_at_{freq:g}_hz": mode(r).removesuffix("-phase")}
        return row


@dataclass(frozen=True)
class TheoryTable(Generic[R]):
    """Rows under a title, the columns shown in the terminal, and how a row is written to the CSV file."""

    title: str
    rows: list[R]
    columns: list[Column[R]]
    as_row: Callable[[R], Row] = as_row

    def text(self) -> str:
        """The table for the terminal."""
        return text_table(self.rows, self.columns)

    def csv_rows(self) -> list[Row]:
        """The rows as written to the CSV file, with all their columns."""
        return [self.as_row(row) for row in self.rows]


@dataclass(frozen=True)
class TheoryTables:
    """Every table, in the order of the paper."""

    experiment_1: TheoryTable[Prediction]
    experiment_3: TheoryTable[Prediction]
    experiment_4b: TheoryTable[Prediction]
    figure_13: TheoryTable[ModeMapRow]
    around: TheoryTable[TransitionsAround]
    transition: TheoryTable[AllTransitions]

    def items(self) -> Iterator[tuple[str, TheoryTable[Any]]]:
        """Names and tables."""
        return iter(vars(self).items())


def all_tables(body: Segments, config: TheoryConfig) -> TheoryTables:
    """Every table. Raises InfeasibleError where the stander as configured cannot follow."""
    return TheoryTables(
        experiment_1(body, config),
        experiment_3(body, config),
        experiment_4b(body, config),
        figure_13(body, config),
        around(body, config),
        transition(body, config),
    )


def experiment_1(body: Segments, config: TheoryConfig) -> TheoryTable[Prediction]:
    """Exp. 1: the stander as configured, at every frequency of the evaluation."""
    env, paper = config.env, read_published().table_3
    published = _paper_modes(config, (), paper.freq_hz, paper.mode)
    rows = [_predicted(body, config, freq, {}, published.get(freq, "-")) for freq in config.evaluation.freq]
    for row in rows:
        if not row.feasible:
            bound(linearise(body, env), row.freq_hz, env.amplitude, config.head_tolerance)  # raises with the reason
    return _experiment(f"Exp. 1: hip {env.hip_k:g} Nm/rad, load {env.load:g} kg", rows, _FREQ, bool(published))


def experiment_3(body: Segments, config: TheoryConfig) -> TheoryTable[Prediction]:
    """Exp. 3: hip stiffness swept at one frequency."""
    freq, paper = config.experiment_3.freq, read_published().experiment_3
    published = _paper_modes(config, ("hip_k",), paper.hip_k_nm_per_rad, paper.mode)
    rows = [_predicted(body, config, freq, {"hip_k": k}, published.get(k, "-")) for k in config.experiment_3.hip_k]
    return _experiment(f"Exp. 3: {freq:g} Hz, load {config.env.load:g} kg", rows, _HIP_K, bool(published))


def experiment_4b(body: Segments, config: TheoryConfig) -> TheoryTable[Prediction]:
    """Exp. 4b: load swept at one frequency."""
    sweep, paper = config.experiment_4b, read_published().experiment_4b
    published = _paper_modes(config, ("load",), paper.load_kg, paper.mode_at_ends)
    loads = _steps(sweep.load, sweep.step)
    rows = [_predicted(body, config, sweep.freq, {"load": m}, published.get(m, "-")) for m in loads]
    return _experiment(f"Exp. 4b: {sweep.freq:g} Hz, hip {config.env.hip_k:g} Nm/rad", rows, _LOAD, bool(published))


def figure_13(body: Segments, config: TheoryConfig) -> TheoryTable[ModeMapRow]:
    """Fig. 13: for each hip stiffness both transition frequencies, and the bound's correlation at each frequency."""
    grid = _steps(config.figure_13.freq, config.figure_13.step)
    rows = []
    for hip_k in config.figure_13.hip_k:
        stander = linearise(body, varied(config.env, hip_k=hip_k))
        r = {freq: _bound_correlation(stander, freq, config) for freq in grid}
        rows.append(ModeMapRow(_transitions(body, config, config.head_tolerance, hip_k=hip_k), r))
    columns: list[Column[ModeMapRow]] = [
        Column("hip k [Nm/rad]", lambda row: row.transitions.hip_k_nm_per_rad, "g"),
        Column("sinusoid f* [Hz]", lambda row: row.transitions.sinusoid_transition_hz, ".3f"),
        Column("least f* [Hz]", lambda row: row.transitions.least_transition_hz, ".3f"),
        *(Column(f"{freq:g} Hz", _mode_at(freq)) for freq in grid),
    ]
    title = f"Fig. 13: transition frequency and least-cost modes, load {config.env.load:g} kg"
    return TheoryTable(title, rows, columns, ModeMapRow.as_row)


def around(body: Segments, config: TheoryConfig) -> TheoryTable[TransitionsAround]:
    """How the transition moves with ankle stiffness, load and tolerance, one at a time."""
    values, tolerance = config.around, config.head_tolerance
    rows = [
        *(TransitionsAround("ankle_k", _transitions(body, config, tolerance, ankle_k=k)) for k in values.ankle_k),
        *(TransitionsAround("load", _transitions(body, config, tolerance, load=m)) for m in values.load),
        *(
            TransitionsAround("tolerance", _transitions(body, config, t))
            for t in values.tolerance
            if t < config.env.amplitude
        ),
    ]
    columns: list[Column[TransitionsAround]] = [
        Column("varied", lambda row: row.varied),
        *_transition_columns(lambda row: row.transitions),
    ]
    return TheoryTable("Transition frequency, one parameter varied", rows, columns)


def transition(body: Segments, config: TheoryConfig) -> TheoryTable[AllTransitions]:
    """The transition of the stander as configured, and that of the configured reward with its energy term."""
    try:
        found = reward_transition(linearise(body, config.env), config.env, config.head_tolerance, config.search)
    except ValueError:  # no weight on torques, so no motion is preferred
        found = None
    env, tolerance = config.env, config.head_tolerance
    exact = transition_frequency(lambda f: exact_bound(exact_stander(body, env), f, env.amplitude, tolerance), config.search)
    of_both = (math.nan if freq is None else freq for freq in (exact, found))
    row = AllTransitions(_transitions(body, config, tolerance), *of_both)
    columns: list[Column[AllTransitions]] = [
        *_transition_columns(lambda row: row.transitions),
        Column("exact f* [Hz]", lambda row: row.exact_transition_hz, ".3f"),
        Column("reward f* [Hz]", lambda row: row.reward_transition_hz, ".3f"),
    ]
    return TheoryTable("Transition frequency: closed form, least cost, configured reward", [row], columns)


def varied(config: EnvConfig, **changes: float) -> EnvConfig:
    """`config` with some of its numbers changed, checked again."""
    return EnvConfig.model_validate(config.model_dump() | changes)


def _experiment(title: str, rows: list[Prediction], swept: Column[Prediction], published: bool) -> TheoryTable[Prediction]:
    """A table of predictions that begins with what it sweeps, the paper's mode beside ours where there is one."""
    paper = [Column[Prediction]("paper", lambda row: row.paper_mode)] if published else []
    return TheoryTable(title, rows, [swept, *_OPTIMUM, *paper, *_EFFORT])


def _predicted(
    body: Segments, config: TheoryConfig, freq: float, changes: Mapping[str, float], paper_mode: str
) -> Prediction:
    """The prediction for the stander with `changes`."""
    row = predict(body, varied(config.env, **changes), freq, config.head_tolerance, config.evaluation.duration)
    return replace(row, paper_mode=paper_mode)


def _mode_at(freq: float) -> Callable[[ModeMapRow], str]:
    return lambda row: mode(row.r[freq]).removesuffix("-phase")


def _bound_correlation(stander: Stander, freq: float, config: TheoryConfig) -> float:
    """Hip-ankle correlation [-] of the bound; nan where no motion keeps the limits."""
    try:
        return hip_ankle_correlation(bound(stander, freq, config.env.amplitude, config.head_tolerance))
    except InfeasibleError:
        return math.nan


def _transitions(body: Segments, config: TheoryConfig, tolerance: float, **changes: float) -> Transitions:
    """The closed form's and the bound's transition frequency under one condition."""
    env = varied(config.env, **changes)
    stander = linearise(body, env)
    found = (
        sinusoid_transition(stander, config.search),
        bound_transition(stander, env.amplitude, tolerance, config.search),
    )
    return Transitions(env.hip_k, env.ankle_k, env.load, tolerance, *(math.nan if freq is None else freq for freq in found))


def _paper_modes(
    config: TheoryConfig, swept: Sequence[str], values: Sequence[float], modes: Sequence[str]
) -> dict[float, str]:
    """The paper's mode at each value; none where the stander differs from the paper's in more than the keys `swept`."""
    condition = read_published().table_3.condition
    if config.env.body is not None or any(getattr(config.env, key) != value for key, value in condition if key not in swept):
        return {}
    return {value: f"{mode}-phase" for value, mode in zip(values, modes, strict=True)}


def _steps(span: tuple[float, float], step: float) -> list[float]:
    """Values from one end to the other, by `step`, both ends included."""
    low, high = span
    values = [float(f"{value:.10g}") for value in np.arange(low, high + 1e-9, step)]
    return values if math.isclose(values[-1], high) else [*values, high]


def _transition_columns(transitions: Callable[[R], Transitions]) -> list[Column[R]]:
    return [
        Column("hip k [Nm/rad]", lambda row: transitions(row).hip_k_nm_per_rad, "g"),
        Column("ankle k [Nm/rad]", lambda row: transitions(row).ankle_k_nm_per_rad, "g"),
        Column("load [kg]", lambda row: transitions(row).load_kg, "g"),
        Column("tolerance [mm]", lambda row: transitions(row).tolerance_m, "g", 1e3),
        Column("sinusoid f* [Hz]", lambda row: transitions(row).sinusoid_transition_hz, ".3f"),
        Column("least f* [Hz]", lambda row: transitions(row).least_transition_hz, ".3f"),
    ]


_FREQ: Column[Prediction] = Column("f [Hz]", lambda row: row.freq_hz, "g")
_HIP_K: Column[Prediction] = Column("hip k [Nm/rad]", lambda row: row.hip_k_nm_per_rad, "g")
_LOAD: Column[Prediction] = Column("load [kg]", lambda row: row.load_kg, "g")
_OPTIMUM: list[Column[Prediction]] = [
    Column("sinusoid r", lambda row: row.sinusoid.hip_ankle_r, ".3f"),
    Column("sinusoid cost", lambda row: row.sinusoid.cost, ".4f"),
    Column("least r", lambda row: row.least.hip_ankle_r, ".3f"),
    Column("least cost", lambda row: row.least.cost, ".4f"),
    Column("exact cost", lambda row: row.least.exact_cost, ".4f"),
    Column("mode", lambda row: row.least.mode),
]
_EFFORT: list[Column[Prediction]] = [
    Column("energy [J]", lambda row: row.least.energy_j, ".0f"),
    Column("hip [deg]", lambda row: row.least.hip_range_deg, ".1f"),
    Column("ankle [deg]", lambda row: row.least.ankle_range_deg, ".1f"),
    Column("hip [Nm]", lambda row: row.least.hip_torque_range_nm, ".1f"),
    Column("ankle [Nm]", lambda row: row.least.ankle_torque_range_nm, ".1f"),
    Column("CoP from [mm]", lambda row: row.least.cop_min_m, ".0f", 1e3),
    Column("CoP to [mm]", lambda row: row.least.cop_max_m, ".0f", 1e3),
    Column("CoP binds", lambda row: row.least.cop_binds),
]
