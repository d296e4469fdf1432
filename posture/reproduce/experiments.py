"""The experiments of conf/experiment/ that make up a reproduction."""

from dataclasses import dataclass
from typing import get_args

from posture.config.reproduce import Experiment


@dataclass(frozen=True)
class Evaluation:
    """Trials of `experiment`, with the policies that the experiment `policies` trained."""

    experiment: str
    policies: str = "frequency"


TRAININGS: tuple[str, ...] = get_args(Experiment)
"""Experiments that train policies; `frequency` is Exp. 1."""
RECIPES = {"frequency": "ours", "as_published": "authors' code", "as_run": "authors' code as it was run"}
"""Those that train one policy for all frequencies of Exp. 1 in different ways, and their names in the report."""
PUBLISHED = ("as_published", "as_run")
"""Those of them that are not ours."""
EVALUATIONS = {
    "ramp": Evaluation("ramp"),
    "load": Evaluation("load"),
    "load_trained": Evaluation("load", "map"),
    "amplitude": Evaluation("amplitude", "map"),
    "engines": Evaluation("engines"),
    **{f"{trial}_{policies}": Evaluation(trial, policies) for policies in PUBLISHED for trial in ("ramp", "load")},
}
"""By name of the results."""
OF_SEVERAL_SEEDS = {"map": "map", "dynamics": "human"}
"""Commands that evaluate all seeds of an experiment together, and the experiment."""
