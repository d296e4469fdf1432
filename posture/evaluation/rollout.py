"""A deterministic policy in the environment, recorded as a `Trajectory`."""

import contextlib
from collections.abc import Callable, Iterator

import numpy as np
import torch
from rsl_rl.models import MLPModel
from tensordict import TensorDict

from envs.task.head_tracking import HeadTrackingEnv
from posture.analysis.trajectory import Trajectory

Policy = Callable[[TensorDict], torch.Tensor]

MIN_LOAD_N = 1.0
"""With less force under the feet than this the centre of pressure is undefined [N]."""

CHECKED_STEPS = 100
"""Control steps between two checks for contacts that the solver had no room for; a GPU is waited for."""


def rollout(
    env: HeadTrackingEnv,
    policy: Policy,
    freq: torch.Tensor | None,
    duration: float,
    before_step: Callable[[int], None] | None = None,
) -> Trajectory:
    """Let `policy` act in every world of `env` from standing, for `duration` [s]; world i follows `freq`[i] [Hz] (N,).

    `freq` None leaves the targets to the environment's own configuration. `before_step`, called with the number of each
    control step from 0 on, may change what happens to the stander, such as its target. Whatever ends an episode in `env`
    counts as a fall: from then on the record of that world is nan. Raises `ConstraintOverflowError` where a limit of the
    solver was exceeded.
    """
    steps = round(duration / env.config.control_dt)
    if freq is not None:
        env.follow(freq)
    observation = env.reset_all()
    if isinstance(policy, MLPModel):
        policy.reset()  # a recurrent one starts without memory
    followed = env.episodes.freq.clone() if freq is None else freq
    if freq is None and env.config.ramp is not None:
        followed = torch.full_like(followed, torch.nan)
    fall_step = torch.full((env.num_envs,), -1, dtype=torch.long, device=env.sim.device)
    records: dict[str, list[torch.Tensor]] = {name: [] for name in _SIGNALS}
    with torch.inference_mode(), one_thread():
        for step in range(steps):
            if before_step is not None:
                before_step(step)
            observation, _, done, extras = env.step(policy(observation))
            fell = done & ~extras["time_outs"] & (fall_step < 0)
            fall_step = torch.where(fell, step, fall_step)
            for name, signal in _SIGNALS.items():
                records[name].append(signal(env).double())
            if step % CHECKED_STEPS == 0:  # not only at the end, after minutes of physics that is not as configured
                env.sim.check_capacity()
    env.sim.check_capacity()
    arrays = {name: torch.stack(values).cpu().numpy() for name, values in records.items()}
    for world, fall in enumerate(fall_step.tolist()):
        if fall >= 0:
            for name in arrays:
                arrays[name][fall:, world] = np.nan
    flat = arrays.pop("foot_flat") == 1.0
    return Trajectory(
        time=env.config.control_dt * np.arange(1, steps + 1, dtype=np.float64),
        freq=followed.double().cpu().numpy(),
        hip_k=env.sim.hip_k.double().cpu().numpy(),
        ankle_k=env.sim.ankle_k.double().cpu().numpy(),
        load=env.sim.load.double().cpu().numpy(),
        fall_step=fall_step.cpu().numpy(),
        foot_flat=flat,
        torque_limit=env.config.torque_limit,
        control_dt=env.config.control_dt,
        **arrays,
    )


@contextlib.contextmanager
def one_thread() -> Iterator[None]:
    """In this context torch uses one thread: the few worlds of a trial gain nothing from more, and on a busy machine threads
    spend most of their time waiting for each other."""
    before = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        yield
    finally:
        torch.set_num_threads(before)


def _cop_x(env: HeadTrackingEnv) -> torch.Tensor:
    """Centre of pressure of both feet along x in the foot frame [m], nan while they carry no load. (N,)."""
    vertical = env.sim.sole_force[..., 2].flatten(1)
    along = env.sim.sole_position[..., 0].flatten(1)
    load = vertical.sum(-1)
    return torch.where(load > MIN_LOAD_N, (vertical * along).sum(-1) / load.clamp(min=MIN_LOAD_N), torch.nan)


_SIGNALS: dict[str, Callable[[HeadTrackingEnv], torch.Tensor]] = {
    "target_x": lambda env: env.state.target_x,
    "head_x": lambda env: env.state.head_x,
    "head_vx": lambda env: env.state.head_vx,
    "joint_angle": lambda env: env.sim.joint_angle,
    "joint_velocity": lambda env: env.sim.joint_velocity,
    "joint_torque": lambda env: env.config.torque_limit * env.state.action,
    "cop_x": _cop_x,
    "torso_height": lambda env: env.state.hat_pose[:, 2],
    "foot_displacement": lambda env: env.state.foot_displacement.amax(-1),
    "foot_flat": lambda env: (env.sim.sole_force[..., 2] > 0.0).all(-1).all(-1).float(),
}
