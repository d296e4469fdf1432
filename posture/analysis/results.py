"""One row of results: the measurements in one world of one trial, with the theory; and its CSV file.

`Result` is the only place that names the columns. Its fields are the columns of metrics.csv, in this order. A field that is
itself a dataclass is a group of columns: the group is left out of a file in which no row has it. An index that is undefined
(a fall, a joint that hardly moves, no whole cycle) is nan.
"""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import MISSING, Field, dataclass, field, fields
from pathlib import Path
from typing import Any

from posture.storage.atomic import replacing

Row = dict[str, Any]
"""A row of a CSV file: column name to value."""


def columns_of(prefix: str, default: Any = MISSING) -> Any:
    """A dataclass field whose own fields are columns with `prefix` before their names.

    The columns are left out of a row whose value is the object `default` itself.
    """
    return field(default=default, metadata={"prefix": prefix})


@dataclass(frozen=True)
class Origin:
    """The training run that a result belongs to."""

    seed: int = -1
    energy_weight: float = math.nan  # gamma at the end of the training
    physics: str = ""  # engine of the trial
    amplitude_m: float = math.nan  # of the target, half the peak-to-peak
    run: str = ""  # name of the run's folder


@dataclass(frozen=True)
class RampTransitions:
    """Transition in a trial with a rising frequency, by a centred and by a trailing window. Paper Fig. 10."""

    transition_centred_hz: float = math.nan  # nan without a transition
    crossings_centred: float = math.nan  # number of sign changes
    transition_trailing_hz: float = math.nan
    crossings_trailing: float = math.nan


@dataclass(frozen=True)
class MotionIndices:
    """Indices of one cycle of a periodic motion of the linear stander, defined as in `Result`; nan where undefined."""

    mode: str = "undefined"
    hip_ankle_r: float = math.nan
    phase_mean_deg: float = math.nan  # at the target's frequency
    target_head_r: float = math.nan
    head_amplitude_m: float = math.nan
    head_speed_mps: float = math.nan
    energy_j: float = math.nan  # over the duration of a trial
    cost: float = math.nan
    hip_range_deg: float = math.nan
    ankle_range_deg: float = math.nan
    hip_torque_range_nm: float = math.nan
    ankle_torque_range_nm: float = math.nan
    hip_torque_max_nm: float = math.nan  # largest absolute value, one joint
    ankle_torque_max_nm: float = math.nan
    cop_min_m: float = math.nan  # in the foot frame, forward positive
    cop_max_m: float = math.nan


@dataclass(frozen=True)
class LeastCost(MotionIndices):
    """The motion of least cost under the same conditions (`posture.theory.optimum.bound`); nan where there is none."""

    reward_energy: float = math.nan  # mean R_energy of a control step, as the reward is configured. Paper Eq. 9
    reward_torque: float = math.nan  # mean R_torque of a control step. Paper Eq. 10
    exact_cost: float = math.nan  # least cost by the equations without small angles (`posture.theory.nonlinear`)
    # The end of the foot that the centre of pressure reaches: none, heel, toe or both; a dash where there is no motion.
    cop_binds: str = field(default="-", metadata={"column": "cop_binds"})


@dataclass(frozen=True)
class RewardOptimum:
    """The optimum of the reward that was trained (`posture.theory.reward_optimum`); nan where it prefers no motion."""

    hip_ankle_r: float = math.nan
    cost: float = math.nan
    energy_j: float = math.nan


NO_ORIGIN, NO_RAMP, NO_LEAST, NO_REWARD = Origin(), RampTransitions(), LeastCost(), RewardOptimum()
"""Values of the groups of a row that does not have them."""


@dataclass(frozen=True, kw_only=True)
class Result:
    """One world of one trial. "Whole" marks the indices over the whole trial; the others leave out its transient.

    Signs: hip flexion is negative and the ankle is negative when the body leans forward, so a positive hip-ankle correlation
    is in-phase. Ranges are peak-to-peak, of the mean of left and right.
    """

    origin: Origin = columns_of("", NO_ORIGIN)

    freq_hz: float  # of the target; nan where it is a ramp
    hip_k_nm_per_rad: float  # passive stiffness of one joint
    ankle_k_nm_per_rad: float
    load_kg: float
    valid: bool  # neither a fall nor a value that is not finite; otherwise every index is nan
    fell: bool
    fall_time_s: float = math.nan

    mode: str = "undefined"  # in-phase, anti-phase or undefined: the sign of hip_ankle_r
    cycles: float = math.nan  # number of whole target cycles after the transient
    hip_ankle_r: float = math.nan  # Pearson, whole; positive in-phase. Paper Fig. 10
    relative_phase_paper_rad: float = math.nan  # 0 .. pi/2, by the maxima. Paper, relative phase
    relative_phase_deg: float = math.nan  # 0 .. 180, the same in the usual definition
    phase_mean_deg: float = math.nan  # -180 .. 180, hip - ankle, circular mean over cycles. Field practice
    phase_sd_deg: float = math.nan  # its circular standard deviation. Field practice
    target_head_r: float = math.nan  # Pearson, whole. Paper Table 3
    head_amplitude_m: float = math.nan  # half the peak-to-peak, mean over cycles. Paper Table 3
    head_speed_mps: float = math.nan  # mean absolute head velocity, whole. Paper Table 3
    tracking_error_mean_mm: float = math.nan  # mean |head - target|
    tracking_error_rms_mm: float = math.nan
    beyond_tolerance_share: float = math.nan  # of time, 0 .. 1
    energy_j: float = math.nan  # whole. Paper Eq. 9
    cost: float = math.nan  # mean sum of squared normalised torques. Paper Eq. 10, normalised
    hip_range_deg: float = math.nan
    ankle_range_deg: float = math.nan
    hip_torque_range_nm: float = math.nan
    ankle_torque_range_nm: float = math.nan
    cop_p05_m: float = math.nan  # percentiles of the centre of pressure in the foot frame, forward positive,
    cop_p25_m: float = math.nan  # over the time in which a foot carries load
    cop_p50_m: float = math.nan
    cop_p75_m: float = math.nan
    cop_p95_m: float = math.nan
    foot_not_flat_share: float = math.nan  # of time, 0 .. 1, with a heel or a toe off the ground
    foot_displacement_max_m: float = math.nan  # whole
    cost_ratio: float = math.nan  # cost over least.cost; nan without theory. See `posture.evaluation.trial.with_theory`

    ramp: RampTransitions = columns_of("", NO_RAMP)
    least: LeastCost = columns_of("least_", NO_LEAST)
    reward: RewardOptimum = columns_of("reward_", NO_REWARD)

    @property
    def outcome(self) -> str:
        """The mode; of a world that is not valid, why."""
        if self.fell:
            return f"fell at {self.fall_time_s:.1f} s"
        return self.mode if self.valid else "not finite"


