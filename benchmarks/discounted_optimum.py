"""What a discount below one costs: the motion of a linear stander that minimises the discounted sum of squared torques.

python benchmarks/discounted_optimum.py     about a minute; docs/learning.md has its means

A learner that discounts a reward k control steps ahead by gamma^k has another optimum than the motion of least cost. Here a
plan for the next steps is optimised again every 40 control steps, from rest until the motion repeats. At each control step
the head is within its tolerance and the centre of pressure inside the foot. Between two steps these limits may be exceeded,
so that ratios can be too low by some 0.003.
"""

import math

import clarabel
import numpy as np
import scipy.sparse as sparse
from shared import compose

from envs.body.segments import read_segments
from posture.analysis.coordination import correlation
from posture.theory.motion import motion_indices
from posture.theory.optimum import bound
from posture.theory.stander import JOINTS_OF_A_KIND, Stander, linearise

DISCOUNTS = (0.97, 0.98, 0.985, 0.99)
REPLANNED_AFTER = 40  # control steps
NEGLIGIBLE = 2e-3
"""A plan ends where the discount has come down to this share, or after 900 steps."""


def discounted(
    stander: Stander, freq: float, amplitude: float, tolerance: float, dt: float, gamma: float
) -> tuple[float, float]:
    """Cost (mean of the sum over the four joints of the squared normalised torque) and hip-ankle correlation of a cycle."""
    n = int(min(math.log(NEGLIGIBLE) / math.log(gamma), 900))
    a, b, c = stander.step(dt)
    b = stander.torque_limit * b

    # For each step the unknowns are its normalised torque (hip, ankle) and the state (angles, velocities) at its end.
    motion = sparse.kron(sparse.eye(n), np.hstack([-b, np.eye(4)])) + sparse.kron(
        sparse.eye(n, k=-1), np.hstack([np.zeros((4, 2)), -a])
    )
    head = sparse.kron(sparse.eye(n), np.concatenate([np.zeros(2), stander.head, np.zeros(2)])[None])
    # The joints' acceleration is M^-1 (2 tau - D q' - K q - o).
    per_moment = stander.cop_acceleration @ np.linalg.inv(stander.mass)
    of_torque = JOINTS_OF_A_KIND * stander.torque_limit * per_moment
    of_angle, of_velocity = stander.cop_angle - per_moment @ stander.stiffness, -per_moment @ stander.damping
    cop = sparse.kron(sparse.eye(n), np.concatenate([of_torque, of_angle, of_velocity])[None])
    cop_offset = stander.cop_offset - per_moment @ stander.offset
    scale = (30.0, 10.0)  # rows of order one for the solver
    rows = sparse.vstack([scale[0] * motion, *(scale[1] * part for part in (head, -head, cop, -cop))]).tocsc()
    quadratic = 2.0 * sparse.kron(sparse.diags(gamma ** np.arange(n)), np.diag([JOINTS_OF_A_KIND] * 2 + [0] * 4)).tocsc()
    cones = [clarabel.ZeroConeT(4 * n), clarabel.NonnegativeConeT(4 * n)]
    settings = clarabel.DefaultSettings()
    settings.verbose = False

    state, torques, angles = np.zeros(4), [], []
    for first in range(0, int(2.5 / freq / dt) + 300, REPLANNED_AFTER):
        target = amplitude * (1.0 - np.cos(2 * math.pi * freq * dt * (first + 1 + np.arange(n))))
        free = np.tile(c, n)
        free[:4] += a @ state
        bounds = (
            target + tolerance,
            tolerance - target,
            np.full(n, stander.toe_x - cop_offset),
            np.full(n, cop_offset - stander.heel_x),
        )
        limit = np.concatenate([scale[0] * free, *(scale[1] * part for part in bounds)])
        solution = clarabel.DefaultSolver(quadratic, np.zeros(6 * n), rows, limit, cones, settings).solve()
        assert "Solved" in str(solution.status), solution.status
        plan = np.array(solution.x).reshape(n, 6)[:REPLANNED_AFTER]
        torques.append(plan[:, :2])
        angles.append(plan[:, 2:4])
        state = plan[-1, 2:]
    cycles = max(1, math.floor(freq))
    last = round(cycles / freq / dt)
    torque, angle = np.concatenate(torques)[-last:], np.concatenate(angles)[-last:]
    return float(JOINTS_OF_A_KIND * (torque**2).sum(axis=1).mean()), correlation(angle[:, 0], angle[:, 1])


def main() -> None:
    """Print the ratio to the least cost, and the correlation, for each discount and frequency."""
    run = compose()
    env, evaluation = run.env, run.evaluation
    stander = linearise(read_segments(env), env)
    print("discount " + " ".join(f"{freq:>11.2f}" for freq in evaluation.freq) + "   mean")
    for gamma in DISCOUNTS:
        ratios: list[float] = []
        texts = []
        for freq in evaluation.freq:
            least = motion_indices(bound(stander, freq, env.amplitude, evaluation.tolerance), evaluation.duration).cost
            cost, r = discounted(stander, freq, env.amplitude, evaluation.tolerance, env.control_dt, gamma)
            ratios.append(cost / least)
            texts.append(f"{cost / least:.3f} {r:+.2f}")
        print(f"{gamma:<8} " + " ".join(f"{text:>11}" for text in texts) + f"   {np.mean(ratios):.3f}", flush=True)


if __name__ == "__main__":
    main()
