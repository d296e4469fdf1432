"""The quick least costs against the theory of least cost."""

import math

import numpy as np
import pytest

from envs.body.segments import read_segments
from envs.task import bodies
from posture.theory.least_costs import least_costs, weighted
from posture.theory.motion import motion_indices
from posture.theory.optimum import bound
from posture.theory.program import InfeasibleError
from posture.theory.stander import linearise


def least_cost(body, config, freq, tolerance):
    """Of the program of least cost; nan where no motion keeps the limits."""
    try:
        return motion_indices(bound(linearise(body, config), freq, config.amplitude, tolerance), 100.0).cost
    except InfeasibleError:
        return math.nan


@pytest.mark.parametrize("limits", [[], ["env.torque_limit=45"]])
def test_as_the_program_of_least_cost_says(env_config, limits):
    """Of 64 bodies and targets. With few harmonics a motion at the edge may be missed; sinusoids cost a little more."""
    keys = ["env.hip_k=[25,200]", "env.load=[0,8]", "env.amplitude=[0.04,0.2]", "env.freq=[0.1,1.5]"]
    config = env_config(*keys, "env.reward.tolerance=[0.01,0.03]", *limits)
    rows = bodies.table(config, 1, count=64)[0]
    found = least_costs(config, rows)
    body, ratios = read_segments(config), []
    for row, cost in zip(rows, found, strict=True):
        values = dict(zip(bodies.COLUMNS, row, strict=True))
        own = {name: values[name] for name in ("hip_k", "ankle_k", "load", "amplitude", "joint_damping")}
        expected = least_cost(body, config.model_copy(update=own), values["freq"], values["tolerance"])
        assert np.isfinite(expected) or np.isnan(cost)
        if np.isfinite(cost):
            ratios.append(cost / expected)
    assert 0.3 < np.isfinite(found).mean() <= 1.0
    assert bool(np.isfinite(found).all()) != bool(limits)
    assert min(ratios) > 0.99 and np.median(ratios) < 1.1


def test_effort_is_weighed_as_in_the_training(env_config):
    """Soft hips at low frequency by the largest factor, the default body by the reference over its least cost."""
    keys = ["env.ranges.hip_k=[25,200]", "env.reward.effort_exponent=0.5", "env.reward.effort_reference=0.04"]
    config = env_config(*keys, "env.reward.effort_scale_max=9")
    body = read_segments(config)
    soft = config.model_copy(update={"hip_k": 25.0})
    assert weighted(soft, body, 0.2).energy_weight == pytest.approx(20 * 3)
    least = least_cost(body, config, 0.6, config.reward.tolerance)
    assert weighted(config, body, 0.6).energy_weight == pytest.approx(20 * (0.04 / least) ** 0.5, rel=0.1)
    assert weighted(env_config(*keys[1:]), body, 0.6).energy_weight == 20.0
