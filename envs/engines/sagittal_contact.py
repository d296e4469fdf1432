"""Soft contact and joint limits of the planar stander, MuJoCo's way: a convex problem in the accelerations, and its solver.

Heel and toe are balls of radius s at the ends of the sole. One that penetrates the ground by -dist has the velocity
(v_x, v_z), linear in the coordinates by rows J_x, J_z, and MuJoCo's friction pyramid has the four edges n + mu x, n - mu x,
n + mu y, n - mu y. In this plane the last two are both J_z. With the softness of solref, solimp: impedance I(dist), K, B,
regularisation

    1 / D = 2 mu^2 (1 + mu^2) w (1 - I) / I,       w = body_invweight0 of the foot,

an edge e exerts the force D max(0, -(J_e a - a_ref,e)), a_ref,e = -B J_e v - K I dist - c J_e'v, where MuJoCo's own c is 0
(envs/engines/contact_bias.py). It can only push, and each ball's force lies in the pyramid because it is a sum over its
edges. Joint limits are single such rows with 1 / D = w_joint (1 - I) / I. The accelerations a minimise the convex

    1/2 a'Ma - a'F + 1/2 sum_e D_e min(0, J_e a - a_ref,e)^2,        each edge counted once per foot,

found by Newton's method with an exact line search. Most of the time the set of active edges is that of the previous
step, and one linear solve is exact.
"""

import warp as wp

vec4 = wp.vec4
vec5 = wp.types.vector(length=5, dtype=float)
mat5 = wp.types.matrix(shape=(5, 5), dtype=float)
vec6 = wp.types.vector(length=6, dtype=float)
mat65 = wp.types.matrix(shape=(6, 5), dtype=float)


@wp.struct
class Softness:
    """A constraint's reference acceleration and impedance: MuJoCo's K [1/s2], B [1/s] and solimp."""

    stiffness: float
    damping: float
    low: float
    high: float
    width: float
    midpoint: float
    power: float


@wp.func
def impedance(soft: Softness, distance: float) -> float:
    """MuJoCo's solimp: from `low` at touch to `high` at `width`, along a power curve through `midpoint`."""
    x = wp.min(wp.abs(distance) / soft.width, 1.0)
    y = float(0.0)
    if x < soft.midpoint:
        if soft.power == 2.0:
            y = x * x / soft.midpoint
        else:
            y = wp.pow(x, soft.power) / wp.pow(soft.midpoint, soft.power - 1.0)
    else:
        if soft.power == 2.0:
            y = 1.0 - (1.0 - x) * (1.0 - x) / (1.0 - soft.midpoint)
        else:
            y = 1.0 - wp.pow(1.0 - x, soft.power) / wp.pow(1.0 - soft.midpoint, soft.power - 1.0)
    if x >= 1.0:
        y = 1.0
    return soft.low + y * (soft.high - soft.low)


@wp.func
def solve(a: mat5, b: vec5) -> vec5:
    """Solve a x = b by LDL' factorisation; a is symmetric and positive definite, and only its lower triangle is read."""
    l10 = a[1, 0] / a[0, 0]
    l20 = a[2, 0] / a[0, 0]
    l30 = a[3, 0] / a[0, 0]
    l40 = a[4, 0] / a[0, 0]
    d1 = a[1, 1] - l10 * a[1, 0]
    c21 = a[2, 1] - l20 * a[1, 0]
    c31 = a[3, 1] - l30 * a[1, 0]
    c41 = a[4, 1] - l40 * a[1, 0]
    l21 = c21 / d1
    l31 = c31 / d1
    l41 = c41 / d1
    d2 = a[2, 2] - l20 * a[2, 0] - l21 * c21
    c32 = a[3, 2] - l30 * a[2, 0] - l31 * c21
    c42 = a[4, 2] - l40 * a[2, 0] - l41 * c21
    l32 = c32 / d2
    l42 = c42 / d2
    d3 = a[3, 3] - l30 * a[3, 0] - l31 * c31 - l32 * c32
    c43 = a[4, 3] - l40 * a[3, 0] - l41 * c31 - l42 * c32
    l43 = c43 / d3
    d4 = a[4, 4] - l40 * a[4, 0] - l41 * c41 - l42 * c42 - l43 * c43
    y0 = b[0]
    y1 = b[1] - l10 * y0
    y2 = b[2] - l20 * y0 - l21 * y1
    y3 = b[3] - l30 * y0 - l31 * y1 - l32 * y2
    y4 = b[4] - l40 * y0 - l41 * y1 - l42 * y2 - l43 * y3
    x4 = y4 / d4
    x3 = y3 / d3 - l43 * x4
    x2 = y2 / d2 - l32 * x3 - l42 * x4
    x1 = y1 / d1 - l21 * x2 - l31 * x3 - l41 * x4
    x0 = y0 / a[0, 0] - l10 * x1 - l20 * x2 - l30 * x3 - l40 * x4
    return vec5(x0, x1, x2, x3, x4)


