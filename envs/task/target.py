"""The head's target over time (paper Eq. 5): x(t) = A (1 - cos phi(t)), which starts at rest at 0 and reaches 2 A.

At a fixed frequency phi = 2 pi f t; in a ramp the frequency changes linearly and the phase is its integral.

Times, frequencies and phases are float64: in single precision the target would be 12 mm off after 100,000 s.
"""

import math

import torch

from envs.config import Ramp


def phase(time: torch.Tensor, freq: torch.Tensor, rate: torch.Tensor, duration: torch.Tensor) -> torch.Tensor:
    """Phase of the target [rad] after `time` [s], with start frequency `freq` [Hz] that changes by `rate` [Hz/s] for
    `duration` [s] and then is constant. All shapes (N,), float64."""
    ramped = torch.minimum(time, duration)
    return 2.0 * math.pi * (freq * time + rate * (ramped * time - 0.5 * ramped**2))


def frequency(time: torch.Tensor, freq: torch.Tensor, rate: torch.Tensor, duration: torch.Tensor) -> torch.Tensor:
    """Frequency of the target at `time` [Hz], the derivative of `phase` over 2 pi. Shape (N,)."""
    return freq + rate * torch.minimum(time, duration)


def position(phase: torch.Tensor, amplitude: float) -> torch.Tensor:
    """Target x [m] at `phase` [rad], between 0 and 2 `amplitude` (paper Eq. 5). Shape (N,)."""
    return amplitude * (1.0 - torch.cos(phase))


def velocity(phase: torch.Tensor, freq: torch.Tensor, amplitude: float) -> torch.Tensor:
    """Target velocity along x [m/s] at `phase` [rad] and momentary `freq` [Hz]. Shape (N,)."""
    return amplitude * 2.0 * math.pi * freq * torch.sin(phase)


def acceleration(phase: torch.Tensor, freq: torch.Tensor, rate: torch.Tensor, amplitude: float) -> torch.Tensor:
    """Target acceleration along x [m/s2] at `phase` [rad], with momentary `freq` [Hz] that changes by `rate` [Hz/s].

    Shape (N,).
    """
    omega = 2.0 * math.pi * freq
    return amplitude * (omega**2 * torch.cos(phase) + 2.0 * math.pi * rate * torch.sin(phase))


class FrequencySource:
    """Gives each world the frequency of its next episode: fixed, drawn from a range, or the start of a ramp.

    A drawn frequency depends only on the seed, the world and the number of its episode. A world of a large batch therefore
    has the same targets as the same world of a small one, and only the episode count needs to be saved.

    `stratified`: world i of N draws from the i-th of N equal parts of the range. The distribution over episodes stays
    uniform, and so does that over samples: otherwise frequencies at which episodes end early are rare in the samples,
    though they need the most.
    """

    def __init__(
        self,
        freq: float | tuple[float, float],
        ramp: Ramp | None,
        draw: str,
        worlds: torch.Tensor,
        num_worlds: int,
        seed: int,
    ) -> None:
        """For the `worlds` (N,) int64 out of `num_worlds`."""
        n, device = len(worlds), worlds.device
        self._seed = seed
        if ramp is not None:
            low = high = ramp.start
        else:
            low, high = freq if isinstance(freq, tuple) else (freq, freq)
        parts = num_worlds if draw == "stratified" else 1
        width = (high - low) / parts
        self._low = low + width * (worlds if parts > 1 else torch.zeros_like(worlds)).double()
        self._width = width
        self._worlds = worlds
        self.rate = torch.full((n,), ramp.rate if ramp else 0.0, dtype=torch.float64, device=device)
        self.duration = torch.full((n,), ramp.duration if ramp else 0.0, dtype=torch.float64, device=device)

    def fix(self, freq: torch.Tensor) -> None:
        """From its next episode on, world i follows the constant `freq`[i] [Hz], (N,)."""
        self._low, self._width = freq.double(), 0.0
        self.rate.zero_()

    def draw(self, episode: torch.Tensor) -> torch.Tensor:
        """Frequency [Hz] of each world's `episode` (N,) int64. Shape (N,) float64."""
        return self._low + self._width * uniform(self._seed, self._worlds, episode)


class LengthSource:
    """Gives each world the length of its next episode [control steps], uniform between `low` and `high`."""

    def __init__(self, low: int, high: int, worlds: torch.Tensor, seed: int) -> None:
        self._low, self._width, self._worlds = low, high - low + 1, worlds
        # Other random numbers than those of the frequencies.
        self._seed = ~seed

    def draw(self, episode: torch.Tensor) -> torch.Tensor:
        """Length of each world's `episode` (N,) int64. Shape (N,) int64."""
        if self._width == 1:
            return torch.full_like(episode, self._low)
        return self._low + (self._width * uniform(self._seed, self._worlds, episode)).long()


def uniform(seed: int, world: torch.Tensor, episode: torch.Tensor) -> torch.Tensor:
    """A number in [0, 1) that depends only on (seed, world, episode). Shapes (N,) int64 -> (N,) float64.

    The mixing function is that of the SplitMix64 generator (Steele, Lea and Flood 2014).
    """
    x = _mix(_mix(_mix(torch.full_like(world, seed)) + world) + episode)
    return (x >> 11).bitwise_and((1 << 53) - 1).double() / float(1 << 53)


def _mix(x: torch.Tensor) -> torch.Tensor:
    x = x + _signed(0x9E3779B97F4A7C15)
    x = (x ^ _shift(x, 30)) * _signed(0xBF58476D1CE4E5B9)
    x = (x ^ _shift(x, 27)) * _signed(0x94D049BB133111EB)
    return x ^ _shift(x, 31)


def _shift(x: torch.Tensor, bits: int) -> torch.Tensor:
    """Logical right shift of int64, which torch shifts arithmetically."""
    return (x >> bits).bitwise_and((1 << (64 - bits)) - 1)


def _signed(value: int) -> int:
    return value - (1 << 64) if value >= 1 << 63 else value
