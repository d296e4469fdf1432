"""Reward terms: arrays of numpy or tensors of torch with N worlds in, shape (N,) out. Weights and scale are in conf/env/.

    R = scale (alpha R_stay + beta R_target + alive + gamma (R_energy + R_torque) + R_tolerance - R_limit)   (Eq. 6)

where the paper leaves alpha, beta and scale open; the constants `alive` and R_limit are from the authors' code, and
R_tolerance is ours.
In the step that ends an episode early, R = scale * `ended` instead, if `ended` is given.
"""

from typing import TYPE_CHECKING, TypeVar

from envs.config import EnvConfig, Schedule, Weight

if TYPE_CHECKING:
    import numpy as np
    import torch
    from numpy.typing import NDArray

Values = TypeVar("Values", "torch.Tensor", "NDArray[np.float64]")


def closeness(distance: Values, sharpness: float) -> Values:
    """1 / (1 + k d^2): R_stay of the feet (paper Eq. 7) and R_target of the head (Eq. 8), with d [m], k [1/m2].

    The paper has k = 1; the authors' code 4 for the feet and 5 for the head.
    """
    return 1.0 / (1.0 + sharpness * distance**2)


def beyond(distance: Values, tolerance: float | Values) -> Values:
    """How far the head is outside the `tolerance` around its target [m]. distance: between the two [m]. (N,)."""
    return (abs(distance) - tolerance).clip(min=0.0)


def energy(torque: Values, velocity: Values, unit: str, limit: float, dt: float) -> Values:
    """R_energy for joint `torque` [Nm] and `velocity` [rad/s], (N, joints), in a control step of `dt` [s]. (N,).

    unit: joule, minus the work of all joints regardless of sign (paper Eq. 9); normalised, the same with the torque over its
    `limit` [Nm]; authors_code, minus sum |a * 0.1 omega| with a the torque over its limit.
    """
    if unit == "authors_code":
        return -abs(torque / limit * 0.1 * velocity).sum(-1)
    if unit == "normalised":
        torque = torque / limit
    return -abs(torque * velocity).sum(-1) * dt


def torque_squared(torque: Values) -> Values:
    """R_torque of paper Eq. 10: minus the sum of squared joint torques, in Nm^2 or of the normalised torque. (N, joints)."""
    return -(torque**2).sum(-1)


def one_late(values: Values, after: Values) -> Values:
    """`values` (N, joints) read one place late in an observation, in which `after` (N, joints) follow them: the last is the
    first of these. The authors' penalties read their observation so."""
    late = values * 1.0
    late[:, :-1], late[:, -1] = values[:, 1:], after[:, 0]
    return late


def velocity_as_run(velocity: Values, joint_force: Values) -> Values:
    """What the authors' code takes for the joints' `velocity` [rad/s] in R_energy, (N, joints). joint_force: moments [Nm].

    Their observation holds 0.1 of the velocities and then 0.01 of the moments.
    """
    return one_late(velocity, 0.1 * joint_force)


def effort(action: Values, velocity: Values, config: EnvConfig) -> tuple[Values, Values]:
    """R_energy and R_torque, (N,) each, in the units of `config`; action: torque over its limit, (N, joints)."""
    torque = config.torque_limit * action
    terms = config.reward
    return (
        energy(torque, velocity, terms.energy_unit, config.torque_limit, config.control_dt),
        torque_squared(torque if terms.torque_unit == "newton_metre" else action),
    )


def joint_limit(scaled_angle: Values) -> Values:
    """Penalty of the authors' code for joints within 2 % of a limit: sum of (|q| - 0.98) / 0.02 where positive.

    scaled_angle: (N, joints), -1 and 1 at the limits.
    """
    return ((abs(scaled_angle) - 0.98) / 0.02).clip(min=0.0).sum(-1)


def weight(value: Weight) -> float:
    """The weight at the end of a training and outside of one."""
    return value.end if isinstance(value, Schedule) else value


def weight_at(progress: "torch.Tensor", value: Weight) -> "float | torch.Tensor":
    """The weight at `progress`, the share of the training that is done, shape ()."""
    if not isinstance(value, Schedule):
        return value
    return value.start * (value.end / value.start) ** (progress / value.until).clip(max=1.0)
