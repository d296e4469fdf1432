"""The reward that benchmarks/switch_sensitivity.py reports, against hand arithmetic."""

import sys
from pathlib import Path

import numpy as np
import pytest

from envs.body.segments import read_segments
from posture.theory.motion import PeriodicMotion
from posture.theory.stander import linearise

sys.path.insert(0, str(Path(__file__).parents[1] / "benchmarks"))  # its files are scripts, which find one another so
import switch_sensitivity  # noqa: E402


def test_reward_of_standing_still(env_config):
    """Upright, with A = 0.1 m: (1 - cos)^2 is 1.5 on average; the head is outside 0.05 m for two thirds of the time."""
    config = env_config("env.reward.target_sharpness=1e-3", "env.reward.tolerance=0.05", "env.energy_weight=5")
    stander = linearise(read_segments(config), config)
    reward = switch_sensitivity.mean_reward(PeriodicMotion(stander, 0.5, np.zeros((2, 2), dtype=complex)), config)
    effort = 2 * (stander.torque_offset**2).sum() / config.torque_limit**2
    # Mean over the cycle of 1/2 - cos p where positive, for p from 60 to 300 degrees.
    outside = 0.1 * (1 / 3 + np.sqrt(3) / (2 * np.pi))
    assert reward == pytest.approx(1.0 + (1.0 - 1e-3 * 0.1**2 * 1.5) - 5 * effort - 1000 * outside, rel=1e-5)
