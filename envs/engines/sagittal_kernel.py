"""The stander in the sagittal plane: a Warp kernel that takes N worlds through a whole control step.

Left and right get the same command, so they move together and the motion stays in the x-z plane. The planar body has three
segments, HAT (1), both legs (2) and both feet (3), and five coordinates: position p = (x, z) of the HAT's frame and the
forward pitches th1, th2, th3. The equations are those that MuJoCo solves for the full body (its documentation,
"Computation"), written for this motion without further approximation; the two engines differ by rounding only
(tests/envs/engines/test_sagittal.py).

Kinematics. R(th) v = (vx cos th + vz sin th, vz cos th - vx sin th) rotates from the body's x-z axes to the world's; its
derivative by th is (Rv)' = ((Rv)_z, -(Rv)_x), and the second is -Rv. With b1 from HAT frame to hip, b2 from hip to ankle,
a_i from the joint above (1: HAT frame) to the centre of mass, capitals rotated:

    c1 = p + A1,   c2 = p + B1 + A2,   c3 = p + B1 + B2 + A3,   phi_hip = th2 - th1,   phi_ankle = th3 - th2.

Dynamics. Collecting kinetic energy by the pitches, with m = m1 + m2 + m3 and the first moments

    e1 = m1 a1 + (m2 + m3) b1,   e2 = m2 a2 + m3 b2,   e3 = m3 a3          (E_i rotated):

    M_xx = M_zz = m,  M_x,i = E_iz,  M_z,i = -E_ix,  M_12 = B1.E2,  M_13 = B1.E3,  M_23 = B2.E3,  and constant
    M_11 = I1 + m1 a1^2 + (m2 + m3) b1^2,   M_22 = I2 + m2 a2^2 + m3 b2^2,   M_33 = I3 + m3 a3^2,

plus the armature r of each joint, r (phi')^2 / 2. Since a rotating vector V accelerates by -th'^2 V, centripetal terms
leave the generalised forces

    F_x = sum E_ix th_i'^2,   F_z = sum E_iz th_i'^2 - m g,
    F_1 = g E_1x + (B1 x E2) th2'^2 + (B1 x E3) th3'^2,
    F_2 = g E_2x - (B1 x E2) th1'^2 + (B2 x E3) th3'^2,   F_3 = g E_3x - (B1 x E3) th1'^2 - (B2 x E3) th2'^2,

with V x W = V_z W_x - V_x W_z, and joint torques u = actuator - k phi - d phi' that enter as -u on the parent, +u on the
child.

Contact. Heel and toe are balls at the ends of the sole; envs/engines/sagittal_contact.py has the forces. The ball whose
centre lies e from the ankle has the bias acceleration J'v = -(B1 th1'^2 + B2 th2'^2 + E th3'^2), of which the share
`contact_bias` enters the reference acceleration (envs/engines/contact_bias.py).

Time step, MuJoCo's semi-implicit Euler with implicit damping d: v += h (M + h d)^-1 (F + contact forces), q += h v.
"""

import warp as wp

from envs.engines.sagittal_contact import (
    Softness,
    accelerate,
    active_edges,
    edge_forces,
    impedance,
    mat5,
    mat65,
    solve,
    vec4,
    vec5,
    vec6,
)


@wp.struct
class Body:
    """Constants of the planar stander; legs, feet and joints of both sides together. See the module's docstring."""

    hat_mass: float
    leg_mass: float
    foot_mass: float
    hat_inertia: float
    leg_inertia: float
    foot_inertia: float
    hat_com: wp.vec2
    load: wp.vec2
    leg_com: wp.vec2
    foot_com: wp.vec2
    hip: wp.vec2
    ankle: wp.vec2
    leg_frame: wp.vec2
    foot_frame: wp.vec2
    heel: wp.vec2
    toe: wp.vec2
    sole_radius: float
    half_width: wp.vec2
    joint_armature: float
    lower: wp.vec2
    upper: wp.vec2
    gravity: float
    contact: Softness
    contact_bias: float
    limit: Softness


