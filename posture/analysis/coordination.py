"""Coordination, tracking, effort and balance indices of a trial: pure functions, arrays in, numbers out.

Signs: hip flexion is negative and the ankle is negative when the body leans forward, so a positive
hip-ankle correlation is in-phase (the trunk flexes as the body leans forward). Clinical signs would flip it.

The paper's own indices (correlations, head speed, energy) use the whole trial, as the paper does. All others
leave out the first `transient_s` seconds. An index that cannot be computed is nan.
"""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.stats import circmean, circstd

from envs.body.joints import ANKLES, HIPS
from posture.analysis.results import Result
from posture.analysis.trajectory import Array, Trajectory

COP_PERCENTILES = (5, 25, 50, 75, 95)


def correlation(a: Array, b: Array) -> float:
    """Pearson correlation [-] of two signals (T,); nan where one is constant. Source: paper Table 3."""
    if np.ptp(a) == 0 or np.ptp(b) == 0:
        return math.nan
    return float(np.corrcoef(a, b)[0, 1])


def mode(hip_ankle_r: float) -> str:
    """Postural mode by the sign of the hip-ankle correlation; "undefined" for nan and 0. Source: paper."""
    if hip_ankle_r > 0:
        return "in-phase"
    return "anti-phase" if hip_ankle_r < 0 else "undefined"


def cycles(time: Array, freq: float, transient_s: float) -> list[slice]:
    """Sample ranges of the whole target cycles after the transient; an incomplete last cycle is dropped.

    `time` (T,) evenly spaced [s]; `freq` [Hz]. They start at `transient_s`, not at a cycle of the target, so
    that as many as possible fit. Edges are rounded to the nearest sample. Empty where `freq` is nan (ramp).
    """
    if not freq > 0:
        return []
    dt = (time[-1] - time[0]) / (len(time) - 1)
    start = max(transient_s, float(time[0]))
    # Each sample represents one step; half a step of slack keeps a last cycle that ends on the trial's end.
    count = math.floor((time[-1] + 1.5 * dt - start) * freq)
    edges = np.searchsorted(time, start + np.arange(count + 1) / freq - dt / 2)
    return [slice(int(i), int(j)) for i, j in pairwise(edges)]


def relative_phase_paper(hip: Array, ankle: Array, time: Array, freq: float, parts: list[slice]) -> float:
    """Relative phase of the paper, |t0 - t1| f pi [rad], 0 (in-phase) .. pi/2 (anti-phase), mean over cycles.

    t0 and t1 are the times of the ankle's and the hip's maximum in one cycle (`parts`, from `cycles`). It is
    half the usual phase difference. The paper does not say what happens when the two maxima straddle an edge
    of the cycle; here the shorter distance around the cycle counts, so it never exceeds half a period. Its
    resolution is one sample. Signals (T,), freq [Hz]; nan without a cycle. Source: paper, relative phase.
    """
    if not parts:
        return math.nan
    half = 0.5 / freq
    apart = [time[p][np.argmax(ankle[p])] - time[p][np.argmax(hip[p])] for p in parts]
    return float(np.mean([abs((d + half) % (2 * half) - half) for d in apart])) * freq * math.pi


def cycle_components(signal: Array, time: Array, freq: float, parts: list[slice]) -> NDArray[np.complex128]:
    """Complex amplitude c of each cycle: signal = offset + Re(c exp(2 pi i f t)). Shape (cycles,).

    Signal (T,) in any unit, which c shares; time (T,) [s], freq [Hz]. Fitted by least squares: the Fourier
    component at f, but exact also where a cycle is not a whole number of samples. Source: field practice.
    """
    angle = 2 * math.pi * freq * time
    basis = np.stack([np.ones_like(time), np.cos(angle), np.sin(angle)], axis=1)
    fits = [np.linalg.lstsq(basis[p], signal[p], rcond=None)[0] for p in parts]
    return np.array([complex(cos, -sin) for _, cos, sin in fits], dtype=np.complex128)


