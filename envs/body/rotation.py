"""Quaternions x y z w, as Newton stores them, in torch."""

import torch


def rotate(quaternion: torch.Tensor, vector: torch.Tensor) -> torch.Tensor:
    """`vector` (..., 3) rotated by `quaternion` (..., 4), with equal numbers of dimensions; broadcast. Shape (..., 3)."""
    axis, w = quaternion[..., :3], quaternion[..., 3:]
    twice = 2.0 * torch.linalg.cross(axis, vector, dim=-1)
    return vector + w * twice + torch.linalg.cross(axis, twice, dim=-1)


def pitch(quaternion: torch.Tensor) -> torch.Tensor:
    """Forward lean [rad]: angle of the rotated z axis from the vertical in the x-z plane. (..., 4) -> (...)."""
    x, y, z, w = quaternion.unbind(-1)
    return torch.atan2(2 * (x * z + w * y), 1 - 2 * (x * x + y * y))


def roll(quaternion: torch.Tensor) -> torch.Tensor:
    """Roll [rad] of the yaw-pitch-roll angles, positive about +x. (..., 4) -> (...)."""
    x, y, z, w = quaternion.unbind(-1)
    return torch.atan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y))


def yaw(quaternion: torch.Tensor) -> torch.Tensor:
    """Yaw [rad] of the yaw-pitch-roll angles, positive about +z. (..., 4) -> (...)."""
    x, y, z, w = quaternion.unbind(-1)
    return torch.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))


def upright(quaternion: torch.Tensor) -> torch.Tensor:
    """Vertical component of the rotated z axis, 1 when upright. (..., 4) -> (...)."""
    x, y = quaternion[..., 0], quaternion[..., 1]
    return 1 - 2 * (x * x + y * y)
