"""Reward terms, one function each: tensors of N worlds in, shape (N,) out. Weights and scale are in conf/env/.

    R = scale * (alpha R_stay + beta R_target + alive + gamma (R_energy + R_torque) - R_limit)      paper Eq. 6

where the paper leaves alpha, beta and scale open, and the constants `alive` and R_limit are the authors' code's alone.
In the step that ends an episode early, R = scale * `ended` instead, if `ended` is given.
"""

import torch

from envs.config import Schedule, Weight


def closeness(distance: torch.Tensor, sharpness: float) -> torch.Tensor:
    """1 / (1 + k d^2): R_stay of the feet (paper Eq. 7) and R_target of the head (Eq. 8), with d [m], k [1/m2].

    The paper has k = 1; the authors' code 4 for the feet and 5 for the head.
    """
    return 1.0 / (1.0 + sharpness * distance**2)


def energy_joule(torque: torch.Tensor, velocity: torch.Tensor, dt: float) -> torch.Tensor:
    """R_energy of paper Eq. 9: minus the energy turned over by the joints in one control step of `dt` [s], in J.

    torque [Nm], velocity [rad/s]: (N, joints).
    """
    return -(torque * velocity).abs().sum(-1) * dt


def energy_scaled(action: torch.Tensor, velocity: torch.Tensor) -> torch.Tensor:
    """R_energy as in the authors' code: minus sum |a * 0.1 omega|, a the normalised torque in [-1, 1], omega [rad/s]."""
    return -(action * 0.1 * velocity).abs().sum(-1)


def energy(torque: torch.Tensor, velocity: torch.Tensor, unit: str, limit: float, dt: float) -> torch.Tensor:
    """R_energy as `energy_unit` reads it: joule, normalised (Eq. 9 with torque over its `limit`) or authors_code. (N,)."""
    if unit == "joule":
        return energy_joule(torque, velocity, dt)
    if unit == "normalised":
        return energy_joule(torque / limit, velocity, dt)
    return energy_scaled(torque / limit, velocity)


def torque_squared(torque: torch.Tensor) -> torch.Tensor:
    """R_torque of paper Eq. 10: minus the sum of squared joint torques, in Nm^2 or of the normalised torque. (N, joints)."""
    return -(torque**2).sum(-1)


def joint_limit(scaled_angle: torch.Tensor) -> torch.Tensor:
    """Penalty of the authors' code for joints within 2 % of a limit: sum of (|q| - 0.98) / 0.02 where positive.

    scaled_angle: (N, joints), -1 and 1 at the limits.
    """
    return ((scaled_angle.abs() - 0.98) / 0.02).clamp(min=0.0).sum(-1)


def weight(value: Weight, steps: int) -> float:
    """The weight after `steps` control steps of each world: itself, or its place on a geometric schedule."""
    if not isinstance(value, Schedule):
        return value
    share = min(1.0, steps / value.steps)
    return float(value.start * (value.end / value.start) ** share)
