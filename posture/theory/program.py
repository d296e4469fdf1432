"""Periodic motions of the linear stander that keep the head within a tolerance of its target, the centre of pressure inside
the foot and the torques within their limit: convex programs in the Fourier coefficients of the joint angles.

With n harmonics of the target's frequency, q(t) = Re sum_k Q_k exp(i k omega t), k = 0..n, every output of the stander is
linear in the unknowns Re Q_k, Im Q_k, harmonic by harmonic (`Stander.torque_response`, `cop_response`, `head`). Sampled at
S instants of a cycle, a quadratic cost and the limits make a quadratic program, which the interior-point solver Clarabel
(Goulart and Chen 2024) solves.

The result differs from the optimum over all periodic motions in two ways, both small and measured by tests: n is finite,
which makes the cost slightly too high, and between two samples a limit may be slightly exceeded.
"""

from __future__ import annotations

import math
from typing import Any

import clarabel
import numpy as np
import scipy.sparse
from numpy.typing import NDArray

from posture.analysis.trajectory import Array
from posture.theory.motion import PeriodicMotion
from posture.theory.stander import Stander

HARMONICS = 12
"""Harmonics of the target's frequency. Twice as many lower the least cost by less than 0.1 %."""
LIMIT_SAMPLES = 96
"""Samples of a cycle at which the limits hold. Between two of them the head exceeds the tolerance by less than 0.05 mm."""

_SOLVED = (clarabel.SolverStatus.Solved, clarabel.SolverStatus.AlmostSolved)
_INFEASIBLE = (clarabel.SolverStatus.PrimalInfeasible, clarabel.SolverStatus.AlmostPrimalInfeasible)


class InfeasibleError(ValueError):
    """No periodic motion of the linear stander keeps the limits; the message is one line that names the task."""


class UndecidedError(InfeasibleError):
    """At the edge of what is possible, the solver found neither a motion within the limits nor that there is none."""


class Program:
    """One stander following the target A (1 - cos omega t) of amplitude A [m] at `freq` [Hz] within `tolerance` [m].

    Attributes, S samples of a cycle and v unknowns:
        torque, velocity, angle: normalised torque [-], velocity [rad/s] and angle [rad] of one joint, (hip, ankle), over the
            unknowns, (S, 2, v). torque_offset: normalised torque at q = 0, (2,), or (S, 2) where it is not the same
            throughout.
        head: [m] over the unknowns, (S, v). target: [m], (S,).
    """

    def __init__(
        self,
        stander: Stander,
        freq: float,
        amplitude: float,
        tolerance: float,
        harmonics: int = HARMONICS,
        samples: int = LIMIT_SAMPLES,
    ) -> None:
        if samples <= 2 * harmonics:
            raise ValueError(f"samples: {samples} cannot resolve {harmonics} harmonics; at least {2 * harmonics + 1}")
        self.stander, self.freq, self.amplitude, self.tolerance = stander, freq, amplitude, tolerance
        order = np.arange(harmonics + 1, dtype=np.float64)
        omega = 2 * math.pi * freq * order
        self._waves = np.exp(2j * math.pi * np.multiply.outer(np.arange(samples) / samples, order))
        self.torque = self._rows(stander.torque_response(omega)) / stander.torque_limit
        self.torque_offset = stander.torque_offset / stander.torque_limit
        self.velocity = self._rows(1j * np.multiply.outer(omega, np.eye(2)))
        self.angle = self._rows(np.broadcast_to(np.eye(2), (harmonics + 1, 2, 2)))
        self.head = self._rows(np.broadcast_to(stander.head, (harmonics + 1, 1, 2)))[:, 0]
        self.target = amplitude * (1.0 - self._waves[:, 1].real)
        self._keep_limits(self._rows(stander.cop_response(omega)[:, None])[:, 0], stander.cop_offset)

    def _keep_limits(self, cop: Array, cop_offset: Array | float) -> None:
        """Set the limits of `least_squares` from the attributes and the centre of pressure [m], cop z + cop_offset: (S, v)
        and (S,) or one number."""
        foot, one = self.stander.toe_x - self.stander.heel_x, np.ones(len(self.target))
        offset = self.torque_offset.T
        # Lower and upper bound of each output, divided by a scale, so that the solver works with numbers of order one.
        limits = [
            (self.head, self.target - self.tolerance, self.target + self.tolerance, self.amplitude),
            (cop, (self.stander.heel_x - cop_offset) * one, (self.stander.toe_x - cop_offset) * one, foot),
            *((self.torque[:, joint], -one - offset[joint], one - offset[joint], 1.0) for joint in range(2)),
        ]
        rows = [side * output / scale for output, _, _, scale in limits for side in (-1.0, 1.0)]
        bounds = [bound / scale for _, low, high, scale in limits for bound in (-low, high)]
        self._limit, self._bound = scipy.sparse.csc_matrix(np.concatenate(rows)), np.concatenate(bounds)

    def linearise_about(self, unknowns: Array) -> None:
        """Nothing: the outputs of the linear stander have the same slopes about every motion."""

    def least_squares(self, rows: Array, wanted: Array) -> Array:
        """The unknowns (v,) that minimise |rows z - wanted|^2 within the limits; rows (r, v), wanted (r,).

        Raises InfeasibleError where no unknowns keep the limits.
        """
        quadratic = scipy.sparse.csc_matrix(np.triu(rows.T @ rows / len(wanted)))
        linear = -rows.T @ wanted / len(wanted)
        settings = clarabel.DefaultSettings()
        settings.verbose = False
        cones = [clarabel.NonnegativeConeT(len(self._bound))]
        solution = clarabel.DefaultSolver(quadratic, linear, self._limit, self._bound, cones, settings).solve()
        if solution.status in _INFEASIBLE:
            raise InfeasibleError(
                f"{self._task()}: cannot be met with the centre of pressure inside the foot "
                f"({self.stander.heel_x:g}..{self.stander.toe_x:g} m) and {self.stander.torque_limit:g} Nm a joint"
            )
        if solution.status not in _SOLVED:
            raise UndecidedError(f"{self._task()}: the solver ended with {solution.status}")
        return np.asarray(solution.x, dtype=np.float64)

    def least_torque(self) -> Array:
        """The unknowns (v,) of the least mean of squared torques within the limits. Raises InfeasibleError."""
        rows = self.torque.reshape(-1, self.torque.shape[-1])
        return self.least_squares(rows, -np.broadcast_to(self.torque_offset, self.torque.shape[:2]).ravel())

    def motion(self, unknowns: Array) -> PeriodicMotion:
        """The motion that the unknowns (v,) stand for."""
        pairs, count = unknowns.reshape(-1, 2), self._waves.shape[1]
        coefficients = pairs[:count].astype(np.complex128)
        coefficients[1:] += 1j * pairs[count:]
        return PeriodicMotion(self.stander, self.freq, coefficients)

    def _rows(self, response: NDArray[Any]) -> Array:
        """Samples of Re sum_k response_k Q_k exp(i k omega t) over the unknowns. (n + 1, out, 2) complex -> (S, out, v)."""
        waves = self._waves[:, :, None, None] * response
        # Re((R + i I)(a + i b)) = R a - I b; the constant term has no b.
        parts = np.concatenate([waves.real, -waves.imag[:, 1:]], axis=1)
        return np.asarray(parts.transpose(0, 2, 1, 3).reshape(len(waves), response.shape[1], -1))

    def _task(self) -> str:
        return f"head motion of {self.amplitude:g} m within {self.tolerance:g} m at {self.freq:g} Hz"