def cycle_phases(hip: Array, ankle: Array, time: Array, freq: float, parts: list[slice], still: float) -> Array:
    """Phase difference hip - ankle of each cycle [deg] in -180 .. 180, positive where the hip leads.

    Shape (cycles,). nan in a cycle where the component at f of either joint has a peak-to-peak below `still`
    (unit of the angles): the phase of a joint that hardly moves is noise. Source: field practice.
    """
    a, b = (cycle_components(signal, time, freq, parts) for signal in (hip, ankle))
    moving = np.minimum(abs(a), abs(b)) * 2 >= still
    return np.where(moving, np.degrees(np.angle(a * b.conj())), math.nan)


def circular_mean_sd(angles_deg: Array) -> tuple[float, float]:
    """Circular mean in -180 .. 180 and circular standard deviation sqrt(-2 ln R) [deg] of angles (N,) [deg].

    nan entries are left out; the mean of none and the deviation of fewer than two are nan. Source: field
    practice (Mardia and Jupp, Directional Statistics).
    """
    known = angles_deg[np.isfinite(angles_deg)]
    if not len(known):
        return math.nan, math.nan
    span = {"low": -180.0, "high": 180.0}
    return float(circmean(known, **span)), float(circstd(known, **span)) if len(known) > 1 else math.nan


def cycle_amplitude(signal: Array, parts: list[slice]) -> float:
    """Half the peak-to-peak value of each cycle, mean over cycles; nan without a cycle.

    Signal (T,) in any unit, which the result shares. Computed for each cycle, so that one excursion or a
    slow drift affects one cycle and not the whole trial. Source: paper Table 3, whose amplitude is half
    the peak-to-peak value.
    """
    return float(np.mean([np.ptp(signal[p]) for p in parts])) / 2 if parts else math.nan


def energy(joint_torque: Array, joint_velocity: Array, dt: float) -> float:
    """Energy cost [J]: sum over joints and time of |tau omega| dt. Source: paper Eq. 9.

    Actuator torque [Nm] and joint velocity [rad/s], both (T, J); dt [s]. Negative power counts as positive.
    """
    return float(np.abs(joint_torque * joint_velocity).sum() * dt)


def torque_cost(joint_torque: Array, torque_limit: float) -> float:
    """Cost [-]: mean over time of the sum over joints of (tau / limit)^2. Source: paper Eq. 10, normalised.

    Actuator torque (T, J) and its limit [Nm].
    """
    return float(np.mean(np.sum((joint_torque / torque_limit) ** 2, axis=1)))


def cop_percentiles(cop_x: Array) -> Array:
    """COP_PERCENTILES of the centre of pressure (T,) [m], forward positive; nan (no load) left out."""
    loaded = cop_x[np.isfinite(cop_x)]
    return np.percentile(loaded, COP_PERCENTILES) if len(loaded) else np.full(len(COP_PERCENTILES), math.nan)


def sign_change_frequency(freq: ArrayLike, correlation: ArrayLike) -> float | None:
    """Frequency [Hz] of the first sign change of the correlation along rising frequency; None without one.

    Arrays (N,) in any order; linear between neighbours. A nan (a fall, an undefined mode) is left out, which
    widens the bracket it falls in. A change in either direction counts. Source: paper Fig. 10.
    """
    f, r = np.asarray(freq, dtype=np.float64), np.asarray(correlation, dtype=np.float64)
    if f.shape != r.shape or f.ndim != 1:
        raise ValueError(f"freq has shape {f.shape}, correlation {r.shape}: both must be (N,)")
    known = np.isfinite(f) & np.isfinite(r)
    order = np.argsort(f[known], kind="stable")
    f, r = f[known][order], r[known][order]
    for i, j in pairwise(np.flatnonzero(r)):
        if (r[i] > 0) != (r[j] > 0):
            return float(f[i + 1] if j > i + 1 else f[i] - r[i] * (f[j] - f[i]) / (r[j] - r[i]))
    return None


