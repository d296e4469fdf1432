"""The indices of one recording: those of `posture.analysis.coordination`, with intervals over cycles, and the relative
phase by the Hilbert transform. Arrays in, numbers out.

Signs are those of the simulated body: hip flexion and dorsiflexion are negative, x points forward, so a positive
correlation is in-phase. Indices with the names of `posture.analysis.results.Result` are defined as there. A recording may
have gaps: those over the whole trial leave them out, and a cycle counts only where it has none.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.signal import hilbert

from envs.body.joints import ANKLES, HIPS, JOINTS
from posture.analysis.coordination import (
    circular_mean_sd,
    cop_percentiles,
    correlation,
    cycle_amplitude,
    cycle_phases,
    cycles,
    energy,
    mode,
    relative_phase_paper,
    torque_cost,
)
from posture.analysis.results import RampTransitions, columns_of
from posture.analysis.statistics import Interval, mean_interval
from posture.analysis.trajectory import Array
from posture.recording.circular import mean_half_width, resultant_length
from posture.recording.columns import Recording
from posture.recording.signals import filtered, stretches

SAMPLES_A_CYCLE = 6
"""With fewer a recording does not show a motion at its frequency."""
CLOSEST = 1 - 1e-9
"""Largest correlation that enters Fisher's transformation, which takes 1 to infinity."""
CYCLES_OF_A_STRETCH = 3
"""Shortest stretch between gaps that has a Hilbert phase: at each of its ends one cycle is left out."""


CYCLE_VALUES = (
    "hip_ankle_r",
    "relative_phase_deg",
    "hip_range_deg",
    "ankle_range_deg",
    "head_amplitude_m",
    "head_speed_mps",
    "target_head_r",
    "tracking_error_mean_mm",
)
"""Values of a cycle that have a mean over cycles and an interval, by their names in `Indices`; the phase is beside them."""


@dataclass(frozen=True)
class ChangePoint:
    """Where the relative phase of a ramp changes, as one step; nan without a change of the mode."""

    change_point_hz: float = math.nan  # momentary frequency of the target
    change_point_s: float = math.nan


NO_RAMP, NO_CHANGE = RampTransitions(), ChangePoint()


@dataclass(frozen=True, kw_only=True)
class Indices:
    """One recording. Indices with the names of `posture.analysis.results.Result` are defined there; "whole" is the whole
    trial, all others leave out its transient."""

    duration_s: float
    rate_hz: float  # of the samples that were analysed
    missing_share: float  # of samples without hip or ankle, after short gaps were filled, 0 .. 1
    freq_hz: float  # of the target; nan in a ramp
    mode: str = "undefined"
    cycles: int = 0  # whole ones without a gap
    cycles_left_out: int = 0  # for a gap
    hip_ankle_r: float = math.nan  # whole
    relative_phase_paper_rad: float = math.nan
    relative_phase_deg: float = math.nan
    phase_mean_deg: float = math.nan  # of the cycles
    phase_sd_deg: float = math.nan
    phase_low_deg: float = math.nan  # 95 % confidence interval of the mean direction; may lie beyond 180 or -180
    phase_high_deg: float = math.nan
    phase_resultant: float = math.nan  # 0 .. 1
    hilbert_mean_deg: float = math.nan  # of the samples, by the Hilbert transform
    hilbert_sd_deg: float = math.nan
    target_head_r: float = math.nan  # whole
    head_amplitude_m: float = math.nan
    head_speed_mps: float = math.nan  # whole
    tracking_error_mean_mm: float = math.nan
    tracking_error_rms_mm: float = math.nan
    beyond_tolerance_share: float = math.nan
    hip_range_deg: float = math.nan
    ankle_range_deg: float = math.nan
    # Of recordings of the simulated body only.
    energy_j: float = math.nan  # whole
    cost: float = math.nan
    hip_torque_range_nm: float = math.nan
    ankle_torque_range_nm: float = math.nan
    cop_p05_m: float = math.nan
    cop_p25_m: float = math.nan
    cop_p50_m: float = math.nan
    cop_p75_m: float = math.nan
    cop_p95_m: float = math.nan
    foot_not_flat_share: float = math.nan
    foot_displacement_max_m: float = math.nan  # whole

    ramp: RampTransitions = columns_of("", NO_RAMP)
    change: ChangePoint = columns_of("", NO_CHANGE)


@dataclass(frozen=True)
class Cycles:
    """Values of each whole cycle without a gap, (cycles,) each: `start` [s], and `values` by the names of `Indices`."""

    start: Array = field(default_factory=lambda: np.empty(0))
    values: Mapping[str, Array] = field(default_factory=dict)

    def intervals(self) -> dict[str, Interval]:
        """The mean over cycles of each value but the phase, whose interval is in `Indices`."""
        return {
            name: (mean_correlation if name.endswith("_r") else mean_interval)(self.values[name])
            for name in CYCLE_VALUES
            if name in self.values
        }


