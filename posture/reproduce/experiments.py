"""The experiments of conf/experiment/ that make up a reproduction."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Evaluation:
    """Trials of `experiment`, with the policies that the experiment `policies` trained."""

    experiment: str
    policies: str = "frequency"


TRAININGS = ("frequency", "energy", "hip_stiffness", "map")
"""Experiments that train policies; `frequency` is Exp. 1."""
EVALUATIONS = {
    "ramp": Evaluation("ramp"),
    "load": Evaluation("load"),
    "load_trained": Evaluation("load", "map"),
    "amplitude": Evaluation("amplitude", "map"),
    "engines": Evaluation("engines"),
}
"""By name of the results."""
