"""How what the joints can do scales with the body, from the paper's body (Table 1) to that of a person.

Two bodies of the same proportions move alike if all lengths are in the ratio of their statures h, all masses in that of
their masses m, and times in that of sqrt(h), since gravity is the same. Torques are then in the ratio m h, as gravity's is.
So is stiffness, a torque per angle; damping, a torque per angular velocity, is in the ratio m h^1.5, and a moment of
inertia in the ratio m h^2. A person has other proportions than the paper's body, but joints scaled by these ratios: as stiff
and as strong against gravity.

The torque limit so scaled is that of paper Table 1, not a measured strength. Target, tolerances, load and friction are
given, not scaled.
"""

from collections.abc import Sequence
from typing import Any

from pydantic import ValidationError

from envs.config import EnvConfig, Person
from posture.config.published import read_published

EXPONENTS = {
    "hip_k": (1.0, 1.0),
    "ankle_k": (1.0, 1.0),
    "torque_limit": (1.0, 1.0),
    "joint_damping": (1.0, 1.5),
    "joint_armature": (1.0, 2.0),
    "fall_height": (0.0, 1.0),
}
"""Of mass and stature, by the key of `EnvConfig` or `TerminationConfig`."""


def factor(key: str, body: Person | None) -> float:
    """The value of `key` for `body` over that for the paper's body, None."""
    if body is None:
        return 1.0
    paper, (of_mass, of_height) = read_published().table_1, EXPONENTS[key]
    return float((body.mass / paper.mass_kg) ** of_mass * (body.height / paper.height_m) ** of_height)


def for_body(key: str, value: float | Sequence[float], body: Any) -> Any:
    """`value` of `key` for the paper's body, scaled for `body`, a record of `Person` or None: six digits, for those who read
    them. A resolver of conf/.

    Where `body` is neither, the value stays: the check of the configuration says what is wrong.
    """
    if not isinstance(value, (int, float)):
        return [for_body(key, each, body) for each in value]
    try:
        person = None if body is None else Person.model_validate(dict(body))
    except (ValidationError, TypeError, ValueError):
        person = None
    return value if person is None else float(f"{value * factor(key, person):.6g}")


def with_body(env: EnvConfig, body: Person | None) -> dict[str, Any]:
    """The values of `env`, which has no ranges, with another body and with joints scaled from its own."""
    values = env.model_dump() | {"body": None if body is None else body.model_dump()}
    if body == env.body:
        return values
    for key in EXPONENTS:
        part = values["termination"] if key == "fall_height" else values
        part[key] *= factor(key, body) / factor(key, env.body)
    return values
