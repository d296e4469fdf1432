"""Kernels of `envs.task.senses`: one thread for each world."""

import warp as wp

from envs.task.target import normal, random_bits

wp.set_module_options({"fuse_fp": False})


@wp.struct
class SenseArrays:
    """The arrays of `Senses`, S readings in each world.

    white_sd, drift_sd: (S,) standard deviations, in the units of `exact`. A drift is an Ornstein-Uhlenbeck process, of which
    a control step leaves the share `keep` and adds `renew` times new noise. seeds, world, episode, step: of `Episodes`.
    """

    keep: float
    renew: float
    seeds: wp.array[wp.int64]
    world: wp.array[wp.int64]
    episode: wp.array[wp.int64]
    step: wp.array[wp.int64]
    now: wp.array[wp.int64]
    exact: wp.array2d[float]
    white_sd: wp.array[float]
    drift_sd: wp.array[float]
    drift: wp.array2d[float]
    past: wp.array2d[float]


@wp.kernel(enable_backward=False)
def sense(mask: wp.array[wp.bool], arrays: SenseArrays) -> None:
    """New readings in the worlds of `mask`. Before the start of an episode they were those of its start."""
    i = wp.tid()
    if not mask[i]:
        return
    count = arrays.exact.shape[1]
    size = arrays.past.shape[1]
    began = arrays.step[i] == wp.int64(0)
    now = count * int(arrays.now[0] % wp.int64(size // count))
    bits = random_bits(arrays.seeds[0], arrays.world[i], arrays.episode[i], arrays.step[i])
    for j in range(count):
        reading = arrays.exact[i, j]
        if arrays.drift_sd[j] > 0.0:
            if began:
                arrays.drift[i, j] = arrays.drift_sd[j] * normal(bits, 2 * j)
            else:
                arrays.drift[i, j] = arrays.keep * arrays.drift[i, j] + arrays.renew * arrays.drift_sd[j] * normal(
                    bits, 2 * j
                )
            reading += arrays.drift[i, j]
        if arrays.white_sd[j] > 0.0:
            reading += arrays.white_sd[j] * normal(bits, 2 * j + 1)
        if began:
            for slot in range(size // count):
                arrays.past[i, count * slot + j] = reading
        else:
            arrays.past[i, now + j] = reading
