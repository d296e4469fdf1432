"""The task's configuration with its terms of observation checked."""

from typing import Annotated

from pydantic import AfterValidator

from envs.config import EnvConfig
from envs.task.observations import TERMS


def _known_terms(env: EnvConfig) -> EnvConfig:
    for group, terms in env.observations.items():
        unknown = sorted(set(terms) - set(TERMS))
        if unknown:
            raise ValueError(f"observations.{group}: unknown {', '.join(unknown)}; allowed are {', '.join(sorted(TERMS))}")
    return env


Environment = Annotated[EnvConfig, AfterValidator(_known_terms)]
"""The task's configuration, with terms of observation that there are."""
