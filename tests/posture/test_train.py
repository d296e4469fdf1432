"""The warning of a training that ends before a schedule of a weight."""

import pytest

from posture.train import _report_unfinished_schedules
from tests.conftest import compose


@pytest.mark.parametrize(
    ("override", "begun_with", "line"),
    [
        ("max_iterations=1000", 1000, ""),
        ("max_iterations=1500", 1000, ""),
        ("env.reward.alive={start: 1.0, end: 2.0, until: 1.0}", 800, ""),
        (
            "env.reward.alive={start: 1.0, end: 2.0, until: 1.5}",
            800,
            "env.reward.alive: the schedule ends after 1200 iterations, the training after 800\n",
        ),
        (
            "max_iterations=300",  # resumed with fewer iterations than it began with
            1000,
            "env.reward.stay_weight, env.reward.target_weight, env.reward.ended: the schedule ends after 400 iterations, "
            "the training after 300\n",
        ),
    ],
)
def test_a_training_that_ends_before_a_schedule_says_so(capsys, override, begun_with, line):
    config = compose("max_iterations=800", override)
    _report_unfinished_schedules(config, begun_with * config.agent.num_steps_per_env)
    assert capsys.readouterr().out == line
