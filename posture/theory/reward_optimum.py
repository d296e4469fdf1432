"""The motion of the linear stander that maximises the configured reward: a local optimum, found from the least-torque bound.

With the feet still, the part of the reward (envs/task/rewards.py) that depends on the motion is beta R_target + gamma
(R_energy + R_torque). Divided by -gamma and the unit of R_torque it is a cost, the mean over time of

    sum over joints (a^2 + e |a x|) - b / (1 + k d^2),

with a the normalised torque, x the joint's velocity [rad/s] (with `reward.as_run`, what the authors' code takes for it), d
[m] the head's distance from its target, and e, b as `RewardTerms` reads them from the reward functions. Neither the energy
term nor the closeness is convex. The cost is minimised by majorisation: with r = |x| / |a| and d' those of the last motion,

    |a x| <= (r a^2 + x^2 / r) / 2,   -1 / (1 + k d^2) <= const + k d^2 / (1 + k d'^2)^2,

with equality at the last motion, so that a convex program with the right-hand sides (`posture.theory.program`) never raises
the cost.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from envs.config import EnvConfig
from envs.task import rewards
from posture.analysis.trajectory import Array
from posture.theory.motion import PeriodicMotion, joint_arrays
from posture.theory.program import Program
from posture.theory.stander import JOINTS_OF_A_KIND, Stander

MAX_ITERATIONS = 200
"""Largest number of convex programs; usually 10 to 60 are needed."""
CONVERGED = 1e-5
"""The relative decrease of the cost in one iteration that ends them."""
SMOOTHING = 1e-2
"""|x| is replaced by sqrt(x^2 + s^2), s this share of the root mean square of x: the iteration would stop at the kink."""


@dataclass(frozen=True)
class RewardTerms:
    """Weights of the reward over that of squared normalised torque; schedules count with their final value.

    energy: e [s/rad] of |a x|. target: b [-] of the closeness to the target; sharpness: k [1/m2].
    """

    energy: float
    target: float
    sharpness: float

    @classmethod
    def of(cls, config: EnvConfig) -> RewardTerms:
        """Read from `config` and envs/task/rewards.py. Raises ValueError where the reward has no weight on torques."""
        one = np.ones((1, 1))
        energy, torque = (-float(term[0]) for term in rewards.effort(one, one, config))
        gamma = rewards.weight(config.energy_weight)
        if gamma == 0:
            raise ValueError("energy_weight is 0: every torque is as good as any other")
        # Of the distance summed over all worlds, one world's motion changes next to nothing.
        beta = 0.0 if config.reward.as_run else rewards.weight(config.reward.target_weight)
        return cls(energy / torque, beta / (gamma * torque), config.reward.target_sharpness)


def reward_optimum(stander: Stander, freq: float, config: EnvConfig, tolerance: float) -> PeriodicMotion:
    """A motion within the limits of `optimum.bound` at `freq` [Hz] whose reward no small change increases.

    Raises InfeasibleError where no motion keeps the limits, ValueError where the reward has no weight on torques.
    """
    return best_for_reward(Program(stander, freq, config.amplitude, tolerance), config)


def best_for_reward(program: Program, config: EnvConfig) -> PeriodicMotion:
    """A motion within the limits of `program` whose reward no small change increases; raises as `reward_optimum` does."""
    terms = RewardTerms.of(config)
    unknowns, before = program.least_torque(), math.inf
    for _ in range(MAX_ITERATIONS):
        program.linearise_about(unknowns)
        (on_a, a_offset), (on_x, x_offset) = _effort_rows(program, config)
        size, speed = _smooth_abs(on_a @ unknowns + a_offset), _smooth_abs(on_x @ unknowns + x_offset)
        closeness = 1.0 / (1.0 + terms.sharpness * (program.head @ unknowns - program.target) ** 2)
        effort = (on_a @ unknowns + a_offset) ** 2 + terms.energy * size * speed
        cost = float(np.mean(effort.sum(axis=1)) - terms.target * np.mean(closeness))
        if before - cost <= CONVERGED * abs(cost):
            break
        before, ratio = cost, speed / size
        # Square roots of the weights of a^2, x^2 and d^2 at each instant.
        of_a = np.sqrt(1.0 + terms.energy * ratio / 2)
        of_x = np.sqrt(terms.energy / ratio / 2)
        of_miss = math.sqrt(terms.target * terms.sharpness) * closeness
        rows = [of_a[..., None] * on_a, of_x[..., None] * on_x]
        unknowns = program.least_squares(
            np.concatenate([*(part.reshape(-1, len(unknowns)) for part in rows), of_miss[:, None] * program.head]),
            np.concatenate([(-of_a * a_offset).ravel(), (-of_x * x_offset).ravel(), of_miss * program.target]),
        )
    return program.motion(unknowns)


def _effort_rows(program: Program, config: EnvConfig) -> tuple[tuple[Array, Array], tuple[Array, Array]]:
    """Normalised torque a and x of all four joints over the unknowns z: a = rows z + offset, (S, 4, v) and (S, 4)."""
    torque, velocity, angle = (
        np.tile(rows, (1, JOINTS_OF_A_KIND, 1)) for rows in (program.torque, program.velocity, program.angle)
    )
    offset = np.tile(np.broadcast_to(program.torque_offset, program.torque.shape[:2]), JOINTS_OF_A_KIND)
    none = np.zeros_like(offset)
    if not config.reward.as_run:
        return (torque, offset), (velocity, none)
    springs, limit = np.array([config.hip_k, config.ankle_k] * JOINTS_OF_A_KIND)[:, None], config.torque_limit
    force = limit * torque - springs * angle - config.joint_damping * velocity
    return (torque, offset), (rewards.velocity_as_run(velocity, force), rewards.velocity_as_run(none, limit * offset))


def reward_terms(motion: PeriodicMotion, config: EnvConfig) -> tuple[float, float]:
    """R_energy and R_torque (paper Eq. 9, 10) as `config` weighs them: mean over a cycle, for one control step."""
    torque, velocity = joint_arrays(motion)
    if config.reward.as_run:
        springs = np.array([config.hip_k, config.ankle_k])
        passive = springs * motion.angle(motion.cycle()) + config.joint_damping * motion.velocity(motion.cycle())
        velocity = rewards.velocity_as_run(velocity, torque - np.tile(passive, JOINTS_OF_A_KIND))
    energy, effort = rewards.effort(torque / config.torque_limit, velocity, config)
    return float(energy.mean()), float(effort.mean())


def _smooth_abs(x: Array) -> Array:
    """|x| (S, 4) without its kink, for each joint; positive unless the joint is zero throughout."""
    scale = np.sqrt(np.mean(x**2, axis=0, keepdims=True))
    return np.asarray(np.sqrt(x**2 + (SMOOTHING * scale) ** 2) + np.finfo(float).tiny)
