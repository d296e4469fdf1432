"""The least cost against the optimiser and the transition of posture.theory; requests whose arguments keep changing."""

import math
import os
import time
from concurrent.futures import Future
from concurrent.futures.process import BrokenProcessPool

import numpy as np
import pytest

from posture.play.theory_worker import MAX_RETRIES, TheoryRequest, TheoryWorker, least_cost
from posture.theory.motion import joint_arrays
from posture.theory.optimum import bound
from posture.theory.stander import linearise
from posture.theory.transition import hip_ankle_correlation


def test_least_cost_and_transition_frequency(body, config):
    found, stander = least_cost(body, config, 0.025, np.linspace(0.05, 1.5, 16)), linearise(body, config)
    for freq in (0.1, 0.62, 1.33):
        torque = joint_arrays(bound(stander, freq, 0.1, 0.025))[0]
        assert found.at(freq) == pytest.approx(np.mean(np.sum((torque / 100.0) ** 2, axis=1)), rel=0.01)
    for side in (-0.01, 0.01):
        assert hip_ankle_correlation(bound(stander, found.transition + side, 0.1, 0.025)) * side < 0


def test_least_cost_is_nan_where_no_motion_is_feasible(body, env_config):
    assert math.isnan(least_cost(body, env_config("env.amplitude=0.6"), 0.025, np.array([0.1, 1.5])).at(1.5))


def test_process_that_was_killed_is_replaced():
    worker = TheoryWorker()
    try:
        with pytest.raises(BrokenProcessPool):
            worker.submit(os._exit, 1).result(timeout=60)
        assert worker.submit(math.sqrt, 4.0).result(timeout=60) == 2.0
    finally:
        worker.close()


def killed_at_first(mark):
    """A call whose process dies if there is no file `mark`, which it makes."""
    if not mark.exists():
        mark.touch()
        os._exit(1)
    return "done"


def test_call_of_a_process_that_was_killed_is_made_again(tmp_path):
    worker = TheoryWorker()
    try:
        request, end = TheoryRequest(worker, killed_at_first), time.monotonic() + 60
        while not request.ready("key", tmp_path / "mark"):
            assert time.monotonic() < end, "timeout"
            time.sleep(0.01)
        assert request.result == "done"
    finally:
        worker.close()


def test_call_that_always_kills_its_process_is_given_up():
    calls = []

    class Worker:
        def submit(self, function, *arguments):
            calls.append(Future())
            calls[-1].set_exception(BrokenProcessPool())
            return calls[-1]

    request = TheoryRequest(Worker(), math.sqrt)
    while not request.ready("key", 4.0):
        assert len(calls) <= 1 + MAX_RETRIES
    assert len(calls) == 1 + MAX_RETRIES and isinstance(request.result, BrokenProcessPool)


def test_one_call_at_a_time_and_the_newest_arguments_next():
    calls = []

    class Worker:
        def submit(self, function, *arguments):
            calls.append((Future(), function, arguments))
            return calls[-1][0]

    def finish(call):
        future, function, arguments = call
        future.set_result(function(*arguments))

    request = TheoryRequest(Worker(), lambda x: 2 * x)
    assert not any(request.ready(x, x) for x in (1, 2, 3)) and len(calls) == 1
    finish(calls[0])
    assert not request.ready(3, 3) and request.result == 2
    finish(calls[1])
    assert request.ready(3, 3) and request.result == 6 and len(calls) == 2