def mean_correlation(r: ArrayLike) -> Interval:
    """Mean of correlations (N,) and its 95 % interval, by Fisher's transformation z = artanh r and `mean_interval`."""
    z = np.arctanh(np.clip(np.asarray(r, dtype=np.float64), -CLOSEST, CLOSEST))
    return Interval(*(float(np.tanh(value)) for value in mean_interval(z)))


def measure(
    recording: Recording,
    freq: float,
    *,
    transient_s: float,
    tolerance_m: float,
    still_joint_deg: float,
    torque_limit: float,
) -> tuple[Indices, Cycles]:
    """The indices of a recording on an even time base (`posture.recording.signals.prepare`), and those of its cycles.

    `freq` [Hz] of the target, nan where it is a ramp. `transient_s` [s] is left out at the start, as `posture.eval` does.
    `tolerance_m` [m]: distance of the head beyond which tracking counts as lost. A joint whose peak-to-peak angle is below
    `still_joint_deg` [deg] has no coordination. `torque_limit` [Nm] normalises torques. Raises ValueError where the
    transient leaves nothing, or the sampling rate is too low for the frequency.
    """
    time, hip, ankle = recording.time, recording.hip, recording.ankle
    dt = float((time[-1] - time[0]) / (len(time) - 1))
    after = time >= transient_s
    known = np.isfinite(hip) & np.isfinite(ankle)
    if np.count_nonzero(after & known) < 2:
        raise ValueError(f"evaluation.transient: {transient_s:g} s leaves nothing of a trial that ends at {time[-1]:.4g} s")
    if freq * dt * SAMPLES_A_CYCLE > 1 + 1e-9:
        raise ValueError(f"has fewer than {SAMPLES_A_CYCLE} samples in a cycle at {freq:g} Hz")
    still = math.radians(still_joint_deg)
    whole = cycles(time, freq, transient_s)
    parts = [part for part in whole if known[part].all()]
    hip_range, ankle_range = (float(np.degrees(np.ptp(angle[after & known]))) for angle in (hip, ankle))
    moving = min(hip_range, ankle_range) >= still_joint_deg
    r = correlation(hip[known], ankle[known]) if moving else math.nan
    paper = relative_phase_paper(hip, ankle, time, freq, parts) if moving else math.nan
    phases = cycle_phases(hip, ankle, time, freq, parts, still) if parts else np.empty(0)
    phase_mean, phase_sd = circular_mean_sd(phases)
    half = mean_half_width(phases)
    instants = hilbert_phases(hip, ankle, time, (freq / 2, 2 * freq), 1 / freq, still)[after] if freq > 0 else np.empty(0)
    hilbert_mean, hilbert_sd = circular_mean_sd(instants)
    indices = Indices(
        duration_s=float(time[-1] - time[0]) + dt,
        rate_hz=1 / dt,
        missing_share=1 - float(known.mean()),
        freq_hz=freq,
        mode=mode(r),
        cycles=len(parts),
        cycles_left_out=len(whole) - len(parts),
        hip_ankle_r=r,
        relative_phase_paper_rad=paper,
        relative_phase_deg=math.degrees(2 * paper),
        phase_mean_deg=phase_mean,
        phase_sd_deg=phase_sd,
        phase_low_deg=phase_mean - half,
        phase_high_deg=phase_mean + half,
        phase_resultant=resultant_length(phases),
        hilbert_mean_deg=hilbert_mean,
        hilbert_sd_deg=hilbert_sd,
        hip_range_deg=hip_range,
        ankle_range_deg=ankle_range,
        **_of_the_head(recording, parts, after, dt, tolerance_m),
        **_of_the_simulation(recording, after, dt, torque_limit),
    )
    return indices, _cycles(recording, freq, parts, phases, still, dt)


def _of_the_head(
    recording: Recording, parts: list[slice], after: np.ndarray, dt: float, tolerance_m: float
) -> dict[str, Any]:
    """The indices of head and target, as far as they were recorded."""
    head, target = recording.head, recording.target
    if head is None:
        return {}
    velocity = recording.simulated.get("head_vx", speed(head, dt))
    seen = np.isfinite(head)
    own = [part for part in parts if seen[part].all()]
    found: dict[str, Any] = {"head_amplitude_m": cycle_amplitude(head, own), "head_speed_mps": _mean(np.abs(velocity))}
    if target is None:
        return found
    error = np.abs(head - target)[after]
    error = error[np.isfinite(error)]
    both = seen & np.isfinite(target)
    if np.count_nonzero(both) > 1:
        found["target_head_r"] = correlation(target[both], head[both])
    if len(error):
        found["tracking_error_mean_mm"] = 1e3 * float(error.mean())
        found["tracking_error_rms_mm"] = 1e3 * math.sqrt(float(np.mean(error**2)))
        found["beyond_tolerance_share"] = float(np.mean(error > tolerance_m))
    return found


