"""Early terminations, one function each: tensors of N worlds in, bool (N,) out. Limits are in conf/env/."""

import torch


def fallen(torso_height: torch.Tensor, limit: float) -> torch.Tensor:
    """The torso is below `limit` [m] (paper: 1 m)."""
    return torso_height < limit


def foot_moved(foot_displacement: torch.Tensor, limit: float) -> torch.Tensor:
    """A foot is `limit` [m] or more from where it started (authors' code: 0.1 m). foot_displacement: (N, 2)."""
    return (foot_displacement >= limit).any(-1)


def head_off_target(error: torch.Tensor, limit: float) -> torch.Tensor:
    """The head is `limit` [m] or more from the target along x (authors' code: 0.025 m)."""
    return error.abs() >= limit
