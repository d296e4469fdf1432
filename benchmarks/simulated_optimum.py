"""The periodic motion that maximises the reward in the simulation itself, beside that of the linear stander.

python benchmarks/simulated_optimum.py [--freq 0.6 0.65] [--seed 1] [-- env.reward.target_sharpness=180]

3 minutes for each frequency; docs/learning.md has its result.

The linear theory knows neither large angles nor soft ground. Here the model-based controller (posture/theory/lqr.py) follows
a motion whose harmonics are varied by the cross-entropy method: many worlds try variations of one motion, and the next
variations are drawn from the normal distribution of the best. The search starts from the linear optimum.
"""

import argparse
import math

import numpy as np
import torch
from shared import compose

from envs.body.segments import read_segments
from envs.task.head_tracking import HeadTrackingEnv
from envs.task.observations import hip_ankle_angle
from posture.analysis.coordination import correlation, sign_change_frequency
from posture.analysis.trajectory import Array
from posture.cli import jobs
from posture.config.eval import EvalConfig, LqrConfig
from posture.evaluation.lqr_policy import flat_foot_state
from posture.theory.lqr import gain, reference
from posture.theory.motion import PeriodicMotion, motion_indices
from posture.theory.optimum import bound
from posture.theory.reward_optimum import reward_optimum
from posture.theory.stander import Stander, linearise
from posture.theory.transition import hip_ankle_correlation

HARMONICS = 6
"""Of the motion that is searched; theory has twelve."""
WORLDS, BEST, GENERATIONS = 512, 128, 40
FIRST_DEVIATION = 0.003
"""Standard deviation of the first variations [rad]; of the n-th harmonic, divided by n squared."""
SETTLED = 6.0
"""Seconds from standing after which rewards count, for two cycles."""


def motion(stander: Stander, freq: float, unknowns: Array) -> PeriodicMotion:
    """Unknowns: constant angles of hip and ankle [rad], then real and imaginary parts of their harmonics. (2 + 4 n,)."""
    real, imaginary = unknowns[2:].reshape(2, -1, 2)
    return PeriodicMotion(stander, freq, np.vstack([unknowns[None, :2] + 0j, real + 1j * imaginary]))


class Trial:
    """All worlds follow the target at `freq` [Hz], each with a motion of its own."""

    def __init__(self, env: HeadTrackingEnv, stander: Stander, freq: float, lqr: LqrConfig) -> None:
        dt = env.config.control_dt
        self._env, self._first = env, round(SETTLED / dt)
        self._gain = torch.tensor(gain(stander, dt, lqr), dtype=torch.float32)
        time = dt * np.arange(self._first + round(2 / freq / dt), dtype=np.float64)

        def plan(unknowns: Array) -> Array:
            wanted = motion(stander, freq, unknowns)
            angle, velocity, _ = reference(wanted, time, lqr.fade_in)
            return np.hstack([angle, velocity, reference(wanted, time + dt / 2, lqr.fade_in)[2]])

        # The reference is linear in the unknowns.
        count = 2 + 4 * HARMONICS
        self._offset = plan(np.zeros(count))
        self._per_unknown = np.stack([plan(one) - self._offset for one in np.eye(count)])
        env.follow(torch.full((env.num_envs,), freq, dtype=torch.float64))

    def __call__(self, unknowns: Array) -> tuple[Array, Array, Array]:
        """Mean reward (minus infinity after a fall), cost and hip-ankle correlation of each world; unknowns: (N, v)."""
        env = self._env
        plan = torch.tensor(
            self._offset[:, None] + np.einsum("nv,vtk->tnk", unknowns, self._per_unknown), dtype=torch.float32
        )
        env.reset_all()
        fell = torch.zeros(env.num_envs, dtype=torch.bool)
        rewards, costs, angles = [], [], []
        for step in plan:
            state, correction = flat_foot_state(env)
            feedback = (state - step[:, :4]) @ self._gain.T
            _, reward, done, _ = env.step((step[:, 4:] + correction - feedback) / env.config.torque_limit)
            fell |= done
            rewards.append(reward)
            costs.append((env.state.action**2).sum(-1))
            angles.append(hip_ankle_angle(env.state))
        mean_reward, cost = (torch.stack(values[self._first :]).mean(0) for values in (rewards, costs))
        angle = torch.stack(angles[self._first :], dim=1).double().numpy()
        r = np.array([correlation(world[:, 0], world[:, 1]) for world in angle])
        return torch.where(fell, -math.inf, mean_reward).numpy(), cost.numpy(), r


def search(trial: Trial, start: Array, seed: int) -> Array:
    """The unknowns (v,) of the motion with the largest mean reward found, from those of `start`."""
    random = np.random.default_rng(seed)
    of_harmonic = FIRST_DEVIATION / np.repeat(np.arange(1, HARMONICS + 1), 2) ** 2
    mean, covariance = start, np.diag(np.concatenate([2 * [FIRST_DEVIATION], of_harmonic, of_harmonic]) ** 2)
    for _ in range(GENERATIONS):
        tried = random.multivariate_normal(mean, covariance, WORLDS)
        best = tried[np.argsort(-trial(tried)[0])[:BEST]]
        mean, covariance = best.mean(axis=0), np.cov(best.T)
    return np.asarray(mean)


def main() -> None:
    """Print hip-ankle correlation and ratio of cost to least cost of the linear optimum, of the same followed in the
    simulation, and of the optimum found there, with the latter two's reward; then the frequencies at which they switch."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--freq", type=float, nargs="+", default=[0.6, 0.625, 0.65, 0.675, 0.7], help="[Hz]")
    parser.add_argument("--seed", type=int, default=1, help="of the variations")
    parser.add_argument("overrides", nargs="*", help="Hydra overrides of posture.train, after --")
    arguments = parser.parse_args()
    # An end by the head's tolerance would count as a fall.
    config = compose(
        f"env.num_envs={WORLDS}", "env.episode_steps=100000", "env.termination.head_tolerance=null", *arguments.overrides
    ).env
    lqr = jobs.compose("eval", EvalConfig, "policy=lqr").lqr
    env = HeadTrackingEnv(config, seed=1, device="cpu")
    stander = linearise(read_segments(config), config)
    linear, followed, simulated = [], [], []
    for freq in arguments.freq:
        trial = Trial(env, stander, freq, lqr)
        optimum = reward_optimum(stander, freq, config, config.reward.tolerance)
        constant, harmonics = optimum.coefficients[0], optimum.coefficients[1 : HARMONICS + 1]
        start = np.concatenate([constant.real, harmonics.real.ravel(), harmonics.imag.ravel()])
        end = search(trial, start, arguments.seed)
        reward, cost, r = trial(np.tile([start, end], (WORLDS // 2, 1)))
        linear.append(hip_ankle_correlation(optimum))
        followed.append(float(r[0]))
        simulated.append(float(r[1]))
        least = motion_indices(bound(stander, freq, config.amplitude, config.reward.tolerance), 1.0).cost
        ratio = [motion_indices(optimum, 1.0).cost / least, *(cost[:2] / least)]
        print(
            f"{freq:.3f} Hz: linear r {linear[-1]:+.3f} ratio {ratio[0]:.3f}; followed {r[0]:+.3f} {ratio[1]:.3f}; "
            f"simulated {r[1]:+.3f} {ratio[2]:.3f}; reward {reward[0]:.5f} -> {reward[1]:.5f}",
            flush=True,
        )
    for name, values in {"linear": linear, "followed": followed, "simulated": simulated}.items():
        print(f"{name}: switch at {sign_change_frequency(arguments.freq, values)} Hz")


if __name__ == "__main__":
    main()
