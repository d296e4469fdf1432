"""What the torque-optimal stander says of the present sliders, computed in a process of its own, so that nothing waits."""

from __future__ import annotations

import math
import multiprocessing
import os
import signal
import threading
from collections.abc import Callable
from concurrent.futures import Future, ProcessPoolExecutor
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from envs.body.segments import Segments
from envs.config import EnvConfig
from posture.analysis.coordination import torque_cost
from posture.analysis.trajectory import Array
from posture.operating_system import lower_priority
from posture.theory.motion import joint_arrays
from posture.theory.optimum import bound
from posture.theory.program import InfeasibleError
from posture.theory.stander import linearise
from posture.theory.transition import bound_transition

Coefficients = NDArray[np.complex128]


@dataclass(frozen=True, eq=False)
class Least:
    """Of one body, amplitude and tolerance: the least cost [-] at `freq` [Hz], both (n,), nan where no motion keeps the
    limits, and the frequency [Hz] at which the least-cost motion switches mode, None without one."""

    freq: Array
    cost: Array
    transition: float | None

    def at(self, freq: float) -> float:
        """The least cost at `freq` [Hz], interpolated; nan where there is none."""
        return float(np.interp(freq, self.freq, self.cost))


def least(body: Segments, env: EnvConfig, tolerance: float, freqs: Array) -> Least:
    """See `Least`; its frequencies are those given. Takes about half a second."""
    stander = linearise(body, env)

    def cost(freq: float) -> float:
        try:
            motion = bound(stander, freq, env.amplitude, tolerance)
        except InfeasibleError:
            return math.nan
        return torque_cost(joint_arrays(motion)[0], stander.torque_limit)

    costs = np.array([cost(float(freq)) for freq in freqs])
    return Least(freqs, costs, bound_transition(stander, env.amplitude, tolerance, (float(freqs[0]), float(freqs[-1]))))


class Office:
    """One process of low priority that works off what it is asked, in order. It ends with this one, however that ends."""

    def __init__(self) -> None:
        context = multiprocessing.get_context("spawn")
        self._executor = ProcessPoolExecutor(1, context, initializer=_settle)

    def submit(self, function: Callable[..., Any], *arguments: Any) -> Future[Any]:
        """The future of `function(*arguments)`."""
        return self._executor.submit(function, *arguments)

    def close(self) -> None:
        """Drop what has not begun and wait for what has."""
        self._executor.shutdown(cancel_futures=True)


class Asked:
    """The newest answer to a question whose arguments keep changing: one at a time is computed, the last asked is next."""

    def __init__(self, office: Office, function: Callable[..., Any]) -> None:
        self._office, self._function = office, function
        self._future: Future[Any] | None = None
        self._asked: Any = None
        self._known: Any = None
        self.answer: Any = None
        """The newest answer there is, whatever it was asked for; None before the first, an exception where it failed."""

    def about(self, key: Any, *arguments: Any) -> bool:
        """Whether `answer` is to the question `key`; if not, it is or will be on its way, with these arguments."""
        if self._future is not None and self._future.done():
            failure = self._future.exception()
            self.answer = self._future.result() if failure is None else failure
            self._known, self._future = self._asked, None
        if self._known != key and self._future is None:
            self._asked, self._future = key, self._office.submit(self._function, *arguments)
        return bool(self._known == key)


def _settle() -> None:
    """Of the process: leave Ctrl-C to its parent, give way to the motion, and end when the parent does."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    lower_priority(5)
    parent = multiprocessing.parent_process()
    assert parent is not None

    def follow() -> None:
        parent.join()
        os._exit(0)

    threading.Thread(target=follow, daemon=True).start()
