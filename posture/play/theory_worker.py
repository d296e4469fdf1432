"""Theory for the present settings, computed in a separate process so that the motion never waits for it."""

from __future__ import annotations

import math
import multiprocessing
import os
import signal
import threading
from collections.abc import Callable
from concurrent.futures import Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
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
MAX_RETRIES = 3
"""How often in a row a call is made again because its process was killed."""


@dataclass(frozen=True, eq=False)
class LeastCost:
    """The torque-optimal stander of one body, amplitude and tolerance.

    cost: least cost [-] at `freq` [Hz], both (n,), nan where no motion is feasible. transition: frequency [Hz] at which
    the least-cost motion switches mode, None if it does not.
    """

    freq: Array
    cost: Array
    transition: float | None

    def at(self, freq: float) -> float:
        """The least cost at `freq` [Hz], interpolated; nan where no motion is feasible."""
        return float(np.interp(freq, self.freq, self.cost))


def least_cost(body: Segments, env: EnvConfig, tolerance: float, freqs: Array) -> LeastCost:
    """The least cost at `freqs` [Hz], (n,). Takes about half a second."""
    stander = linearise(body, env)

    def cost(freq: float) -> float:
        try:
            motion = bound(stander, freq, env.amplitude, tolerance)
        except InfeasibleError:
            return math.nan
        return torque_cost(joint_arrays(motion)[0], stander.torque_limit)

    costs = np.array([cost(float(freq)) for freq in freqs])
    transition = bound_transition(stander, env.amplitude, tolerance, (float(freqs[0]), float(freqs[-1])))
    return LeastCost(freqs, costs, transition)


class TheoryWorker:
    """One process of low priority that runs functions in order. It ends when this process ends, whatever the cause."""

    def __init__(self) -> None:
        self._lock = threading.Lock()  # sessions have threads of their own
        self._start()

    def submit(self, function: Callable[..., Any], *arguments: Any) -> Future[Any]:
        """The future of `function(*arguments)`. If the process has died, another is started."""
        with self._lock:
            try:
                return self._executor.submit(function, *arguments)
            except BrokenProcessPool:
                self._start()
                return self._executor.submit(function, *arguments)

    def close(self) -> None:
        """Cancel what has not started and wait for what has."""
        self._executor.shutdown(cancel_futures=True)

    def _start(self) -> None:
        context = multiprocessing.get_context("spawn")
        self._executor = ProcessPoolExecutor(1, context, initializer=_start_worker)


class TheoryRequest:
    """The newest result of a function whose arguments keep changing.

    One call runs at a time. When it has finished, the next call uses the newest arguments; those between are skipped. A call
    whose process is killed is made again.
    """

    def __init__(self, worker: TheoryWorker, function: Callable[..., Any]) -> None:
        self._worker, self._function = worker, function
        self._future: Future[Any] | None = None
        self._running_key: Any = None
        self._result_key: Any = None
        self._retries = 0
        self.result: Any = None
        """The newest result, for any key; None before the first, an exception if the call failed."""

    def ready(self, key: Any, *arguments: Any) -> bool:
        """Whether `result` is the one for `key`. If it is not and no call is running, start one with `arguments`."""
        if self._future is not None and self._future.done():
            failure = self._future.exception()
            if isinstance(failure, BrokenProcessPool) and self._retries < MAX_RETRIES:
                self._retries += 1  # the next call is made below, in another process
            else:
                self.result = self._future.result() if failure is None else failure
                self._result_key, self._retries = self._running_key, 0
            self._future = None
        if self._result_key != key and self._future is None:
            self._running_key, self._future = key, self._worker.submit(self._function, *arguments)
        return bool(self._result_key == key)


def _start_worker() -> None:
    """In the worker: leave Ctrl-C to the parent, lower the priority, and exit when the parent does."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    lower_priority(5)
    parent = multiprocessing.parent_process()
    assert parent is not None

    def exit_with_parent() -> None:
        parent.join()
        os._exit(0)

    threading.Thread(target=exit_with_parent, daemon=True).start()
