"""Made-up results with known answers: what the paper reports, as if trainings had given it, and trajectories to draw."""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from posture.analysis.results import NO_LEAST, NO_RAMP, LeastCost, Origin, RampTransitions, Result
from posture.analysis.trajectory import Trajectory
from posture.cli.jobs import check
from posture.config.published import read_published
from posture.config.reproduce import ReportConfig
from posture.config.train import TrainConfig
from posture.reproduce.claims.stiffness import map_grid
from posture.reproduce.claims.verdict import Transitions
from posture.reproduce.experiments import EVALUATIONS, TRAININGS
from posture.reproduce.reproduction import Body, Reproduction, Traces, Training

CONF = Path(__file__).parents[3] / "conf"
PAPER = read_published()
REPORT = ReportConfig.model_validate(yaml.safe_load((CONF / "report.yaml").read_text(encoding="utf-8")))
TEN = PAPER.table_3.freq_hz
FREQS = sorted({*TEN, 0.625, 0.65, 0.675, 0.7, 0.725})
TRANSITIONS = Transitions(least=0.656, reward=0.672, sinusoid=0.68)
DT = 1 / 60


def result(
    r: float = 0.5,
    seed: int = 1,
    *,
    energy_weight: float = 20.0,
    amplitude_m: float = 0.1,
    physics: str = "sagittal",
    least: LeastCost = NO_LEAST,
    ramp: RampTransitions = NO_RAMP,
    **columns: Any,
) -> Result:
    """A valid trial with the hip-ankle correlation `r`; `columns` are fields of `Result`."""
    phase = math.degrees(math.acos(r)) if math.isfinite(r) else math.nan
    defaults = {"freq_hz": 0.4, "hip_k_nm_per_rad": 125.0, "ankle_k_nm_per_rad": 25.0, "load_kg": 0.0}
    defaults |= {"hip_ankle_r": r, "relative_phase_deg": phase, "mode": "in-phase" if r > 0 else "anti-phase"}
    origin = Origin(seed, energy_weight, physics, amplitude_m, f"seed-{seed}")
    return Result(origin=origin, valid=True, fell=False, least=least, ramp=ramp, **(defaults | columns))


def fallen(trial: Result) -> Result:
    """The same trial with a fall: no measured index, the theory unchanged."""
    condition = {name: getattr(trial, name) for name in ("freq_hz", "hip_k_nm_per_rad", "ankle_k_nm_per_rad", "load_kg")}
    return Result(origin=trial.origin, valid=False, fell=True, least=trial.least, reward=trial.reward, **condition)


def with_r(r: float) -> Callable[[Result], Result]:
    return lambda trial: replace(trial, hip_ankle_r=r, mode="in-phase" if r > 0 else "anti-phase")


def flipped(trial: Result) -> Result:
    return with_r(-trial.hip_ankle_r)(trial)


def changed(
    results: Sequence[Result], change: Callable[[Result], Result], where: Callable[[Result], bool] = lambda _: True
) -> list[Result]:
    """The results with `change` applied `where` it says."""
    return [change(trial) if where(trial) else trial for trial in results]


def frequency_result(hz: float, seed: int = 1, switch_hz: float = 0.69, amplitude_m: float = 0.1) -> Result:
    """Exp. 1 as the paper describes it: r falls through 0 at `switch_hz`, ranges and CoP spread grow, tracking dips."""
    at = int(np.searchsorted(TEN, hz))
    return result(
        float(np.tanh(3 * (switch_hz - hz))),
        seed,
        amplitude_m=amplitude_m,
        freq_hz=hz,
        hip_range_deg=10 + 20 * hz,
        ankle_range_deg=5 + hz,
        hip_torque_range_nm=10 + 20 * hz,
        target_head_r=PAPER.table_3.target_head_r[at],
        head_amplitude_m=PAPER.table_3.head_amplitude_m[at],
        head_speed_mps=PAPER.table_3.head_speed_mps[at],
        cop_p05_m=-0.01 * hz,
        cop_p50_m=0.02,
        cop_p95_m=0.05 + 0.03 * hz,
        cost_ratio=1.04,
        least=LeastCost(
            hip_ankle_r=float(np.tanh(3 * (0.66 - hz))), head_amplitude_m=0.075, head_speed_mps=0.3 * hz, phase_mean_deg=0.0
        ),
    )


