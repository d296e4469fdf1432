"""The tables of an analysis: one line for each recording, and one for each subject or all at each frequency."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

from posture.analysis.table import Column
from posture.config.analyse import AnalyseConfig
from posture.recording.group import GroupRow
from posture.recording.trial import NO_MOTION, SHARE_OF_A_SINUSOID, Trial


def recording_columns(trials: Sequence[Trial]) -> list[Column[Trial]]:
    """The columns of the recordings; those of head, target, ramp and theory where a recording has them."""
    ramps = [trial for trial in trials if trial.freq_from == "ramp"]
    columns: list[Column[Trial]] = [Column("recording", lambda one: one.path.name)]
    if any(trial.subject != trial.path.stem for trial in trials):
        columns.append(Column("subject", lambda one: one.subject))
    if len(ramps) < len(trials):
        columns += [
            Column("f [Hz]", lambda one: one.indices.freq_hz, ".3f"),
            Column("from", lambda one: one.freq_from),
            Column("mode", lambda one: one.indices.mode),
            Column("hip-ankle r", lambda one: one.indices.hip_ankle_r, ".3f"),
            Column("cycles' r 95%", _interval("hip_ankle_r", "z.2f")),
            Column("cycles", lambda one: one.indices.cycles, ".0f"),
            Column("phase [deg]", lambda one: one.indices.phase_mean_deg, "z.0f"),
            Column("95% [deg]", lambda one: _ends(one.indices.phase_low_deg, one.indices.phase_high_deg, "z.0f")),
            Column("sd [deg]", lambda one: one.indices.phase_sd_deg, "z.0f"),
            Column("Hilbert [deg]", lambda one: one.indices.hilbert_mean_deg, "z.0f"),
        ]
    if ramps:
        columns += [
            Column("centred f* [Hz]", lambda one: one.indices.ramp.transition_centred_hz, ".3f"),
            Column("trailing f* [Hz]", lambda one: one.indices.ramp.transition_trailing_hz, ".3f"),
            Column("change point [Hz]", lambda one: one.indices.change.change_point_hz, ".3f"),
        ]
    for column in (
        Column[Trial]("head [m]", lambda one: one.indices.head_amplitude_m, ".4f"),
        Column[Trial]("target-head r", lambda one: one.indices.target_head_r, ".4f"),
        Column[Trial]("error [mm]", lambda one: one.indices.tracking_error_mean_mm, ".1f"),
    ):
        if any(not math.isnan(float(column.get(trial))) for trial in trials):
            columns.append(column)
    if any(trial.least is not NO_MOTION for trial in trials):
        columns += [
            Column("least's r", lambda one: one.least.hip_ankle_r, ".3f"),
            Column("least's phase [deg]", lambda one: one.least.phase_mean_deg, "z.0f"),
        ]
    return columns


def _interval(name: str, spec: str) -> Callable[[Trial], str]:
    def text(trial: Trial) -> str:
        found = trial.cycles.intervals().get(name)
        return "-" if found is None else _ends(found.low, found.high, spec)

    return text


def _ends(low: float, high: float, spec: str) -> str:
    return "-" if math.isnan(low) else f"{low:{spec}} .. {high:{spec}}"


def group_columns(rows: Sequence[GroupRow]) -> list[Column[GroupRow]]:
    """The columns of a group's table; those of transitions where there are ramps, those of phases where there are others."""
    columns: list[Column[GroupRow]] = [
        Column("f [Hz]", lambda row: "ramp" if math.isnan(row.freq_hz) else row.freq_hz, ".3f"),
        Column("subject", lambda row: row.subject),
        Column("subjects", lambda row: row.subjects, ".0f"),
        Column("recordings", lambda row: row.recordings, ".0f"),
    ]
    if any(not math.isnan(row.freq_hz) for row in rows):
        columns += [
            Column("phase [deg]", lambda row: row.phase_mean_deg, "z.0f"),
            Column("95% [deg]", lambda row: _ends(row.phase_low_deg, row.phase_high_deg, "z.0f")),
            Column("sd [deg]", lambda row: row.phase_sd_deg, "z.0f"),
            Column("R", lambda row: row.phase_resultant, ".3f"),
            Column("Rayleigh p", lambda row: row.rayleigh_p, ".2g"),
        ]
    columns += [
        Column("hip-ankle r", lambda row: row.r_mean, ".3f"),
        Column("r 95%", lambda row: _ends(row.r_low, row.r_high, "z.2f")),
    ]
    if any(math.isnan(row.freq_hz) for row in rows):
        columns += [
            Column("centred f* [Hz]", lambda row: row.transition_mean_hz, ".3f"),
            Column("95% [Hz]", lambda row: _ends(row.transition_low_hz, row.transition_high_hz, ".3f")),
        ]
    return columns


def notes(trials: Sequence[Trial], config: AnalyseConfig) -> list[str]:
    """What a reader of the tables should know, a line for each remark."""
    lines = []
    for trial in trials:
        one, name = trial.indices, trial.path.name
        if trial.explained < SHARE_OF_A_SINUSOID and trial.freq_from == "freq":
            lines.append(
                f"{name}: a sinusoid of freq={one.freq_hz:.3g} Hz explains {100 * trial.explained:.0f} % of the variance of "
                "the target, or of what else was recorded"
            )
        elif trial.explained < SHARE_OF_A_SINUSOID:
            lines.append(
                f"{name}: a sinusoid of {one.freq_hz:.3g} Hz explains {100 * trial.explained:.0f} % of the variance of the "
                f"{trial.freq_from}; freq= gives the frequency, ramp=estimate is for one that changes"
            )
        whole, cycle = one.hip_ankle_r, trial.cycles.intervals().get("hip_ankle_r")
        if cycle is not None and whole * cycle.mean < 0 and not cycle.low <= 0 <= cycle.high:
            lines.append(
                f"{name}: r, whose sign is the mode, is {whole:.2f} over the whole trial, but {cycle.mean:.2f} in its "
                "cycles, as where angles drift; detrend=true or high_pass= takes drift away"
            )
        if one.cycles_left_out:
            lines.append(f"{name}: {one.cycles_left_out} of {one.cycles + one.cycles_left_out} cycles left out for gaps")
        if trial.freq_from != "ramp" and not one.cycles:
            lines.append(f"{name}: no whole cycle of {one.freq_hz:.3g} Hz without a gap after the transient")
        if min(one.hip_range_deg, one.ankle_range_deg) < config.evaluation.still_joint_deg:
            lines.append(
                f"{name}: hip and ankle move by {one.hip_range_deg:.2g} and {one.ankle_range_deg:.2g} deg, one of them by "
                "less than evaluation.still_joint_deg; if that is wrong, angle_unit= sets the unit"
            )
        if config.predicts and trial.least is NO_MOTION and trial.freq_from != "ramp":
            lines.append(f"{name}: the limits of foot and torque allow the body in env no such motion")
    return lines
