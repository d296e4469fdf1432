"""The load: a point mass fixed to the trunk (HAT), at its centre of mass or at `EnvConfig.load_at`."""

import mujoco
import numpy as np
import torch

from envs.config import EnvConfig


def loaded(
    mass: torch.Tensor, com: torch.Tensor, inertia: torch.Tensor, load: torch.Tensor, at: torch.Tensor
) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
    """Mass [kg] (N,), centre of mass [m] (N, 3) and inertia about it [kg m2] (N, 3, 3) of N trunks with their loads.

    mass, com, inertia: those of the trunk alone, one for all or one for each. load: (N,) [kg]. at: where it is, (3,) [m].
    All places and axes are of the trunk's frame.
    """
    total = mass + load
    lever = at - com
    reduced = (mass * load / total)[:, None, None]
    outer = lever[..., :, None] * lever[..., None, :]
    about = (lever**2).sum(-1)[..., None, None] * torch.eye(3, dtype=com.dtype, device=com.device) - outer
    return total, com + (load / total)[:, None] * lever, inertia + reduced * about


class TrunkOfModel:
    """The trunk of a MuJoCo model, whose load can be changed."""

    def __init__(self, model: mujoco.MjModel, config: EnvConfig) -> None:
        """`model` as it is without a load."""
        self._model = model
        self._body = next(i for i in range(model.nbody) if model.body(i).name.endswith("hat"))
        frame = np.zeros(9)
        mujoco.mju_quat2Mat(frame, model.body_iquat[self._body])
        axes = frame.reshape(3, 3)
        inertia = axes @ np.diag(model.body_inertia[self._body]) @ axes.T
        alone = float(model.body_mass[self._body]), model.body_ipos[self._body].copy(), inertia
        self._alone = [torch.tensor(part, dtype=torch.float64) for part in alone]
        self._at = None if config.load_at is None else torch.tensor([config.load_at[0], 0.0, config.load_at[1]]).double()

    def carry(self, load: float) -> None:
        """Give the trunk this load [kg]. MuJoCo's derived constants stay as they are until mj_setConst."""
        mass, com, inertia = self._alone
        self._model.body_mass[self._body] = float(mass) + load
        if self._at is not None:
            _, com, inertia = (part[0] for part in loaded(mass, com, inertia, torch.tensor([load]).double(), self._at))
            self._model.body_ipos[self._body] = com.numpy()
            moments, axes = np.linalg.eigh(inertia.numpy())
            axes[:, 0] *= np.sign(np.linalg.det(axes))  # a rotation, not a reflection
            self._model.body_inertia[self._body] = moments
            mujoco.mju_mat2Quat(self._model.body_iquat[self._body], axes.ravel())
