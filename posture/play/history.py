"""The recent past of a session, signal by signal."""

import numpy as np

from posture.analysis.trajectory import Array

SIGNALS = ("time", "freq", "hip", "ankle", "target", "head", "cop", "cost")


class History:
    """The last `capacity` samples of each signal, evenly spaced in time.

    time [s]; freq [Hz]; hip, ankle [rad], flexion and forward lean negative; target, head [m] along x; cop [m] in the foot's
    frame, nan without load; cost [-], sum over the four joints of (tau / limit)^2.
    """

    def __init__(self, capacity: int) -> None:
        self.capacity = capacity
        # Twice as long, so that what was last can be seen in one piece, and is moved to the front once in `capacity` steps.
        self._rows = np.empty((2 * capacity, len(SIGNALS)))
        self._end = 0

    def __len__(self) -> int:
        return min(self._end, self.capacity)

    def append(self, *sample: float) -> None:
        """Add one sample, in the order of SIGNALS."""
        if self._end == len(self._rows):
            self._rows[: self.capacity] = self._rows[self.capacity :]
            self._end = self.capacity
        self._rows[self._end] = sample
        self._end += 1

    def last(self, signal: str, count: int) -> Array:
        """The last `count` samples, or as many as there are. (n,)."""
        count = min(count, len(self))
        return self._rows[self._end - count : self._end, SIGNALS.index(signal)]

    def clear(self) -> None:
        """Forget all."""
        self._end = 0
