"""Which bodies can follow which targets, against the theory of least cost."""

import numpy as np
import pytest

from envs.body.segments import read_segments
from envs.task import bodies
from posture.theory.feasible import feasible
from posture.theory.prediction import predict


@pytest.mark.parametrize("limits", [[], ["env.torque_limit=45"]])
def test_as_the_program_of_least_cost_says(env_config, limits):
    """Among 64 bodies and targets. The check's own program has fewer harmonics, so it may leave out a motion at the edge."""
    keys = ["env.hip_k=[25,200]", "env.load=[0,8]", "env.amplitude=[0.04,0.2]", "env.freq=[0.1,1.5]"]
    config = env_config(*keys, "env.reward.tolerance=[0.01,0.03]", *limits)
    rows = bodies.table(config, 1)[0][::256]
    found = feasible(config, rows)
    body = read_segments(config)
    for row, able in zip(rows, found, strict=True):
        values = dict(zip(bodies.COLUMNS, row, strict=True))
        own = {name: values[name] for name in ("hip_k", "ankle_k", "load", "amplitude", "joint_damping")}
        expected = predict(body, config.model_copy(update=own), values["freq"], values["tolerance"], 100.0).feasible
        assert able == expected or not able
    assert 0.3 < found.mean() < 1.0
    assert np.array_equal(found, feasible(config, rows))
