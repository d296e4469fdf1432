"""What a training on fast targets draws, by hand from conf/env/head_tracking: 0.04 to 0.1 m, from 0.7 Hz on."""

import pytest

from posture.cli import jobs
from posture.config.errors import ConfigError
from posture.config.gymnasium import GymnasiumConfig
from posture.config.theory import TheoryConfig
from tests.conftest import compose


@pytest.mark.parametrize(
    ("overrides", "drawn"),
    [
        ([], None),
        (["env.freq=0.69"], None),
        (["env.freq=[0.69,1.5]"], None),
        (["env.freq=0.7"], (0.04, 0.1)),
        (["env.freq=[0.9,1.5]"], (0.04, 0.1)),
        (["env.freq=2"], (0.04, 0.1)),
        (["env.freq=1.2", "env.amplitude=0.2"], (0.08, 0.2)),
        (["env.freq=1.2", "env.amplitude=0.06"], (0.035, 0.06)),  # not below the tolerance of 35 mm
        (["env.freq=1.2", "env.amplitude=0.06", "env.termination.head_tolerance=null"], (0.025, 0.06)),
        (
            [
                "env.freq=1.2",
                "env.amplitude=0.06",
                "env.termination.head_tolerance=null",
                "env.ranges.tolerance=[0.01,0.05]",
            ],
            (0.05, 0.06),
        ),
        (["env.freq=1.2", "env.reward.tolerance=[0.01,0.03]"], (0.04, 0.1)),
        (["env.freq=1.2", "env.amplitude=0.035"], None),
        (["env.freq=1.2", "env.amplitude=[0.05,0.08]"], (0.05, 0.08)),
        (["env.freq=1.2", "env.ranges.amplitude=null"], None),
        (["env.freq=1.2", "env.ranges.amplitude=[0.09,0.1]"], (0.09, 0.1)),
        (["env.freq=1.2", "env=many_bodies"], (0.04, 0.12)),  # its own
        (["env.freq=1.2", "env=authors_code"], None),
        (["env.ramp={start: 0.9, rate: 0.01, duration: 10}"], None),
    ],
)
def test_amplitudes_that_are_drawn(overrides, drawn):
    assert compose(*overrides).env.ranges.amplitude == drawn


def test_a_trial_has_one_amplitude():
    assert compose("env.freq=1.2").env.amplitude == 0.1


@pytest.mark.parametrize(("command", "schema"), [("theory", TheoryConfig), ("gymnasium", GymnasiumConfig)])
def test_only_trainings_draw(command, schema):
    assert not jobs.compose(command, schema, "env.freq=1.2").env.ranges.given


@pytest.mark.parametrize(
    "wrong",
    [
        "env.freq=fast",
        "env.freq=[]",
        "env.amplitude=big",
        f"env.amplitude=1{400 * '0'}",
        "env.reward=null",
        "env.termination=1",
    ],
)
def test_the_check_says_what_is_wrong(wrong):
    key = wrong.split("=")[0]
    with pytest.raises(ConfigError, match=f"^{key} = "):
        compose("env.freq=1.2", wrong)