def measure_trajectory(
    trajectory: Trajectory, *, transient_s: float, tolerance_m: ArrayLike, still_joint_deg: float
) -> list[Result]:
    """The results of a trial, one for each world.

    `transient_s` [s] is left out at the start (`Result` says of which indices). `tolerance_m` [m], of all worlds or (W,), is
    the head-target distance beyond which tracking counts as lost. The coordination of a joint whose peak-to-peak angle after
    the transient is below `still_joint_deg` [deg] is undefined.

    A world that fell, or whose signals are not finite, is not valid and has every index nan, so that no average includes it.
    Raises ValueError where the transient leaves nothing of the trial.
    """
    if np.count_nonzero(trajectory.time >= transient_s) < 2:
        end = trajectory.time[-1]
        raise ValueError(f"transient_s is {transient_s:g} s, but the trial ends at {end:g} s")
    tolerances = np.broadcast_to(np.asarray(tolerance_m, dtype=np.float64), trajectory.freq.shape)
    results = []
    for w, fall_step in enumerate(trajectory.fall_step):
        fell = bool(fall_step >= 0)
        result = Result(
            freq_hz=float(trajectory.freq[w]),
            hip_k_nm_per_rad=float(trajectory.hip_k[w]),
            ankle_k_nm_per_rad=float(trajectory.ankle_k[w]),
            load_kg=float(trajectory.load[w]),
            valid=not fell and _finite(trajectory, w),
            fell=fell,
            fall_time_s=float(trajectory.time[fall_step]) if fell else math.nan,
        )
        if result.valid:
            result = _measure_world(trajectory, w, transient_s, float(tolerances[w]), still_joint_deg, result)
        results.append(result)
    return results


def _finite(trajectory: Trajectory, w: int) -> bool:
    """Whether all signals of world `w` are finite; the centre of pressure may be nan, where no foot carries load."""
    names = ("target_x", "head_x", "head_vx", "joint_angle", "joint_velocity", "joint_torque", "torso_height")
    return all(bool(np.isfinite(getattr(trajectory, name)[:, w]).all()) for name in names)


def _measure_world(
    trajectory: Trajectory, w: int, transient_s: float, tolerance_m: float, still_joint_deg: float, result: Result
) -> Result:
    """`result` with all indices of world `w`, which must be valid."""
    time, freq = trajectory.time, result.freq_hz
    after = time >= transient_s
    parts = cycles(time, freq, transient_s)
    hip, ankle = trajectory.hip[:, w], trajectory.ankle[:, w]
    head, target = trajectory.head_x[:, w], trajectory.target_x[:, w]
    torque, velocity = trajectory.joint_torque[:, w], trajectory.joint_velocity[:, w]
    error = np.abs(head - target)[after]
    hip_range, ankle_range = (float(np.degrees(np.ptp(angle[after]))) for angle in (hip, ankle))
    moving = min(hip_range, ankle_range) >= still_joint_deg
    r = correlation(hip, ankle) if moving else math.nan
    phase = relative_phase_paper(hip, ankle, time, freq, parts) if moving else math.nan
    phase_mean, phase_sd = circular_mean_sd(cycle_phases(hip, ankle, time, freq, parts, math.radians(still_joint_deg)))
    p05, p25, p50, p75, p95 = map(float, cop_percentiles(trajectory.cop_x[after, w]))
    return replace(
        result,
        mode=mode(r),
        cycles=len(parts),
        hip_ankle_r=r,
        relative_phase_paper_rad=phase,
        relative_phase_deg=math.degrees(2 * phase),
        phase_mean_deg=phase_mean,
        phase_sd_deg=phase_sd,
        target_head_r=correlation(target, head),
        head_amplitude_m=cycle_amplitude(head, parts),
        head_speed_mps=float(np.abs(trajectory.head_vx[:, w]).mean()),
        tracking_error_mean_mm=1e3 * float(error.mean()),
        tracking_error_rms_mm=1e3 * math.sqrt(float(np.mean(error**2))),
        beyond_tolerance_share=float(np.mean(error > tolerance_m)),
        energy_j=energy(torque, velocity, trajectory.control_dt),
        cost=torque_cost(torque[after], trajectory.torque_limit),
        hip_range_deg=hip_range,
        ankle_range_deg=ankle_range,
        hip_torque_range_nm=float(np.ptp(torque[after, HIPS].mean(axis=1))),
        ankle_torque_range_nm=float(np.ptp(torque[after, ANKLES].mean(axis=1))),
        cop_p05_m=p05,
        cop_p25_m=p25,
        cop_p50_m=p50,
        cop_p75_m=p75,
        cop_p95_m=p95,
        foot_not_flat_share=float(np.mean(~trajectory.foot_flat[after, w])),
        foot_displacement_max_m=float(trajectory.foot_displacement[:, w].max()),
    )
