"""The head's target over time (paper Eq. 5), in Warp: x(t) = A (1 - cos phi(t)), which starts at rest at 0 and reaches 2 A.

At a fixed frequency phi = 2 pi f t; in a ramp the frequency changes linearly and the phase is its integral.

Times, frequencies and phases are float64: in single precision the target would be 12 mm off after 100,000 s.
"""

import math

import warp as wp

TWO_PI = wp.constant(wp.float64(2.0 * math.pi))
UNIT = wp.constant(wp.float64(2.0**-53))
"""Spacing of the 53-bit numbers in [0, 1)."""

SUM_MEAN = wp.constant(4 * 65535 / 2)
SUM_DEVIATION = wp.constant(math.sqrt(4 * (65536**2 - 1) / 12))
"""Mean and standard deviation of the sum of four whole numbers that are uniform in 0 .. 65535."""


@wp.struct
class Motion:
    """position [m], velocity [m/s] and acceleration [m/s2] along x; momentary frequency [Hz]."""

    position: float
    velocity: float
    acceleration: float
    frequency: float


@wp.struct
class Course:
    """What determines a target's motion: `freq` at its start [Hz], which changes by `rate` [Hz/s] for `duration` [s] and
    then is constant; `amplitude` [m]; `offset`, added to the phase [rad]."""

    freq: wp.float64
    rate: wp.float64
    duration: wp.float64
    amplitude: wp.float64
    offset: wp.float64


@wp.func
def motion(course: Course, time: wp.float64) -> Motion:
    """Motion of the target at `time` [s] of its episode. Position is between 0 and 2 `amplitude`."""
    ramped = wp.min(time, course.duration)
    half = wp.float64(0.5)
    phase = TWO_PI * (course.freq * time + course.rate * (ramped * time - half * ramped * ramped)) + course.offset
    frequency = course.freq + course.rate * ramped
    omega = TWO_PI * frequency
    change = wp.where(time < course.duration, TWO_PI * course.rate, wp.float64(0.0))
    sine = wp.sin(phase)
    cosine = wp.cos(phase)
    result = Motion()
    result.position = wp.float32(course.amplitude * (wp.float64(1.0) - cosine))
    result.velocity = wp.float32(course.amplitude * omega * sine)
    result.acceleration = wp.float32(course.amplitude * (omega * omega * cosine + change * sine))
    result.frequency = wp.float32(frequency)
    return result


@wp.func
def uniform(seed: wp.uint64, world: wp.uint64, episode: wp.uint64) -> wp.float64:
    """A number in [0, 1) that depends only on (seed, world, episode).

    A world of a large batch has therefore the same numbers as the same world of a small one, and only the count of its
    episodes needs to be saved. The mixing function is that of SplitMix64 (Steele, Lea and Flood 2014).
    """
    x = _mix(_mix(_mix(seed) + world) + episode)
    return wp.float64(x >> wp.uint64(11)) * UNIT


@wp.func
def random_bits(seed: wp.int64, world: wp.int64, episode: wp.int64, step: wp.int64) -> wp.uint64:
    """64 random bits that depend only on (seed, world, episode, step)."""
    return _mix(_mix(_mix(_mix(wp.uint64(seed)) + wp.uint64(world)) + wp.uint64(episode)) + wp.uint64(step))


@wp.func
def normal(bits: wp.uint64, index: int) -> float:
    """The number `index` of those that belong to `bits`: mean 0, standard deviation 1, between -3.46 and 3.46.

    It is the sum of four uniform numbers, which is nearly normal (kurtosis 2.7) and takes little time.
    """
    x = _mix(bits + wp.uint64(index))
    part = wp.uint64(0xFFFF)
    total = (x & part) + ((x >> wp.uint64(16)) & part) + ((x >> wp.uint64(32)) & part) + (x >> wp.uint64(48))
    return (float(int(total)) - SUM_MEAN) / SUM_DEVIATION


@wp.func
def _mix(x: wp.uint64) -> wp.uint64:
    x = x + wp.uint64(0x9E3779B97F4A7C15)
    x = (x ^ (x >> wp.uint64(30))) * wp.uint64(0xBF58476D1CE4E5B9)
    x = (x ^ (x >> wp.uint64(27))) * wp.uint64(0x94D049BB133111EB)
    return x ^ (x >> wp.uint64(31))
