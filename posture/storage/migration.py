"""Saved configurations of earlier versions, brought up to date one version at a time.

config.yaml has a `version`; files without one are of version 1. A change of the keys raises VERSION and adds a function.
"""

import contextlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

from envs.config import RANGE_KEYS
from posture.config.errors import ConfigError

VERSION = 10


def upgrade(values: dict[str, Any], file: Path) -> dict[str, Any]:
    """The content of `file`, a config.yaml of any version, as one of version `VERSION`, without the key `version`."""
    version = values.pop("version", 1)
    if type(version) is not int or not 1 <= version <= VERSION:
        raise ConfigError(f"{file}: version = {version!r:.80}: allowed is a whole number from 1 to {VERSION}")
    for number in range(version, VERSION):
        values = UPGRADES[number](values)
    return values


def _from_1(values: dict[str, Any]) -> dict[str, Any]:
    """The paper's tables were copied into each run, and schedules of weights were in control steps of each world."""
    try:
        training_steps = values["max_iterations"] * values["agent"]["num_steps_per_env"]
        weights = [weight for record in (values["env"], values["env"]["reward"]) for weight in record.values()]
        for weight in weights:
            if isinstance(weight, dict) and weight.keys() == {"start", "end", "steps"}:
                weight["until"] = weight.pop("steps") / training_steps
    except (KeyError, TypeError, AttributeError, ZeroDivisionError):
        pass  # the check of the upgraded values reports what is wrong
    return {key: value for key, value in values.items() if key != "paper"}


def _from_2(values: dict[str, Any]) -> dict[str, Any]:
    """Contacts were MuJoCo's."""
    with contextlib.suppress(KeyError, TypeError):  # the check of the upgraded values reports what is wrong
        values["env"]["solver"].setdefault("contact_bias", False)
    return values


def _from_3(values: dict[str, Any]) -> dict[str, Any]:
    """The reward had no term for the tolerance, and the lower bound of the actions' noise was constant."""
    with contextlib.suppress(KeyError, TypeError, AttributeError):  # as above
        values["env"]["reward"].setdefault("tolerance", values["evaluation"]["tolerance"])  # without effect
        values["env"]["reward"].setdefault("tolerance_weight", 0.0)
        values["agent"].setdefault("std_floor", None)
    return values


def _from_4(values: dict[str, Any]) -> dict[str, Any]:
    """Every training began with random weights, logged to TensorBoard, and was evaluated at its end only."""
    with contextlib.suppress(KeyError, TypeError, AttributeError):  # as above
        values["agent"].setdefault("logger", "tensorboard")
    return dict.fromkeys(("init", "evaluate_every", "film_every", "patience")) | values


def _from_5(values: dict[str, Any]) -> dict[str, Any]:
    """Every world had the same body."""
    with contextlib.suppress(KeyError, TypeError, AttributeError):  # as above
        values["env"].setdefault("ranges", dict.fromkeys(RANGE_KEYS))
        values["env"]["reward"].setdefault("effort_exponent", 0.0)
        values["env"]["reward"].setdefault("effort_reference", 0.03)  # without effect
    return values


def _from_6(values: dict[str, Any]) -> dict[str, Any]:
    """The load was at the centre of mass of the HAT, and any least cost could weigh the effort."""
    with contextlib.suppress(KeyError, TypeError, AttributeError):  # as above
        values["env"].setdefault("load_at", None)
        values["env"]["reward"].setdefault("effort_scale_max", 1e6)
    return values


def _from_7(values: dict[str, Any]) -> dict[str, Any]:
    """Ranges were drawn uniformly, and policies had the weights of the last iteration."""
    with contextlib.suppress(KeyError, TypeError, AttributeError):  # as above
        values["env"].setdefault("log_ranges", [])
        values["agent"].setdefault("average_from", None)
    return values


def _from_8(values: dict[str, Any]) -> dict[str, Any]:
    """Everyone had the paper's body, policies observed the true values at once, and torque was the command."""
    with contextlib.suppress(KeyError, TypeError, AttributeError):  # as above
        sensing = {"delay": 0.0, "noise": {}, "drift_time": 10.0, "history": 0, "history_step": 2, "exact": []}
        values["env"].setdefault("body", None)
        values["env"].setdefault("sensing", sensing)
        values["env"].setdefault("actuation", {"time_constant": 0.0, "noise": 0.0})
    return values


def _from_9(values: dict[str, Any]) -> dict[str, Any]:
    """No reward had the errors of the authors' code."""
    with contextlib.suppress(KeyError, TypeError, AttributeError):  # as above
        values["env"]["reward"].setdefault("as_run", False)
    return values


UPGRADES: dict[int, Callable[[dict[str, Any]], dict[str, Any]]] = {
    1: _from_1,
    2: _from_2,
    3: _from_3,
    4: _from_4,
    5: _from_5,
    6: _from_6,
    7: _from_7,
    8: _from_8,
    9: _from_9,
}
"""By version, the function that gives the version after it."""
