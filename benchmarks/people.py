"""How long posture.analyse takes for many recordings: 100 of 100 s at 1 kHz, unless told otherwise.

    python benchmarks/people.py [--count 100] [--duration 100] [--rate 1000] [KEY=VALUE ...]

Files are made in a temporary folder: time, target, head, hip and ankle, 4.5 MB each. The time is that of the whole command,
from its start to its end. Further arguments are those of posture.analyse, such as evaluation.figures=false.
"""

import argparse
import math
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
DIFFERENT = 10
"""Files that are computed; the others are copies."""


def write_recording(path: Path, seed: int, duration: float, rate: float) -> None:
    """A trial at 0.2 to 1.1 Hz with noise."""
    draw, t = np.random.default_rng(seed), np.arange(round(duration * rate)) / rate
    phase = 2 * math.pi * (0.2 + 0.1 * seed) * t
    target = 0.08 - 0.08 * np.cos(phase)
    head = target + draw.normal(scale=0.001, size=len(t))
    hip = 5 * np.cos(phase + 0.3 * seed) + draw.normal(scale=0.1, size=len(t))
    ankle = 3 * np.cos(phase) + draw.normal(scale=0.1, size=len(t))
    names = "time_s,target_x_m,head_x_m,hip_flexion_r_deg,ankle_angle_r_deg"
    formats = ["%.4f", "%.6f", "%.6f", "%.5f", "%.5f"]
    np.savetxt(path, np.column_stack([t, target, head, hip, ankle]), formats, ",", header=names, comments="")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=100)
    parser.add_argument("--duration", type=float, default=100.0, help="[s]")
    parser.add_argument("--rate", type=float, default=1000.0, help="[Hz]")
    options, arguments = parser.parse_known_args()
    with tempfile.TemporaryDirectory() as folder:
        data = Path(folder, "data")
        data.mkdir()
        for number in range(options.count):
            if number < DIFFERENT:
                write_recording(data / f"{number}.csv", number, options.duration, options.rate)
            else:
                (data / f"{number}.csv").write_bytes((data / f"{number % DIFFERENT}.csv").read_bytes())
        command = [sys.executable, "-m", "posture.analyse", f"recording={data}", f"out={folder}/out", *arguments]
        start = time.perf_counter()
        environment = {**os.environ, "PYTHONPATH": str(ROOT), "OMP_NUM_THREADS": "1"}
        subprocess.run(command, cwd=folder, env=environment, stdout=subprocess.DEVNULL, check=True)
        seconds = time.perf_counter() - start
    what = f"{options.count} recordings of {options.duration:g} s at {options.rate:g} Hz"
    times = os.times()  # of all processes that the command started; 0 on Windows
    work = times.children_user + times.children_system
    print(f"{what}: {seconds:.1f} s on {os.cpu_count()} cores, {work:.1f} s of processor time")


if __name__ == "__main__":
    main()