@wp.func
def active_edges(r: vec6, weight: vec4) -> int:
    """The edges that exert a force, one bit each: n + t, n - t, n of heel and toe, then the limits of hip and ankle."""
    edges = int(0)
    if weight[0] > 0.0:
        if r[0] + r[1] < 0.0:
            edges |= 1
        if r[0] - r[1] < 0.0:
            edges |= 2
        if r[0] < 0.0:
            edges |= 4
    if weight[1] > 0.0:
        if r[2] + r[3] < 0.0:
            edges |= 8
        if r[2] - r[3] < 0.0:
            edges |= 16
        if r[2] < 0.0:
            edges |= 32
    if weight[2] > 0.0 and r[4] < 0.0:
        edges |= 64
    if weight[3] > 0.0 and r[5] < 0.0:
        edges |= 128
    return edges


@wp.func
def bit(edges: int, place: int) -> float:
    return float((edges >> place) & 1)


@wp.func
def edge_forces(edges: int, r: vec6, weight: vec4) -> vec6:
    """Sum of the forces of the active edges along the six rows, with residuals r: minus the gradient of their cost."""
    heel_plus = -2.0 * weight[0] * bit(edges, 0) * (r[0] + r[1])
    heel_minus = -2.0 * weight[0] * bit(edges, 1) * (r[0] - r[1])
    heel_side = -4.0 * weight[0] * bit(edges, 2) * r[0]
    toe_plus = -2.0 * weight[1] * bit(edges, 3) * (r[2] + r[3])
    toe_minus = -2.0 * weight[1] * bit(edges, 4) * (r[2] - r[3])
    toe_side = -4.0 * weight[1] * bit(edges, 5) * r[2]
    return vec6(
        heel_plus + heel_minus + heel_side,
        heel_plus - heel_minus,
        toe_plus + toe_minus + toe_side,
        toe_plus - toe_minus,
        -2.0 * weight[2] * bit(edges, 6) * r[4],
        -2.0 * weight[3] * bit(edges, 7) * r[5],
    )


@wp.func
def hessian(mass: mat5, edges: int, rows: mat65, weight: vec4) -> mat5:
    """Second derivative of the cost by the accelerations, with these active edges."""
    h = mass
    for end in range(2):
        plus = 2.0 * weight[end] * bit(edges, 3 * end)
        minus = 2.0 * weight[end] * bit(edges, 3 * end + 1)
        side = 4.0 * weight[end] * bit(edges, 3 * end + 2)
        n = rows[2 * end]
        t = rows[2 * end + 1]
        h += wp.outer(n, (plus + minus + side) * n + (plus - minus) * t)
        h += wp.outer(t, (plus - minus) * n + (plus + minus) * t)
    if edges >= 64:
        for joint in range(2):
            row = rows[4 + joint]
            h += (2.0 * weight[2 + joint] * bit(edges, 6 + joint)) * wp.outer(row, row)
    return h


@wp.func
def line_search(slope: float, curvature: float, r: vec6, dr: vec6, weight: vec4) -> float:
    """Length of the step that minimises the cost along it; slope and curvature: of the smooth part of the cost at 0."""
    low = float(0.0)
    high = float(1.0)
    alpha = float(1.0)
    for _ in range(20):
        at = r + alpha * dr
        edges = active_edges(at, weight)
        derivative = slope + alpha * curvature - wp.dot(edge_forces(edges, at, weight), dr)
        second = curvature - wp.dot(edge_forces(edges, dr, weight), dr)
        if derivative > 0.0:
            high = alpha
        else:
            low = alpha
        if derivative <= 0.0 and alpha == 1.0:
            break
        step = derivative / second
        alpha -= step
        if alpha <= low or alpha >= high:
            alpha = 0.5 * (low + high)
        if wp.abs(step) < 1.0e-6 or high - low < 1.0e-6:
            break
    return alpha


@wp.func
def accelerate(mass: mat5, force: vec5, start: vec5, rows: mat65, bias: vec6, weight: vec4, iterations: int) -> vec5:
    """The accelerations that minimise the cost, by iteration from `start`."""
    a = start
    edges = active_edges(rows * a + bias, weight)
    for _ in range(iterations):
        h = hessian(mass, edges, rows, weight)
        new = solve(h, force + edge_forces(edges, bias, weight) * rows)
        now = active_edges(rows * new + bias, weight)
        if now == edges:
            a = new
            break
        step = new - a
        along = mass * step
        slope = wp.dot(along, a) - wp.dot(step, force)
        a += line_search(slope, wp.dot(along, step), rows * a + bias, rows * step, weight) * step
        edges = active_edges(rows * a + bias, weight)
    return a
