"""In MuJoCo a foot under a swinging pole creeps if the pole is the root of the tree, and not if the foot is.

python benchmarks/contact_creep.py     needs mujoco and numpy only; about 10 s

The two models are the same mechanics in other coordinates. MuJoCo's reference acceleration of a contact, -B J v - K I dist,
leaves out J'v, which is zero where the body in contact is the root. With the share 1 - B h / 2 of J'v subtracted, a step's
displacement vanishes, and both models agree (docs/physics.md). What remains is of the time step, and shrinks with it.
"""

import argparse

import mujoco
import numpy as np

FOOT = """<geom type="capsule" fromto="-.4 .2 -.05 .9 .2 -.05" size=".02" mass="2"/>
<geom type="capsule" fromto="-.4 -.2 -.05 .9 -.2 -.05" size=".02" mass="2"/>"""
POLE = '<geom type="sphere" size=".1" mass="40"/>'
MODEL = """<mujoco><option timestep="{step}"/><worldbody><geom type="plane" size="9 9 1"/>
<body name="{root}" pos="0 0 {z}"><freejoint/>{first}<body name="{child}" pos="0 0 {below}">
<joint pos="{pivot}" axis="0 {axis} 0" stiffness="4000" damping="100" armature=".05"/>{second}</body></body>
</worldbody></mujoco>"""
LEAN, SWING, FREQ = 0.3, 0.2, 0.5  # [rad], [rad], [Hz]


def creep(root: str, correct: bool, step: float) -> float:
    """How far forward the foot moves [mm] within 20 s, after 4 s in which the motion is faded in and settles."""
    values = {
        "foot": dict(root="foot", z=0.07, first=FOOT, child="pole", below=0.9, pivot="0 0 -.9", axis=1, second=POLE),
        "pole": dict(root="pole", z=0.97, first=POLE, child="foot", below=-0.9, pivot="0 0 0", axis=-1, second=FOOT),
    }[root]
    model = mujoco.MjModel.from_xml_string(MODEL.format(step=step, **values))
    data = mujoco.MjData(model)
    dot, turn = np.zeros((2, 3, model.nv))
    for k in range(round(24.0 / step)):
        if k == round(4.0 / step):
            start = data.body("foot").xpos[0]
        data.qfrc_applied[6] = 4000 * min(data.time, 1.0) * (LEAN + SWING * np.sin(2 * np.pi * FREQ * data.time))
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
    return 1e3 * float(data.body("foot").xpos[0] - start)


if __name__ == "__main__":
    argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter).parse_args()
    for step in (0.004, 0.002, 0.001):
        moved = [creep(*case, step) for case in (("pole", False), ("foot", False), ("pole", True))]
        print(
            "step {:g} ms: root pole {:.2f} mm, root foot {:.2f} mm, root pole with J'v {:.2f} mm".format(1e3 * step, *moved)
        )