def _of_the_simulation(recording: Recording, after: np.ndarray, dt: float, torque_limit: float) -> dict[str, Any]:
    """The indices of torques and feet, which only a recording of the simulated body has."""
    signals = recording.simulated
    if not signals:
        return {}
    torque, velocity = (
        np.stack([signals[f"{joint}_{kind}"] for joint in JOINTS], axis=1) for kind in ("torque", "velocity")
    )
    cop = cop_percentiles(signals["cop_x"][after])
    percentiles = zip(("p05", "p25", "p50", "p75", "p95"), map(float, cop), strict=True)
    return {
        "energy_j": energy(torque, velocity, dt),
        "cost": torque_cost(torque[after], torque_limit),
        "hip_torque_range_nm": float(np.ptp(torque[after, HIPS].mean(axis=1))),
        "ankle_torque_range_nm": float(np.ptp(torque[after, ANKLES].mean(axis=1))),
        **{f"cop_{name}_m": value for name, value in percentiles},
        "foot_not_flat_share": float(np.mean(signals["foot_flat"][after] < 0.5)),
        "foot_displacement_max_m": float(signals["foot_displacement"].max()),
    }


def _cycles(recording: Recording, freq: float, parts: list[slice], phases: Array, still: float, dt: float) -> Cycles:
    """The values of each cycle."""
    if not parts:
        return Cycles()
    time, hip, ankle = recording.time, recording.hip, recording.ankle

    def each(value: Callable[[slice], float]) -> Array:
        return np.array([value(part) for part in parts])

    def moving(value: Callable[[slice], float]) -> Array:
        """`value` of each cycle in which both joints move, of the others nan."""
        return each(lambda part: value(part) if min(np.ptp(hip[part]), np.ptp(ankle[part])) >= still else math.nan)

    values = {
        "hip_ankle_r": moving(lambda part: correlation(hip[part], ankle[part])),
        "phase_deg": phases,
        "relative_phase_deg": moving(lambda part: math.degrees(2 * relative_phase_paper(hip, ankle, time, freq, [part]))),
        "hip_range_deg": each(lambda part: math.degrees(np.ptp(hip[part]))),
        "ankle_range_deg": each(lambda part: math.degrees(np.ptp(ankle[part]))),
    }
    if (head := recording.head) is not None:
        velocity = np.abs(recording.simulated.get("head_vx", speed(head, dt)))
        values["head_amplitude_m"] = each(lambda part: float(np.ptp(head[part])) / 2)
        values["head_speed_mps"] = each(lambda part: _mean(velocity[part]))
        if (target := recording.target) is not None:
            values["target_head_r"] = each(lambda part: correlation(target[part], head[part]))
            values["tracking_error_mean_mm"] = each(lambda part: 1e3 * _mean(np.abs(head[part] - target[part])))
    return Cycles(np.array([time[part.start] for part in parts]), values)


def speed(signal: Array, dt: float) -> Array:
    """Rate of change of `signal` (T,), by central differences over two steps of `dt` [s]; nan beside a gap."""
    return np.asarray(np.gradient(signal, dt))


def _mean(values: Array) -> float:
    """Mean of those that are not nan; nan if there are none."""
    known = values[np.isfinite(values)]
    return float(known.mean()) if len(known) else math.nan


def hilbert_phases(hip: Array, ankle: Array, time: Array, band: tuple[float, float], edge_s: float, still: float) -> Array:
    """Phase of the hip less that of the ankle at each sample [deg], -180 .. 180, by the Hilbert transform. (T,).

    Angles (T,) [rad] at `time` (T,), evenly spaced [s]. Each stretch between gaps is band-pass filtered to `band` [Hz]; its
    first and last `edge_s` [s], where the transform is not reliable, are nan, and so is a stretch shorter than three times
    that. nan, too, where twice the momentary amplitude of either joint is below `still` [rad]. Source: field practice.
    """
    rate = (len(time) - 1) / (time[-1] - time[0])
    low, high = band[0], min(band[1], 0.45 * rate)
    difference = np.full(len(time), math.nan)
    edge = math.ceil(edge_s * rate)
    if not 0 < low < high:
        return difference
    for run in stretches(np.isfinite(hip) & np.isfinite(ankle)):
        if run.stop - run.start < max(CYCLES_OF_A_STRETCH * edge, 15):
            continue
        # A stretch that is mirrored at its ends is disturbed least there: of sinusoids by 6 deg at most behind the edge.
        mirrored = min(2 * edge, run.stop - run.start - 1)
        inside = slice(mirrored, mirrored + run.stop - run.start)
        a, b = (
            hilbert(filtered(np.pad(signal[run], mirrored, "reflect"), rate, (low, high), "bandpass"))[inside]
            for signal in (hip, ankle)
        )
        moving = np.minimum(np.abs(a), np.abs(b)) * 2 >= still
        found = np.where(moving, np.degrees(np.angle(a * b.conj())), math.nan)
        found[:edge] = found[-edge:] = math.nan
        difference[run] = found
    return difference