@wp.struct
class Worlds:
    """The arrays of `SagittalSimulation` that a step changes: coordinates, and what `Simulation` has of each world."""

    q: wp.array[vec5]
    qd: wp.array[vec5]
    qdd: wp.array[vec5]
    diverged: wp.array[wp.bool]
    joint_angle: wp.array2d[float]
    joint_velocity: wp.array2d[float]
    joint_force: wp.array2d[float]
    body_pose: wp.array2d[wp.transform]
    body_velocity: wp.array2d[wp.spatial_vector]
    sole_force: wp.array3d[wp.vec3]
    sole_position: wp.array3d[wp.vec3]


@wp.func
def rotated(v: wp.vec2, c: float, s: float) -> wp.vec2:
    return wp.vec2(v[0] * c + v[1] * s, v[1] * c - v[0] * s)


@wp.func
def cross_y(v: wp.vec2, w: wp.vec2) -> float:
    return v[1] * w[0] - v[0] * w[1]


@wp.func
def turning_velocity(v: wp.vec2, c: float, s: float, rate: float) -> wp.vec2:
    """Velocity of the end of a vector that rotates by `rate` [rad/s]."""
    return wp.vec2(rate * (v[1] * c - v[0] * s), -rate * (v[0] * c + v[1] * s))


@wp.func
def write_body(
    world: int,
    index: int,
    at: wp.vec2,
    side: float,
    pitch: float,
    velocity: wp.vec2,
    rate: float,
    worlds: Worlds,
) -> None:
    turn = wp.quat(0.0, wp.sin(0.5 * pitch), 0.0, wp.cos(0.5 * pitch))
    worlds.body_pose[world, index] = wp.transform(wp.vec3(at[0], side, at[1]), turn)
    worlds.body_velocity[world, index] = wp.spatial_vector(velocity[0], 0.0, velocity[1], 0.0, rate, 0.0)


@wp.func
def write_outputs(world: int, body: Body, at: vec5, speed: vec5, worlds: Worlds) -> None:
    """Joints and bodies of one world, in the order of `envs.body.model`, from the planar coordinates."""
    c1 = wp.cos(at[2])
    s1 = wp.sin(at[2])
    c2 = wp.cos(at[3])
    s2 = wp.sin(at[3])
    c3 = wp.cos(at[4])
    s3 = wp.sin(at[4])
    hat = wp.vec2(at[0], at[1])
    hip = hat + rotated(body.hip, c1, s1)
    ankle = hip + rotated(body.ankle, c2, s2)
    leg = hip + rotated(body.leg_frame, c2, s2)
    foot = ankle + rotated(body.foot_frame, c3, s3)
    hat_v = wp.vec2(speed[0], speed[1])
    hip_v = hat_v + turning_velocity(body.hip, c1, s1, speed[2])
    ankle_v = hip_v + turning_velocity(body.ankle, c2, s2, speed[3])
    hat_v += turning_velocity(body.hat_com, c1, s1, speed[2])
    leg_v = hip_v + turning_velocity(body.leg_com, c2, s2, speed[3])
    foot_v = ankle_v + turning_velocity(body.foot_com, c3, s3, speed[4])
    write_body(world, 0, hat, 0.0, at[2], hat_v, speed[2], worlds)
    for side in range(2):
        y = 1.0 - 2.0 * float(side)
        write_body(world, 1 + 2 * side, leg, y * body.half_width[0], at[3], leg_v, speed[3], worlds)
        write_body(world, 2 + 2 * side, foot, y * body.half_width[1], at[4], foot_v, speed[4], worlds)
        worlds.joint_angle[world, 2 * side] = at[3] - at[2]
        worlds.joint_angle[world, 2 * side + 1] = at[4] - at[3]
        worlds.joint_velocity[world, 2 * side] = speed[3] - speed[2]
        worlds.joint_velocity[world, 2 * side + 1] = speed[4] - speed[3]


