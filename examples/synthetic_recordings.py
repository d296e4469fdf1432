"""Make the example recordings of docs/people.md: synthetic, of no person.

    python examples/synthetic_recordings.py [--out examples/recordings]

Three invented subjects follow a slow and a fast target, and one of them a target whose frequency rises. Hip and ankle are
sinusoids at the frequency of the target with the phases below, which vary slowly and at random; drift, noise and two gaps
are added. Angles are in degrees with OpenSim's names and signs: hip flexion and dorsiflexion positive.
"""

import argparse
import math
from pathlib import Path

import numpy as np

RATE, DURATION = 40.0, 30.0  # [Hz], [s]
AMPLITUDE = 0.08  # [m] of the target
SLOW, FAST = 0.3, 0.9  # [Hz]
PHASES = {"S1": (12.0, 168.0), "S2": (25.0, 160.0), "S3": (5.0, 178.0)}  # [deg] hip ahead of the ankle: slow, fast
RANGES = {"slow": (3.0, 4.0), "fast": (8.0, 2.0)}  # [deg] amplitude of hip and ankle
RAMP = (0.2, 0.02, 40.0)  # [Hz], [Hz/s], [s]
SWITCH, WIDTH = 0.65, 0.03  # [Hz] where the phase of the ramp passes 90 deg, and how fast
NOTE = "# synthetic: made by examples/synthetic_recordings.py, of no person"
COLUMNS = "time_s,target_x_m,head_x_m,hip_flexion_r_deg,ankle_angle_r_deg"


def wander(draw: np.random.Generator, count: int, sd: float) -> np.ndarray:
    """A slow random signal (count,) of standard deviation `sd`, correlated over about two seconds."""
    kernel = np.hanning(round(4 * RATE))
    noise = np.convolve(draw.normal(size=count + len(kernel) - 1), kernel, "valid")
    return sd * noise / math.sqrt(float(kernel @ kernel))


def recording(seed: int, phase: np.ndarray, lead: np.ndarray, hip: np.ndarray, ankle: np.ndarray) -> list[str]:
    """The rows of a file: a target of phase `phase` [rad] and a hip that leads the ankle by `lead` [rad], whose amplitudes
    are `hip` and `ankle` [deg], (T,) each."""
    draw, count = np.random.default_rng(seed), len(phase)
    time = np.arange(count) / RATE
    lag = math.radians(8.0) + wander(draw, count, math.radians(4.0))
    target = AMPLITUDE * (1 - np.cos(phase))
    head = AMPLITUDE * (1 - 0.95 * np.cos(phase - lag)) + draw.normal(scale=0.001, size=count)
    forward = phase - lag + wander(draw, count, math.radians(6.0))  # of the ankle
    ankle_deg = 3.0 - ankle * np.cos(forward) + 0.02 * time + draw.normal(scale=0.08, size=count)
    lead = lead + wander(draw, count, math.radians(10.0))
    hip_deg = 6.0 - hip * np.cos(forward + lead) - 0.03 * time + draw.normal(scale=0.08, size=count)
    cells = [[f"{t:.3f}", f"{x:.4f}", f"{h:.4f}"] for t, x, h in zip(time, target, head, strict=True)]
    rows = [[*own, f"{a:.2f}", f"{b:.2f}"] for own, a, b in zip(cells, hip_deg, ankle_deg, strict=True)]
    for start, length in ((0.55, 3), (0.75, 24)):  # one gap that is filled, one for which a cycle is left out
        for row in rows[int(start * count) : int(start * count) + length]:
            row[3] = ""
    return [NOTE, COLUMNS, *(",".join(row) for row in rows)]


def recordings() -> dict[str, list[str]]:
    """The lines of each file, by its name."""
    files, time = {}, np.arange(round(RATE * DURATION)) / RATE
    for number, (subject, leads) in enumerate(PHASES.items()):
        for i, (name, freq) in enumerate((("slow", SLOW), ("fast", FAST))):
            hip, ankle = (np.full(len(time), value) for value in RANGES[name])
            lead = np.full(len(time), math.radians(leads[i]))
            files[f"{subject}_{name}.csv"] = recording(10 * number + i, 2 * math.pi * freq * time, lead, hip, ankle)
    time = np.arange(round(RATE * RAMP[2])) / RATE
    freq = RAMP[0] + RAMP[1] * time
    share = 1 / (1 + np.exp(-(freq - SWITCH) / WIDTH))
    lead = np.radians(PHASES["S1"][0] + share * (PHASES["S1"][1] - PHASES["S1"][0]))
    hip, ankle = (slow + share * (fast - slow) for slow, fast in zip(RANGES["slow"], RANGES["fast"], strict=True))
    phase = 2 * math.pi * (RAMP[0] * time + RAMP[1] * time**2 / 2)
    files["S1_ramp.csv"] = recording(99, phase, lead, hip, ankle)
    return files


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=Path(__file__).with_name("recordings"))
    out = parser.parse_args().out
    out.mkdir(parents=True, exist_ok=True)
    for name, lines in recordings().items():
        (out / name).write_text("\n".join(lines) + "\n", encoding="utf-8", newline="\n")
        print(out / name)
