"""Kernels of `envs.task.senses`: one thread for each world."""

import warp as wp

from envs.task.target import generator

wp.set_module_options({"fuse_fp": False})


@wp.struct
class SenseArrays:
    """The arrays of `Senses`, S readings and V observed values.

    white_sd, drift_sd: (S,) standard deviations. A drift is an Ornstein-Uhlenbeck process, of which a control step leaves
    the share `keep` and adds `renew` times new noise. source, lag: (V,) reading of each observed value, and how many control
    steps it is late. seeds, world, episode, step: of `Episodes`.
    """

    keep: float
    renew: float
    seeds: wp.array[wp.int64]
    world: wp.array[wp.int64]
    episode: wp.array[wp.int64]
    step: wp.array[wp.int64]
    exact: wp.array2d[float]
    white_sd: wp.array[float]
    drift_sd: wp.array[float]
    drift: wp.array2d[float]
    past: wp.array3d[float]
    source: wp.array[wp.int32]
    lag: wp.array[wp.int32]
    sensed: wp.array2d[float]


@wp.func
def _observe(arrays: SenseArrays, i: int) -> None:
    """What world `i` observes of its readings."""
    kept = arrays.past.shape[1]
    now = int(arrays.step[i] % wp.int64(kept))
    for value in range(arrays.sensed.shape[1]):
        slot = (now - int(arrays.lag[value]) + kept) % kept
        arrays.sensed[i, value] = arrays.past[i, slot, int(arrays.source[value])]


@wp.kernel(enable_backward=False)
def sense(mask: wp.array[wp.bool], arrays: SenseArrays) -> None:
    """New readings in the worlds of `mask`. Before the start of an episode they were those of its start."""
    i = wp.tid()
    if not mask[i]:
        return
    kept = arrays.past.shape[1]
    began = arrays.step[i] == wp.int64(0)
    now = int(arrays.step[i] % wp.int64(kept))
    random = generator(arrays.seeds[0], arrays.world[i], arrays.episode[i], arrays.step[i])
    for j in range(arrays.exact.shape[1]):
        reading = arrays.exact[i, j]
        if arrays.drift_sd[j] > 0.0:
            if began:
                arrays.drift[i, j] = arrays.drift_sd[j] * wp.randn(random)
            else:
                arrays.drift[i, j] = arrays.keep * arrays.drift[i, j] + arrays.renew * arrays.drift_sd[j] * wp.randn(random)
            reading += arrays.drift[i, j]
        if arrays.white_sd[j] > 0.0:
            reading += arrays.white_sd[j] * wp.randn(random)
        if began:
            for slot in range(kept):
                arrays.past[i, slot, j] = reading
        else:
            arrays.past[i, now, j] = reading
    _observe(arrays, i)


@wp.kernel(enable_backward=False)
def read(arrays: SenseArrays) -> None:
    """What is observed of the readings as they are."""
    _observe(arrays, wp.tid())