def paper_results(seeds: int = 3) -> dict[str, list[Result]]:
    """What the paper reports, by experiment, as if `seeds` trainings had given it."""
    sign = {"in": 0.9, "anti": -0.9}
    table, third = PAPER.table_4, PAPER.experiment_3
    at_one = dict(zip(third.hip_k_nm_per_rad, third.mode, strict=True))
    found: dict[str, list[Result]] = {name: [] for name in (*TRAININGS, *EVALUATIONS)}
    for seed in range(1, seeds + 1):
        found["frequency"] += [frequency_result(hz, seed) for hz in FREQS]
        for i, gamma in enumerate(table.gamma):
            columns = {"energy_j": table.energy_j[i], "target_head_r": table.target_head_r[i]}
            found["energy"].append(result(sign[table.mode[i]] + 0.01 * i, seed, energy_weight=gamma, **columns))
        for k, hz in map_grid(PAPER, REPORT):
            # From 50 to 100 Nm/rad the paper's map changes from in-phase to anti-phase; elsewhere it has one mode.
            r = 0.5 if 50 <= k <= 100 and hz < 0.3 else sign[at_one[k]] + 1e-4 * (k - 125)
            found["hip_stiffness"].append(result(r, seed, hip_k_nm_per_rad=k, freq_hz=hz, hip_range_deg=40 - 0.1 * k))
        ramp = RampTransitions(0.67 + 0.01 * seed, 1, 0.76 + 0.01 * seed, 1)
        for name in ("ramp", "ramp_as_published", "ramp_as_run"):
            found[name].append(result(0.1, seed, freq_hz=math.nan, ramp=ramp))
        for name in ("map", "human", "as_published", "as_run"):
            found[name] += [frequency_result(hz, seed) for hz in FREQS]
        for name in ("load", "load_trained", "load_as_published", "load_as_run"):
            found[name] += [result(0.9 - 0.4 * kg, seed, load_kg=kg) for kg in np.arange(0, 4.5, 0.5)]
        for a in REPORT.grid.amplitudes_m:
            found["amplitude"] += [frequency_result(hz, seed, 0.69 + 0.5 * (a - 0.1), a) for hz in TEN]
        for physics in ("sagittal", "mujoco", "mujoco_c"):
            own = [frequency_result(hz, seed) for hz in FREQS]
            found["engines"] += [replace(t, origin=replace(t.origin, physics=physics)) for t in own]
    return found


def trajectory(phase: np.ndarray, freq: Sequence[float], fall_step: int = -1) -> Trajectory:
    """Worlds whose target has the phase (T, W) [rad]: in-phase up to a momentary 0.7 Hz, anti-phase above it.

    The first one falls at `fall_step`; as in a roll-out, its record is nan from then on.
    """
    speed = np.gradient(phase, DT, axis=0) / (2 * np.pi)
    hip, ankle = 0.1 * np.cos(phase) * np.where(speed < 0.7, 1, -1), 0.05 * np.cos(phase)
    joints = np.stack([hip, ankle, hip, ankle], axis=-1)
    fields: dict[str, Any] = {
        "time": np.arange(len(phase)) * DT, "freq": np.array(freq), "hip_k": np.full(len(freq), 125.0),
        "ankle_k": np.full(len(freq), 25.0), "load": np.zeros(len(freq)), "target_x": 0.1 - 0.1 * np.cos(phase),
        "head_x": 0.1 - 0.08 * np.cos(phase), "head_vx": np.sin(phase), "joint_angle": joints, "joint_velocity": joints,
        "joint_torque": joints, "cop_x": np.zeros_like(phase), "torso_height": np.ones_like(phase),
        "foot_displacement": np.zeros_like(phase), "foot_flat": np.ones(phase.shape, dtype=bool),
        "fall_step": np.array([fall_step] + [-1] * (len(freq) - 1)), "torque_limit": 100.0, "control_dt": DT,
    }  # fmt: skip
    if fall_step >= 0:
        for name, values in fields.items():
            if np.shape(values)[:2] == phase.shape and values.dtype == np.float64:
                fields[name] = values.copy()  # some are one array
                fields[name][fall_step:, 0] = math.nan
    return Trajectory(**fields)


def steady(freq: Sequence[float], fall_step: int = -1) -> Trajectory:
    """A world for each frequency [Hz], 25 s long."""
    return trajectory(2 * np.pi * np.arange(1500)[:, None] * DT * np.array(freq), freq, fall_step)


def swept(fall_step: int = -1) -> Trajectory:
    """A target whose frequency rises by 0.036 Hz/s for 25 s."""
    return trajectory((np.pi * 0.036 * (np.arange(1500) * DT) ** 2)[:, None], [math.nan], fall_step)


def reproduction(results: dict[str, list[Result]], traces: Traces, trainings: Sequence[Training] = ()) -> Reproduction:
    """A reproduction with these results, of the default body."""
    (job,) = check("train", TrainConfig, []).jobs
    assert isinstance(job.config, TrainConfig)
    ends = np.array([-120.0, 45.0]), np.array([-50.0, 50.0])
    body = Body(40.15, 1.57, np.array([-0.008, 0.0, 0.822]), *ends, foot_span=(-0.06, 0.13))
    return Reproduction(results, traces, TRANSITIONS, body, list(trainings), job.config, [], ramp_start=0.0)
