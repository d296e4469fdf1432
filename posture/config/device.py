"""Checks of the device: whether it exists, and whether the engine can compute on it."""

import re

from envs.config import Physics
from posture.config.errors import ConfigError


def check_device(device: str) -> None:
    """Raise ConfigError unless torch can compute on `device` here."""
    if not re.fullmatch(r"cpu|cuda(:[0-9]{1,4})?", device):
        raise ConfigError(f"device: {device!r} is not known; allowed are cpu, cuda, cuda:0, cuda:1, ...")
    if device == "cpu":
        return
    import torch

    if not torch.cuda.is_available():
        raise ConfigError(f"device: '{device}' asks for CUDA, but torch {torch.__version__} finds no CUDA device; use cpu")
    if int(device.partition(":")[2] or 0) >= torch.cuda.device_count():
        raise ConfigError(f"device: '{device}' does not exist; this machine has {torch.cuda.device_count()} CUDA devices")


def check_engine(physics: Physics | None, device: str) -> None:
    """Raise ValueError unless the engine, if one is named, can compute on `device`."""
    if physics == "mujoco_c" and device != "cpu":
        raise ValueError(f"device: env.physics=mujoco_c computes only on the cpu, not on '{device}'")