@wp.kernel(enable_backward=False)
def advance(
    substeps: int,
    dt: float,
    iterations: int,
    top_speed: float,
    body: Body,
    torque: wp.array2d[float],
    hip_k: wp.array[float],
    ankle_k: wp.array[float],
    load: wp.array[float],
    joint_damping: wp.array[float],
    friction: wp.array[float],
    push: wp.array[float],
    inv_weight: wp.array[wp.vec3],
    worlds: Worlds,
) -> None:
    """`substeps` steps of `dt` [s] for each world; torque (N, 4), each side's actuator torques [Nm].

    push: (N,) [N], see `Simulation`.
    top_speed: at it [m/s], [rad/s] a world has diverged.
    inv_weight: MuJoCo's body_invweight0 of a foot [1/kg], dof_invweight0 of hip and ankle [1/(kg m2)].
    """
    world = wp.tid()
    hip_torque = torque[world, 0] + torque[world, 2]
    ankle_torque = torque[world, 1] + torque[world, 3]
    hip_stiffness = 2.0 * hip_k[world]
    ankle_stiffness = 2.0 * ankle_k[world]
    damping = 2.0 * joint_damping[world]
    armature = 2.0 * body.joint_armature
    mu = friction[world]
    pushed = push[world]
    g = body.gravity
    at = worlds.q[world]
    speed = worlds.qd[world]
    guess = worlds.qdd[world]

    m1 = body.hat_mass + load[world]
    below = body.leg_mass + body.foot_mass
    total = m1 + below
    e1 = body.hat_mass * body.hat_com + load[world] * body.load + below * body.hip
    e2 = body.leg_mass * body.leg_com + body.foot_mass * body.ankle
    e3 = body.foot_mass * body.foot_com
    m11 = (
        body.hat_inertia
        + body.hat_mass * wp.dot(body.hat_com, body.hat_com)
        + load[world] * wp.dot(body.load, body.load)
        + below * wp.dot(body.hip, body.hip)
    )
    m22 = (
        body.leg_inertia
        + wp.dot(body.leg_com, body.leg_com) * body.leg_mass
        + body.foot_mass * wp.dot(body.ankle, body.ankle)
    )
    m33 = body.foot_inertia + body.foot_mass * wp.dot(body.foot_com, body.foot_com)
    contact_inv_weight = inv_weight[world][0] * (1.0 + mu * mu) * 2.0 * mu * mu

    hip_moment = float(0.0)
    ankle_moment = float(0.0)
    forces = vec6()
    heel_at = wp.vec2()
    toe_at = wp.vec2()
    foot_c = float(1.0)
    foot_s = float(0.0)

    for _ in range(substeps):
        c1 = wp.cos(at[2])
        s1 = wp.sin(at[2])
        c2 = wp.cos(at[3])
        s2 = wp.sin(at[3])
        c3 = wp.cos(at[4])
        s3 = wp.sin(at[4])
        b1 = rotated(body.hip, c1, s1)
        b2 = rotated(body.ankle, c2, s2)
        w1 = rotated(e1, c1, s1)
        w2 = rotated(e2, c2, s2)
        w3 = rotated(e3, c3, s3)

        m12 = wp.dot(b1, w2)
        m13 = wp.dot(b1, w3)
        m23 = wp.dot(b2, w3)
        mass = mat5(
            total, 0.0, w1[1], w2[1], w3[1],
            0.0, total, -w1[0], -w2[0], -w3[0],
            w1[1], -w1[0], m11 + armature, m12 - armature, m13,
            w2[1], -w2[0], m12 - armature, m22 + 2.0 * armature, m23 - armature,
            w3[1], -w3[0], m13, m23 - armature, m33 + armature,
        )  # fmt: skip

        hip_angle = at[3] - at[2]
        ankle_angle = at[4] - at[3]
        hip_speed = speed[3] - speed[2]
        ankle_speed = speed[4] - speed[3]
        hip_moment = hip_torque - hip_stiffness * hip_angle - damping * hip_speed
        ankle_moment = ankle_torque - ankle_stiffness * ankle_angle - damping * ankle_speed
        t1 = speed[2] * speed[2]
        t2 = speed[3] * speed[3]
        t3 = speed[4] * speed[4]
        x12 = cross_y(b1, w2)
        x13 = cross_y(b1, w3)
        x23 = cross_y(b2, w3)
        force = vec5(
            w1[0] * t1 + w2[0] * t2 + w3[0] * t3 + pushed,
            w1[1] * t1 + w2[1] * t2 + w3[1] * t3 - total * g,
            g * w1[0] + x12 * t2 + x13 * t3 - hip_moment + pushed * (body.hat_com[1] * c1 - body.hat_com[0] * s1),
            g * w2[0] - x12 * t1 + x23 * t3 + hip_moment - ankle_moment,
            g * w3[0] - x13 * t1 - x23 * t2 + ankle_moment,
        )

        # Constraints: rows, biases and weights of the heel, the toe, and the limits of hip and ankle.
        heel_ball = rotated(body.heel, c3, s3)
        toe_ball = rotated(body.toe, c3, s3)
        ankle_z = at[1] + b1[1] + b2[1]
        heel_gap = ankle_z + heel_ball[1] - body.sole_radius
        toe_gap = ankle_z + toe_ball[1] - body.sole_radius
        # The point of contact lies halfway between the ball's lowest point and the ground.
        heel_at = wp.vec2(heel_ball[0], 0.5 * heel_gap - ankle_z)
        toe_at = wp.vec2(toe_ball[0], 0.5 * toe_gap - ankle_z)
        hip_sign = float(0.0)
        hip_past = float(0.0)
        if hip_angle < body.lower[0]:
            hip_sign = 1.0
            hip_past = hip_angle - body.lower[0]
        if hip_angle > body.upper[0]:
            hip_sign = -1.0
            hip_past = body.upper[0] - hip_angle
        ankle_sign = float(0.0)
        ankle_past = float(0.0)
        if ankle_angle < body.lower[1]:
            ankle_sign = 1.0
            ankle_past = ankle_angle - body.lower[1]
        if ankle_angle > body.upper[1]:
            ankle_sign = -1.0
            ankle_past = body.upper[1] - ankle_angle
        rows = mat65(
            0.0, 1.0, -b1[0], -b2[0], -heel_at[0],
            mu, 0.0, mu * b1[1], mu * b2[1], mu * heel_at[1],
            0.0, 1.0, -b1[0], -b2[0], -toe_at[0],
            mu, 0.0, mu * b1[1], mu * b2[1], mu * toe_at[1],
            0.0, 0.0, -hip_sign, hip_sign, 0.0,
            0.0, 0.0, 0.0, -ankle_sign, ankle_sign,
        )  # fmt: skip
        heel_bias = -body.contact_bias * (t1 * b1 + t2 * b2 + t3 * heel_ball)
        toe_bias = -body.contact_bias * (t1 * b1 + t2 * b2 + t3 * toe_ball)
        slide = rows * speed
        heel_imp = impedance(body.contact, heel_gap)
        toe_imp = impedance(body.contact, toe_gap)
        hip_imp = impedance(body.limit, hip_past)
        ankle_imp = impedance(body.limit, ankle_past)
        bias = vec6(
            body.contact.damping * slide[0] + body.contact.stiffness * heel_imp * heel_gap + heel_bias[1],
            body.contact.damping * slide[1] + mu * heel_bias[0],
            body.contact.damping * slide[2] + body.contact.stiffness * toe_imp * toe_gap + toe_bias[1],
            body.contact.damping * slide[3] + mu * toe_bias[0],
            body.limit.damping * slide[4] + body.limit.stiffness * hip_imp * hip_past,
            body.limit.damping * slide[5] + body.limit.stiffness * ankle_imp * ankle_past,
        )
        weight = vec4(
            wp.where(heel_gap < 0.0, heel_imp / ((1.0 - heel_imp) * contact_inv_weight), 0.0),
            wp.where(toe_gap < 0.0, toe_imp / ((1.0 - toe_imp) * contact_inv_weight), 0.0),
            wp.where(hip_past < 0.0, hip_imp / ((1.0 - hip_imp) * inv_weight[world][1]), 0.0),
            wp.where(ankle_past < 0.0, ankle_imp / ((1.0 - ankle_imp) * inv_weight[world][2]), 0.0),
        )
        guess = accelerate(mass, force, guess, rows, bias, weight, iterations)
        residual = rows * guess + bias
        forces = edge_forces(active_edges(residual, weight), residual, weight)
        foot_c = c3
        foot_s = s3

        # Integration, damping implicit. At the optimum M a is the sum of all forces. Summing the large, opposed contact
        # forces instead would lose precision. `solve` reads only the lower triangle.
        made = mass * guess
        mass[2, 2] += dt * damping
        mass[3, 2] -= dt * damping
        mass[3, 3] += 2.0 * dt * damping
        mass[4, 3] -= dt * damping
        mass[4, 4] += dt * damping
        speed += dt * solve(mass, made)
        at += dt * speed

    # A diverged world is marked, and its state stays as before the step.
    finite_and_slow = wp.max(wp.abs(speed)) < top_speed and wp.isfinite(speed) and wp.isfinite(at)
    worlds.diverged[world] = not finite_and_slow
    if not finite_and_slow:
        return
    worlds.q[world] = at
    worlds.qd[world] = speed
    worlds.qdd[world] = guess
    write_outputs(world, body, at, speed, worlds)
    # The rows of friction include mu; each side has half of the force.
    heel_force = wp.vec3(0.5 * mu * forces[1], 0.0, 0.5 * forces[0])
    toe_force = wp.vec3(0.5 * mu * forces[3], 0.0, 0.5 * forces[2])
    heel_local = rotated(heel_at, foot_c, -foot_s) - body.foot_frame
    toe_local = rotated(toe_at, foot_c, -foot_s) - body.foot_frame
    for foot in range(2):
        worlds.sole_force[world, foot, 0] = heel_force
        worlds.sole_force[world, foot, 1] = toe_force
        worlds.sole_position[world, foot, 0] = wp.vec3(heel_local[0], 0.0, heel_local[1])
        worlds.sole_position[world, foot, 1] = wp.vec3(toe_local[0], 0.0, toe_local[1])
        worlds.joint_force[world, 2 * foot] = 0.5 * hip_moment
        worlds.joint_force[world, 2 * foot + 1] = 0.5 * ankle_moment


@wp.kernel(enable_backward=False)
def reset(body: Body, start: vec5, mask: wp.array[wp.bool], worlds: Worlds) -> None:
    """Put the worlds of `mask` at rest with the planar coordinates `start`."""
    world = wp.tid()
    if not mask[world]:
        return
    rest = vec5()
    worlds.q[world] = start
    worlds.qd[world] = rest
    worlds.qdd[world] = rest
    worlds.diverged[world] = False
    write_outputs(world, body, start, rest, worlds)
    for foot in range(2):
        worlds.joint_force[world, 2 * foot] = 0.0
        worlds.joint_force[world, 2 * foot + 1] = 0.0
        for end in range(2):
            worlds.sole_force[world, foot, end] = wp.vec3()
            worlds.sole_position[world, foot, end] = wp.vec3()


@wp.kernel(enable_backward=False)
def write_all_outputs(body: Body, worlds: Worlds) -> None:
    """Joints and bodies of every world from its planar coordinates."""
    world = wp.tid()
    write_outputs(world, body, worlds.q[world], worlds.qd[world], worlds)
