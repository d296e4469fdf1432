"""In MuJoCo the feet of a swaying body creep; subtracting J'v from the reference acceleration of contacts stops it.

python benchmarks/contact_creep.py     needs mujoco and numpy only

Stiff joint springs move hips and ankles in anti-phase at 1.5 Hz, about as in this task. MuJoCo's reference acceleration of a
contact, -B J v - K I dist, leaves out J'v, here the centripetal acceleration of leg and trunk (docs/physics.md). With the
share 1 - B h / 2 of it subtracted, the displacement of a step vanishes.
"""

from pathlib import Path

import mujoco
import numpy as np

BODY = Path(__file__).parent.parent / "envs/body/humanoid.xml"
FREQ, STIFFNESS, DAMPING = 1.5, 20_000.0, 500.0  # [Hz], [Nm/rad], [Nm s/rad]
MEAN, SWING = np.tile(np.radians([-2.0, -3.0]), 2), np.tile(np.radians([14.0, -3.7]), 2)  # hip, ankle; left, right


def creep(correct: bool, step: float, seconds: float = 30.0) -> float:
    """How far forward the left foot has moved [mm]."""
    model = mujoco.MjModel.from_xml_path(str(BODY))
    model.opt.timestep = step
    model.jnt_stiffness[1:], model.dof_damping[6:], model.dof_armature[6:] = STIFFNESS, DAMPING, 0.05
    data = mujoco.MjData(model)
    dot, turn = np.zeros((2, 3, model.nv))
    for _ in range(round(seconds / step)):
        fade = min(data.time / 3.0, 1.0)
        data.qfrc_applied[6:] = STIFFNESS * fade * (MEAN + SWING * np.sin(2 * np.pi * FREQ * data.time))
        mujoco.mj_step1(model, data)
        for contact in data.contact if correct else ():
            radius, frame = model.geom_size[contact.geom[1], 0], contact.frame.reshape(3, 3)
            centre = contact.pos + (radius + contact.dist / 2) * frame[0]
            mujoco.mj_jacDot(model, data, dot, turn, centre, model.geom_bodyid[contact.geom[1]])
            bias = frame @ (dot @ data.qvel - radius * np.cross(turn @ data.qvel, frame[0]))
            edges = np.outer(contact.friction[:2] * bias[1:], (1, -1)).ravel()
            damping = 2 / (contact.solimp[1] * max(contact.solref[0], 2 * step))
            data.efc_aref[contact.efc_address :][:4] -= (1 - damping * step / 2) * (bias[0] + edges)
        mujoco.mj_step2(model, data)
    return 1e3 * float(data.body("foot_left").xpos[0])


if __name__ == "__main__":
    for step in (0.0083, 0.002):
        print(
            f"step {1e3 * step:g} ms: foot moved {creep(False, step):.2f} mm in MuJoCo, {creep(True, step):.2f} mm with J'v"
        )
