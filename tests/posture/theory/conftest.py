"""The linear stander of the default configuration."""

import pytest

from envs.body.segments import Segments
from envs.config import EnvConfig
from posture.theory.stander import Stander, linearise


@pytest.fixture(scope="session")
def stander(body: Segments, config: EnvConfig) -> Stander:
    return linearise(body, config)
