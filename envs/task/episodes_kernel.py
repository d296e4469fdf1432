"""Kernels of `envs.task.episodes`: what changes in the episodes of N worlds, one thread for each world."""

import warp as wp

from envs.body.joints import BODIES, FEET
from envs.task.target import Course, motion, uniform

# Else the compiler contracts products and sums, and results depend on the processor.
wp.set_module_options({"fuse_fp": False})

_HAT = wp.constant(BODIES.index("hat"))
_LEFT_FOOT, _RIGHT_FOOT = (wp.constant(BODIES.index(foot)) for foot in FEET)


@wp.struct
class EpisodeArrays:
    """The arrays of `Episodes`, and the constants of all arrays.

    head, hat_com: head centre and centre of mass in the frame of the HAT [m].
    length_low, length_range: lengths are low, low + 1, ..., low + range - 1.
    seeds: (2,) of the random numbers of frequencies, or of rows of `bodies`, and of lengths.
    bodies: see `envs.task.bodies`; world i draws from its `num_rows`[i] rows from `first_row`[i] on, if any.
    """

    control_dt: wp.float64
    head: wp.vec3
    hat_com: wp.vec3
    length_low: wp.float64
    length_range: wp.float64
    seeds: wp.array[wp.int64]
    world: wp.array[wp.int64]
    freq_low: wp.array[wp.float64]
    freq_range: wp.array[wp.float64]
    ramp_rate: wp.array[wp.float64]
    ramp_duration: wp.array[wp.float64]
    amplitude: wp.array[wp.float64]
    tolerance: wp.array[float]
    effort_scale: wp.array[float]
    bodies: wp.array2d[wp.float64]
    first_row: wp.array[wp.int64]
    num_rows: wp.array[wp.int64]
    hip_k: wp.array[float]
    ankle_k: wp.array[float]
    load: wp.array[float]
    joint_damping: wp.array[float]
    friction: wp.array[float]
    body_pose: wp.array2d[wp.transform]
    body_velocity: wp.array2d[wp.spatial_vector]
    foot_start: wp.array2d[wp.vec3]
    episode: wp.array[wp.int64]
    step: wp.array[wp.int64]
    length: wp.array[wp.int64]
    freq: wp.array[wp.float64]
    phase_offset: wp.array[wp.float64]
    action: wp.array2d[float]
    command: wp.array2d[float]
    activation: wp.array2d[float]
    track: wp.array2d[float]
    target_x: wp.array[float]
    target_vx: wp.array[float]
    target_ax: wp.array[float]
    target_freq: wp.array[float]
    head_x: wp.array[float]
    head_vx: wp.array[float]
    foot_displacement: wp.array2d[float]


@wp.func
def _read(arrays: EpisodeArrays, i: int) -> None:
    """Where target, head and feet of world `i` are."""
    course = Course()
    course.freq = arrays.freq[i]
    course.rate = arrays.ramp_rate[i]
    course.duration = arrays.ramp_duration[i]
    course.amplitude = arrays.amplitude[i]
    course.offset = arrays.phase_offset[i]
    target = motion(course, wp.float64(arrays.step[i]) * arrays.control_dt)
    arrays.target_x[i] = target.position
    arrays.target_vx[i] = target.velocity
    arrays.target_ax[i] = target.acceleration
    arrays.target_freq[i] = target.frequency
    arrays.track[i, 0] = target.position

    hat = arrays.body_pose[i, _HAT]
    attitude = wp.transform_get_rotation(hat)
    velocity = arrays.body_velocity[i, _HAT]
    arrays.head_x[i] = wp.transform_get_translation(hat)[0] + wp.quat_rotate(attitude, arrays.head)[0]
    # The HAT's velocity is that of its centre of mass.
    lever = wp.quat_rotate(attitude, arrays.head - arrays.hat_com)
    arrays.head_vx[i] = velocity[0] + wp.cross(wp.spatial_bottom(velocity), lever)[0]
    left = wp.transform_get_translation(arrays.body_pose[i, _LEFT_FOOT])
    right = wp.transform_get_translation(arrays.body_pose[i, _RIGHT_FOOT])
    arrays.foot_displacement[i, 0] = wp.length(left - arrays.foot_start[i, 0])
    arrays.foot_displacement[i, 1] = wp.length(right - arrays.foot_start[i, 1])


@wp.func
def _draw_length(arrays: EpisodeArrays, i: int) -> None:
    number = uniform(wp.uint64(arrays.seeds[1]), wp.uint64(arrays.world[i]), wp.uint64(arrays.episode[i]))
    arrays.length[i] = wp.int64(arrays.length_low + wp.floor(arrays.length_range * number))


@wp.func
def _take(arrays: EpisodeArrays, i: int, row: int) -> None:
    """Body and target of a row of `bodies`, whose columns are `envs.task.bodies.COLUMNS` and `effort_scale`."""
    if arrays.ramp_duration[i] == wp.float64(0.0):
        arrays.freq[i] = arrays.bodies[row, 0]
    else:
        arrays.freq[i] = arrays.freq_low[i]
    arrays.hip_k[i] = float(arrays.bodies[row, 1])
    arrays.ankle_k[i] = float(arrays.bodies[row, 2])
    arrays.load[i] = float(arrays.bodies[row, 3])
    arrays.amplitude[i] = arrays.bodies[row, 4]
    arrays.joint_damping[i] = float(arrays.bodies[row, 5])
    arrays.friction[i] = float(arrays.bodies[row, 6])
    arrays.tolerance[i] = float(arrays.bodies[row, 7])
    arrays.effort_scale[i] = float(arrays.bodies[row, 8])


@wp.kernel(enable_backward=False)
def begin(mask: wp.array[wp.bool], arrays: EpisodeArrays) -> None:
    """A new episode in the worlds of `mask`."""
    i = wp.tid()
    if not mask[i]:
        return
    arrays.episode[i] = arrays.episode[i] + wp.int64(1)
    arrays.step[i] = wp.int64(0)
    arrays.phase_offset[i] = wp.float64(0.0)
    number = uniform(wp.uint64(arrays.seeds[0]), wp.uint64(arrays.world[i]), wp.uint64(arrays.episode[i]))
    if arrays.num_rows[i] == wp.int64(0):
        arrays.freq[i] = arrays.freq_low[i] + arrays.freq_range[i] * number
    else:
        _take(arrays, i, int(arrays.first_row[i] + wp.int64(wp.floor(wp.float64(arrays.num_rows[i]) * number))))
    _draw_length(arrays, i)
    for joint in range(arrays.action.shape[1]):
        arrays.action[i, joint] = 0.0
        arrays.command[i, joint] = 0.0
        arrays.activation[i, joint] = 0.0
    for past in range(arrays.track.shape[1]):
        arrays.track[i, past] = 0.0
    _read(arrays, i)


@wp.kernel(enable_backward=False)
def advance(arrays: EpisodeArrays) -> None:
    """One more step of each episode."""
    i = wp.tid()
    arrays.step[i] = arrays.step[i] + wp.int64(1)
    last = arrays.track.shape[1] - 1
    for past in range(last):
        arrays.track[i, last - past] = arrays.track[i, last - past - 1]
    _read(arrays, i)


@wp.kernel(enable_backward=False)
def restore(arrays: EpisodeArrays) -> None:
    """Everything that follows from episode, step, freq, phase_offset and the body."""
    i = wp.tid()
    _draw_length(arrays, i)
    _read(arrays, i)
