"""Where a load would have to be to turn the mode of least torque at 0.4 Hz (paper Exp. 4b).

python benchmarks/load_place.py     half a minute; docs/theory.md has its result
"""

import argparse
import math

import numpy as np
from scipy.optimize import brentq
from shared import compose

from envs.body.segments import Segments, read_segments
from envs.config import EnvConfig
from posture.config.published import read_published
from posture.theory.optimum import bound
from posture.theory.program import InfeasibleError
from posture.theory.stander import linearise
from posture.theory.transition import bound_transition, hip_ankle_correlation

PAPER = read_published().experiment_4b
FREQ_HZ, LOAD_KG = PAPER.freq_hz, PAPER.load_kg[-1]
HEAVIEST_KG = 50.0
"""The heaviest load that is tried."""
PLACES = {
    "centre of mass": None,
    "behind it": (-0.21, -0.18),
    "far behind it": (-0.41, -0.18),
    "in front of it": (0.19, -0.18),
    "between the shoulders": (0.0, 0.0),
    "backpack": (-0.2, -0.05),
    "head": (0.0, 0.19),
    "above the head": (0.0, 0.5),
    "far above the head": (0.0, 1.0),
    "hips": (0.0, -0.465),
}
"""Place of the load in the HAT's frame [m]: x forward, z up from between the shoulders."""


def correlation(body: Segments, config: EnvConfig, load: float, at: tuple[float, float] | None) -> float:
    """Hip-ankle correlation of least torque at `FREQ_HZ`; nan where no motion keeps the limits."""
    stander = linearise(body, config.model_copy(update={"load": load, "load_at": at}))
    try:
        return hip_ankle_correlation(bound(stander, FREQ_HZ, config.amplitude, config.reward.tolerance))
    except InfeasibleError:
        return math.nan


def turning_load(body: Segments, config: EnvConfig, at: tuple[float, float] | None) -> str:
    """The least load with which the mode is anti-phase."""
    loads = np.linspace(0.0, HEAVIEST_KG, 51)
    found = [correlation(body, config, float(load), at) for load in loads]
    for i in range(1, len(loads)):
        if math.isnan(found[i]):
            return f"none: from {loads[i]:.0f} kg on the foot is too short"
        if found[i] < 0 < found[i - 1]:
            return f"{brentq(lambda load: correlation(body, config, load, at), loads[i - 1], loads[i], xtol=0.01):.1f} kg"
    return f"none up to {HEAVIEST_KG:.0f} kg"


def main() -> None:
    """Print, for each place, the transition and the correlation with 4 kg, and the load that turns the mode."""
    argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter).parse_args()
    config = compose().env
    body = read_segments(config)
    print(f"{'place':<24}{'x, z [m]':<16}{'f* [Hz], 4 kg':<16}{'r at 0.4 Hz':<14}least load that turns the mode")
    for name, at in PLACES.items():
        stander = linearise(body, config.model_copy(update={"load": LOAD_KG, "load_at": at}))
        switch = bound_transition(stander, config.amplitude, config.reward.tolerance, (0.02, 1.5))
        place = "-" if at is None else f"{at[0]:g}, {at[1]:g}"
        r = correlation(body, config, LOAD_KG, at)
        text = "none" if switch is None else f"{switch:.3f}"
        print(f"{name:<24}{place:<16}{text:<16}{r:<+14.2f}{turning_load(body, config, at)}")


if __name__ == "__main__":
    main()
