"""How much reward a linear stander loses whose modes switch at another frequency than the reward's optimum.

python benchmarks/switch_sensitivity.py     ten seconds; docs/learning.md has its result

At each frequency f the stander moves as is best for f + shift: its coordination is that of f + shift, and its modes switch
`shift` below the optimum.
"""

import argparse
import math

import numpy as np
from shared import compose

from envs.body.segments import read_segments
from envs.config import EnvConfig
from envs.task import rewards
from posture.theory.motion import PeriodicMotion
from posture.theory.reward_optimum import reward_optimum, reward_terms
from posture.theory.stander import linearise
from posture.theory.transition import hip_ankle_correlation

FREQUENCIES = (0.6, 0.65, 0.7)
SHIFTS = (-0.04, -0.02, 0.0, 0.02, 0.04)


def mean_reward(motion: PeriodicMotion, config: EnvConfig) -> float:
    """Mean over a cycle of the reward of a step, over its scale [-]: the terms not zero by default, with the feet still."""
    terms, time = config.reward, motion.cycle()
    distance = motion.head(time) - config.amplitude * (1 - np.cos(2 * math.pi * motion.freq * time))
    outside = rewards.beyond(distance, terms.tolerance).mean()
    return (
        rewards.weight(terms.stay_weight)
        + rewards.weight(terms.target_weight) * float(rewards.closeness(distance, terms.target_sharpness).mean())
        + rewards.weight(config.energy_weight) * sum(reward_terms(motion, config))
        - terms.tolerance_weight * float(outside)
    )


def main() -> None:
    """Print, for each frequency and shift, the hip-ankle correlation and the reward lost."""
    argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter).parse_args()
    config = compose().env
    stander = linearise(read_segments(config), config)
    print("shift [Hz] " + " ".join(f"{shift:>+15.2f}" for shift in SHIFTS))
    for freq in FREQUENCIES:
        motions = [reward_optimum(stander, freq + shift, config, config.reward.tolerance) for shift in SHIFTS]
        motions = [PeriodicMotion(stander, freq, motion.coefficients) for motion in motions]
        values = [mean_reward(motion, config) for motion in motions]
        best = values[SHIFTS.index(0.0)]
        texts = [
            f"r {hip_ankle_correlation(motion):+.2f} {best - value:.4f}"
            for motion, value in zip(motions, values, strict=True)
        ]
        print(f"{freq:.2f} Hz    " + " ".join(f"{text:>15}" for text in texts) + f"   of {best:.3f}")


if __name__ == "__main__":
    main()