Value = Callable[[Result], float]
"""Reads a number from a result: one column, or a function of several."""


def as_row(record: Any) -> Row:
    """A `Result`, or another dataclass with such fields, as a flat row; groups that it does not have are left out."""
    row: Row = {}
    for column in fields(record):
        value = getattr(record, column.name)
        if "prefix" not in column.metadata:
            row[column.name] = value
        elif value is not column.default:
            row |= {_name(column, part): getattr(value, part.name) for part in fields(value)}
    return row


def write_csv(results: Sequence[Result], path: str | Path) -> None:
    """Write results as CSV with the columns of every group that one of them has. See `write_rows`."""
    rows = [as_row(result) for result in results]
    present = set().union(*rows)
    defaults = {name: part.default for name, (_, part) in _COLUMNS.items() if name in present}
    write_rows([{name: row.get(name, default) for name, default in defaults.items()} for row in rows], path)


def write_rows(rows: Sequence[Row], path: str | Path) -> None:
    """Write rows with the same columns as CSV, floats to six digits; atomic. ValueError if there are none."""
    if not rows:
        raise ValueError(f"no rows to write to {path}")
    with replacing(Path(path)) as temporary, temporary.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, fieldnames=list(rows[0]), lineterminator="\n")
        writer.writeheader()
        for row in rows:
            writer.writerow({name: f"{value:.6g}" if isinstance(value, float) else value for name, value in row.items()})


def read_csv(path: str | Path) -> list[Result]:
    """Read what `write_csv` wrote. A missing column has its default. Raises ValueError, which names the file, for a column
    that is unknown or required, and for a file that is damaged or has no rows."""
    try:
        text = Path(path).read_bytes().decode()
    except UnicodeDecodeError:
        raise ValueError(f"{path}: is damaged: not a text in UTF-8") from None
    reader = csv.DictReader(io.StringIO(text, newline=""))
    names = reader.fieldnames or []
    if unknown := [name for name in names if name not in _COLUMNS]:
        raise ValueError(f"{path}: unknown columns {', '.join(unknown)}")
    if missing := [name for name, (_, part) in _COLUMNS.items() if part.default is MISSING and name not in names]:
        raise ValueError(f"{path}: missing columns {', '.join(missing)}")
    try:
        results = [_result(row) for row in reader]
    except (TypeError, KeyError, ValueError, csv.Error):  # too few values, too many, or one of another kind
        raise ValueError(f"{path}: line {reader.line_num} is damaged") from None
    if not results or not text.endswith("\n"):
        raise ValueError(f"{path}: is damaged: it {'was cut short' if results else 'has no rows'}")
    return results


def _result(row: Mapping[str, str]) -> Result:
    values: dict[str, Any] = {}
    groups: dict[Field[Any], dict[str, Any]] = {}
    for name, text in row.items():
        group, part = _COLUMNS[name]
        (values if group is None else groups.setdefault(group, {}))[part.name] = _READ[str(part.type)](text)
    return Result(**values, **{group.name: _type_of(group)(**parts) for group, parts in groups.items()})


def _type_of(group: Field[Any]) -> Any:
    return type(group.default)


def _name(group: Field[Any], part: Field[Any]) -> str:
    """Column name of the field `part` of a group."""
    return str(part.metadata.get("column", group.metadata["prefix"] + part.name))


_READ: dict[str, Callable[[str], Any]] = {
    "float": float,
    "int": int,
    "str": str,
    "bool": {"True": True, "False": False}.__getitem__,
}
_COLUMNS: dict[str, tuple[Field[Any] | None, Field[Any]]] = {
    name: entry
    for column in fields(Result)
    for name, entry in (
        {_name(column, part): (column, part) for part in fields(_type_of(column))}
        if "prefix" in column.metadata
        else {column.name: (None, column)}
    ).items()
}
"""Every column of `Result`, in order: the group that it is in, and its field."""
