"""The bias acceleration of contacts, which MuJoCo leaves out of their reference acceleration.

A contact with the Jacobian J(q), whose rows are its normal and its directions of friction, moves at J v and accelerates by
J a + J'v, where J' is the derivative of J by time. MuJoCo asks for J a = -B J v - K I dist, with no J'v in it. It corrects
for J'v in the equality constraints `connect` and `weld`, but not in contacts. J'v therefore acts on the contact like a
force. Here it is the centripetal acceleration of leg and trunk. A stander who leans forward feels it in one direction, so
the soles creep, whatever the friction.

The speed of the creep. Let B be the damping of the reference acceleration [1/s], h the time step, and u = J_k v_k+1 the
velocity of the contact point in a step of semi-implicit Euler. In the steady state

    J_k+1 v_k+2 = (1 - B h) J_k+1 v_k+1 = (1 - B h) (u + h J'v) = u,     so     u = (1/B - h) J'v,

and in each step the point moves by h (u + h J'v / 2): it creeps at (1/B - h/2) J'v. With c J'v subtracted from the reference
acceleration it creeps at (1/B - h/2 - c/B) J'v, which is zero for

    c = 1 - B h / 2.

c tends to 1 with shorter steps. docs/physics.md has the measurements. J' is that of a ball on a plane: its point of contact
stays below its centre, at the distance of its radius r, so J'v is that of the centre, plus, for motion in three dimensions,
(J_r'v) x (-r n) with the Jacobian J_r of rotation and the normal n.
"""

import mujoco
import numpy as np

from envs.config import EnvConfig


def stiffness_and_damping(solref: np.ndarray, solimp: np.ndarray, step: float) -> tuple[float, float]:
    """MuJoCo's K [1/s2] and B [1/s] from solref, [time constant, damping ratio] or [-K, -B], at time step `step` [s]."""
    high = float(solimp[1])
    if solref[0] > 0.0:
        time = max(float(solref[0]), 2.0 * step)  # MuJoCo takes no time constant below two time steps
        return 1.0 / (high * time * float(solref[1])) ** 2, 2.0 / (high * time)
    return -float(solref[0]) / high**2, -float(solref[1]) / high


def sole_contact(model: mujoco.MjModel) -> tuple[np.ndarray, np.ndarray, float]:
    """solref, solimp and sliding friction of a contact of sole and ground: MuJoCo combines them from the two surfaces."""
    data = mujoco.MjData(model)
    data.qpos[2] -= 1e-3
    mujoco.mj_forward(model, data)
    contact = data.contact[0]
    return contact.solref.copy(), contact.solimp.copy(), float(contact.friction[0])


def bias_share(config: EnvConfig, model: mujoco.MjModel) -> float:
    """The share c of J'v that the reference acceleration of contacts includes; 0, as in MuJoCo, without
    `solver.contact_bias`."""
    if not config.solver.contact_bias:
        return 0.0
    step = config.control_dt / config.solver.substeps
    solref, solimp, _ = sole_contact(model)
    _, damping = stiffness_and_damping(solref, solimp, step)
    return 1.0 - 0.5 * damping * step


def subtract_bias(model: mujoco.MjModel, data: mujoco.MjData, share: float) -> None:
    """Subtract `share` of J'v from the reference accelerations of all contacts between balls or capsules and the ground.

    To be called between mj_step1, which computes them, and mj_step2, for a pyramidal cone.
    """
    move_dot, turn_dot = np.zeros((2, 3, model.nv))
    for contact in data.contact:
        if contact.efc_address < 0:
            continue
        frame = contact.frame.reshape(3, 3)
        geom = contact.geom[1]  # the ground is the first, since planes come first by type
        radius = model.geom_size[geom, 0]
        # The point of contact lies halfway between the ball's lowest point and the ground.
        centre = contact.pos + (radius + 0.5 * contact.dist) * frame[0]
        mujoco.mj_jacDot(model, data, move_dot, turn_dot, centre, model.geom_bodyid[geom])
        bias = frame @ (move_dot @ data.qvel - radius * np.cross(turn_dot @ data.qvel, frame[0]))
        edges = np.outer(contact.friction[: contact.dim - 1] * bias[1 : contact.dim], [1.0, -1.0]).ravel()
        data.efc_aref[contact.efc_address :][: edges.size] -= share * (bias[0] + edges)
